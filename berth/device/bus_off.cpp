#include "berth/device/bus_off.hpp"

namespace berth::device {

BusOffRecovery::BusOffRecovery(can::Dispatcher& dispatcher, const Host& host, Errors& errors,
                               rt::Duration wait) noexcept
    : dispatcher_(&dispatcher), host_(&host), errors_(&errors), wait_(host.in_world(wait)) {
  if (host.has_port()) dispatcher.on_status(this);
}

BusOffRecovery::~BusOffRecovery() {
  if (host_->has_port()) dispatcher_->on_status(nullptr);
}

void BusOffRecovery::power_off() noexcept {
  cancel();
  powered_ = off_ = false;
}

void BusOffRecovery::changed(const can::Status& status, rt::Time) noexcept {
  if (!powered_) return;
  if (status.bus_off && !off_) {
    off_ = true;
    errors_->behave(Errors::communication);
    if (wait_ > rt::Duration::zero()) dispatcher_->executor().after(wait_, *this);
    return;
  }
  if (status.bus_off) return;
  if (status.error_passive()) {
    errors_->raise(co::emcy_code::error_passive, co::error_register::communication);
  } else {
    errors_->clear(co::emcy_code::error_passive);
  }
}

void BusOffRecovery::run() noexcept {
  off_ = false;
  dispatcher_->port().restart(dispatcher_->port().status().bit_rate);
  errors_->raise(co::emcy_code::recovered_from_bus_off, co::error_register::communication);
  errors_->clear(co::emcy_code::recovered_from_bus_off);
}

}  // namespace berth::device

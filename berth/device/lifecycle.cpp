#include "berth/device/lifecycle.hpp"

#include <utility>

#include "berth/od/cia302.hpp"

namespace berth::device {

Lifecycle::Lifecycle(const Surroundings& on, const Options& options, od::Values& values, Owner& owner)
    : dispatcher_(on.dispatcher),
      values_(&values),
      owner_(&owner),
      nmt_(*on.dispatcher, static_cast<co::NmtSlave::Owner&>(*this)),
      parts_(on, options, values, nmt_, static_cast<LssSlave::Owner&>(*this),
             static_cast<NodeIdSchemes::Owner&>(*this)) {
  reset_values(od::Area::all);
}

Lifecycle::~Lifecycle() {
  owner_ = nullptr;
  parts_.application.silence();
  stop_services();
}

// --- Power -----------------------------------------------------------------------------------------------------------

void Lifecycle::power_on() noexcept {
  if (powered()) power_off();
  parts_.lss.power_on();
  parts_.stored.power_on();
  parts_.schemes.power_on();
  if (parts_.programming) parts_.programming->programs().power_on();
  parts_.bus_off.power_on();
  begins_ = Reset::power_on;
  nmt_.power_on();
  changed();
}

void Lifecycle::power_off() noexcept {
  begins_.reset();
  cancel();
  parts_.bus_off.power_off();
  stop_services();
  nmt_.power_off();
  parts_.own_identifiers.stop();
  parts_.lss.power_off();
  parts_.schemes.power_off();
  parts_.stored.power_off();
  if (parts_.programming) parts_.programming->programs().power_off();
  parts_.host.clear();
  changed();
}

// --- Resets ----------------------------------------------------------------------------------------------------------

void Lifecycle::reset(co::NmtReset what, rt::Time) noexcept {
  const auto& timing = parts_.host.timing();
  stop_services();
  if (begins_ == Reset::power_on) {
    begin(Reset::power_on, timing.boot);
  } else {
    begin(what == co::NmtReset::node ? Reset::node : Reset::communication, timing.reset);
  }
}

void Lifecycle::begin(Reset what, rt::Duration own_time) noexcept {
  begins_ = what;
  parts_.own_identifiers.stop();
  parts_.schemes.resetting();
  parts_.lss.resetting();
  parts_.stored.resetting();
  parts_.host.booting(true);
  dispatcher_->executor().after(parts_.host.in_world(own_time), *this);
  changed();
}

// The reset is over.
void Lifecycle::run() noexcept {
  if (!begins_) return;
  const Reset what = *std::exchange(begins_, std::nullopt);
  parts_.lss.reset(what);
  reset_values(what == Reset::communication ? od::Area::communication : od::Area::all);
  parts_.host.booting(false);
  if (parts_.programming) {
    auto& programs = parts_.programming->programs();
    if (what == Reset::node) programs.restarted();
    nmt_.hold(!programs.runs());
  }
  check_memory(what);
  if (what != Reset::communication) parts_.application.tell(&Callbacks::start);
  const auto id = parts_.lss.active().node_id;
  nmt_.initialised(id);
  if (nmt_.state() == NmtState::initialising) {
    parts_.lss.listen(true);
    parts_.schemes.listen();
  }
  parts_.schemes.ready(id);
  changed();
}

void Lifecycle::reset_values(od::Area area) noexcept {
  parts_.stored.reset_values(area);
  if (parts_.node_id_object) parts_.node_id_object->show();
  parts_.application.tell(&Callbacks::parameters);
}

void Lifecycle::node_id_given(NodeId id) noexcept {
  reset_values(od::Area::communication);
  nmt_.initialised(id);
  changed();
}

// --- NMT states ------------------------------------------------------------------------------------------------------

void Lifecycle::state_changed(NmtState from, NmtState to, rt::Time) noexcept {
  if (to == NmtState::initialising) {
    stop_services();
  } else if (from == NmtState::initialising) {
    start_services();
    self_start();
  } else {
    parts_.error_control.set_state(to);
    set_services(co::services_in(from), co::services_in(to));
  }
  parts_.application.tell(&Callbacks::state, to);
  changed();
}

// 1F80h of a device that is not NMT master (bit 0 = 0): bit 3 = 1 "may start itself", bit 2 = 1 "waits to be started"
// (docs/protocols/cia301.md §NMT).
void Lifecycle::self_start() noexcept {
  if (values_->description().find(od::cia302::nmt_startup) == nullptr) return;
  if ((values_->get_or<std::uint32_t>({od::cia302::nmt_startup, 0}, 0) & 0x0DU) == 0x08U)
    nmt_.apply(co::NmtCommand::start);
}

// The device's program reads the memory only when it starts, and NMT reset communication does not restart it.
void Lifecycle::check_memory(Reset what) noexcept {
  if (!parts_.host.timing().needs_first_save || what == Reset::communication) return;
  unsaved_ = !parts_.stored.saved_once();
  nmt_.hold(unsaved_);
}

void Lifecycle::start_services() noexcept {
  parts_.lss.listen(false);
  parts_.schemes.listen();
  parts_.own_identifiers.listen();
  parts_.errors.start();
  parts_.error_control.start(nmt_.node_id(), nmt_.state());
  set_services({}, nmt_.services());
  constexpr Errors::Info memory_error{0x2F, 0x04};  // CO_EM_NON_VOLATILE_MEMORY, and the entry of 1010h
  if (unsaved_) parts_.errors.raise(0x5000, co::error_register::generic, memory_error);
}

void Lifecycle::stop_services() noexcept {
  parts_.error_control.stop();
  set_services(nmt_.services(), {});
  parts_.errors.reset();
}

void Lifecycle::set_services(const co::Services& was, const co::Services& now) noexcept {
  parts_.errors.enable(now.emcy);
  parts_.services.change(was, now, nmt_.node_id());
}

void Lifecycle::hush(bool on) noexcept {
  if (on) {
    parts_.error_control.hush();
    set_services(nmt_.services(), {});
  } else if (nmt_.state() != NmtState::initialising) {
    parts_.error_control.speak(nmt_.node_id(), nmt_.state());
    set_services({}, nmt_.services());
  }
}

}  // namespace berth::device

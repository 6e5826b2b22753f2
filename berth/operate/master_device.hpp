/// The master is a device like any other (CiA 302-2): a node-ID, an object dictionary, an SDO server and a heartbeat,
/// on the same port as the manager's services.
#pragma once

#include <memory>

#include "berth/design/machine.hpp"
#include "berth/device/device.hpp"

namespace berth::operate {

class MasterDevice {
 public:
  /// `bus`: its node-ID, 1017h, and whether it produces SYNC (1005h, 1006h, 1019h).
  MasterDevice(can::Dispatcher& dispatcher, const design::Bus& bus);
  void power_on() noexcept { device_->power_on(); }
  void power_off() noexcept { device_->power_off(); }
  void apply(co::NmtCommand command) noexcept { device_->apply(command); }
  [[nodiscard]] od::Values& values() noexcept { return device_->values(); }

 private:
  std::unique_ptr<device::Device> device_;
};

}  // namespace berth::operate

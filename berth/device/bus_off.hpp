/// A device's reaction to its controller's errors: 8120h while it is error passive, the error behaviour of 1029h:01 at
/// bus-off, and 8140h after it recovered from bus-off by itself.
#pragma once

#include "berth/can/dispatcher.hpp"
#include "berth/device/errors.hpp"

namespace berth::device {

class BusOffRecovery final : private can::StatusHandler, private rt::Job {
 public:
  /// Becomes the dispatcher's status handler if the port is the device's own (`Host::has_port`). `wait`: by the
  /// device's clock, from bus-off until the controller is restarted; 0 = never. All must outlive it.
  BusOffRecovery(can::Dispatcher& dispatcher, const Host& host, Errors& errors, rt::Duration wait) noexcept;
  ~BusOffRecovery();
  BusOffRecovery(const BusOffRecovery&) = delete;
  BusOffRecovery& operator=(const BusOffRecovery&) = delete;

  /// The controller's state is ignored until `power_on`.
  void power_on() noexcept { powered_ = true; }
  void power_off() noexcept;

 private:
  void changed(const can::Status& status, rt::Time at) noexcept override;
  void run() noexcept override;

  can::Dispatcher* dispatcher_;
  const Host* host_;
  Errors* errors_;
  rt::Duration wait_;
  bool powered_ = false;
  bool off_ = false;
};

}  // namespace berth::device

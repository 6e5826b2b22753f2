/// The host of a device's firmware: how slow it is, its clock, and when it receives nothing.
#pragma once

#include "berth/device/timed_port.hpp"
#include "berth/device/timing.hpp"

namespace berth::device {

class Host {
 public:
  /// `port`: beneath the device's dispatcher, if it is this device's own; null: it never becomes deaf. Must outlive the
  /// host.
  Host(TimedPort* port, const Timing& timing) noexcept : port_(port), timing_(timing) {}

  /// The device has the port to itself, and thus the controller's state.
  [[nodiscard]] bool has_port() const noexcept { return port_ != nullptr; }
  [[nodiscard]] const Timing& timing() const noexcept { return timing_; }
  /// Converts a duration of the device's clock to the world's.
  [[nodiscard]] rt::Duration in_world(rt::Duration own) const noexcept { return timing_.in_world(own); }

  /// Non-volatile memory is being written (on), or no longer: with `Timing::deaf_while_storing` deaf meanwhile.
  void storing(bool on) noexcept {
    if (port_ != nullptr && (!on || timing_.deaf_while_storing)) port_->deaf(TimedPort::Deaf::storing, on);
  }
  /// The firmware is starting (on), or has started: deaf meanwhile.
  void booting(bool on) noexcept {
    if (port_ != nullptr) port_->deaf(TimedPort::Deaf::booting, on);
  }
  /// Power is off: empties the receive buffer and ends both states above.
  void clear() noexcept {
    if (port_ == nullptr) return;
    port_->clear();
    storing(false);
    booting(false);
  }

 private:
  TimedPort* port_;
  Timing timing_;
};

}  // namespace berth::device

/// The firmware's host as its device's parts see it: how slow it is, what its clock shows, and when it hears nothing.
#pragma once

#include "berth/device/timed_port.hpp"
#include "berth/device/timing.hpp"

namespace berth::device {

class Host {
 public:
  /// `port`: what stands beneath the device's dispatcher, when it is this device's own; null: it never becomes deaf.
  /// Must outlive the host.
  Host(TimedPort* port, const Timing& timing) noexcept : port_(port), timing_(timing) {}

  /// The device has the port to itself, and so the controller's state too.
  [[nodiscard]] bool has_port() const noexcept { return port_ != nullptr; }
  [[nodiscard]] const Timing& timing() const noexcept { return timing_; }
  /// How long the world waits while the device's clock runs for `own`.
  [[nodiscard]] rt::Duration in_world(rt::Duration own) const noexcept { return timing_.in_world(own); }

  /// Non-volatile memory is being written, or not any more: deaf meanwhile with `Timing::deaf_while_storing`.
  void storing(bool on) noexcept {
    if (port_ != nullptr && (!on || timing_.deaf_while_storing)) port_->deaf(TimedPort::Deaf::storing, on);
  }
  /// The firmware starts, or has started: deaf meanwhile.
  void booting(bool on) noexcept {
    if (port_ != nullptr) port_->deaf(TimedPort::Deaf::booting, on);
  }
  /// Power is off: the receive buffer is empty, and nothing of the above holds.
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

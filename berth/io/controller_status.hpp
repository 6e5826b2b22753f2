/// A SocketCAN port's status, combined from the kernel's data about the interface and from error frames. Internal to
/// room `io`.
#pragma once

#include "berth/can/port.hpp"
#include "berth/io/netlink.hpp"
#include "berth/io/socketcan_codec.hpp"
#include "berth/io/socketcan_setup.hpp"

namespace berth::io {

class ControllerStatus {
 public:
  explicit ControllerStatus(std::uint32_t bit_rate) noexcept { status_.bit_rate = bit_rate; }
  [[nodiscard]] const can::Status& now() const noexcept { return status_; }
  /// Overflows of the controller.
  [[nodiscard]] std::uint32_t overflows() const noexcept { return overflows_; }
  /// A frame's time at the bit rate, or a substitute if the rate is unknown.
  [[nodiscard]] rt::Duration frame_time() const noexcept;

  /// True if the status must be polled: the kernel does not report a controller's counters, nor that an interface is
  /// back. A virtual interface that is up needs no polling, and a timer would make each wait for frames more expensive.
  [[nodiscard]] bool unseen(const Link& link) const noexcept { return link.controller() || !status_.up; }

  // Both return true if the status for the listener has changed.
  /// The state of the interface; `there`: a socket is bound to it.
  [[nodiscard]] bool learn(const Link& link, const Wanted& wanted, bool there) noexcept;
  [[nodiscard]] bool learn(const BusReport& report) noexcept;
  [[nodiscard]] bool went_down() noexcept { return std::exchange(status_.up, false); }

  /// For a virtual interface: its bus-off is another program's error frame, and its rate only a label.
  void label(std::uint32_t bit_rate) noexcept;
  /// The controller was restarted.
  void clear_counters() noexcept { status_.tec = status_.rec = 0; }

 private:
  can::Status status_;
  std::uint32_t overflows_ = 0;
};

}  // namespace berth::io

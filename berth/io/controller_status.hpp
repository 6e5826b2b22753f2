/// A SocketCAN port's status: what the kernel says about the interface, put together with what error frames tell.
/// Inside of room `io`.
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
  /// A frame's time at the bit rate, or what stands for it where none is known.
  [[nodiscard]] rt::Duration frame_time() const noexcept;

  /// Must be looked at now and then: a controller's counters are not told, and whether an interface is back. A virtual
  /// interface that is up has nothing to be looked at, and a timer would cost each wait for frames.
  [[nodiscard]] bool unseen(const Link& link) const noexcept { return link.controller() || !status_.up; }

  // True: what a listener is told has changed.
  /// How the interface is; `there`: a socket is bound to it.
  [[nodiscard]] bool learn(const Link& link, const Wanted& wanted, bool there) noexcept;
  [[nodiscard]] bool learn(const BusReport& report) noexcept;
  [[nodiscard]] bool went_down() noexcept { return std::exchange(status_.up, false); }

  /// A virtual interface's bus-off is another program's error frame, and its rate a word.
  void label(std::uint32_t bit_rate) noexcept;
  /// The controller was started anew.
  void clear_counters() noexcept { status_.tec = status_.rec = 0; }

 private:
  can::Status status_;
  std::uint32_t overflows_ = 0;
};

}  // namespace berth::io

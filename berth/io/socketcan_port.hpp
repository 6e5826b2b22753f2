/// A Linux SocketCAN interface (can0, vcan0, an slcan or USB adapter with a kernel driver) as a `can::Port`.
///
///     auto port = io::SocketCanPort::open(loop, "can0", {.bit_rate = 250'000});
///     if (!port) print(port.error());     // "can0: ...; ip link set can0 up type can bitrate 250000"
///
/// One raw socket per port. Several ports, in one process or in many, can share an interface and receive each other's
/// frames.
///
/// Times are the kernel's (SO_TIMESTAMPNS), converted to the loop's. `sent` is the frame's echo from the driver, at the
/// end of the frame, in order with received frames; an `at` is always before the executor's `now`.
///
/// `send` writes at once if nothing waits. Frames that the kernel refuses (ENOBUFS: its queue is full) wait here, in
/// order, and are tried again after the next echo or one frame's time later. `withdraw` removes a frame that waits
/// here; for a written one it only suppresses `sent`. Frames that the kernel drops when the interface goes down are not
/// repeated.
///
/// Interface down, unplugged or deleted: status `up` false, the queue is dropped, `send` returns `closed`; when an
/// interface of this name is up again, the port binds to it by itself. Bus-off lasts, as `can::Port` says, until
/// `restart`, or until the kernel restarts the controller (`restart-ms`).
///
/// Setting bit rate and listen-only mode and bringing it up need CAP_NET_ADMIN (root); without it the errors give the
/// `ip` command. A virtual interface has no bit rate: the requested one is a label (`Status::bit_rate_is_label`).
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "berth/can/port.hpp"
#include "berth/io/loop.hpp"
#include "berth/io/open_port.hpp"

namespace berth::io {

class SocketCanPort final : public can::Port {
 public:
  static constexpr unsigned queue_depth = 256;        ///< queued and not taken by the kernel; then `Queued::full`
  static constexpr unsigned most_unconfirmed = 1024;  ///< written and not echoed; if there are more, the oldest are
                                                      ///< never `sent`

  /// Opens an existing interface that is up. With `options.bit_rate` an interface that is down is brought up, and
  /// another bit rate is set, if the system allows that; without, it is used unchanged and must be up. With
  /// `options.listen_only` nothing is ever sent. If this port configures the controller (because of the bit rate, now
  /// or by `restart`), it also sets listen-only mode, so that the controller does not acknowledge, and restores the
  /// former settings when the port is destroyed. An interface that is up with the right settings is left unchanged:
  /// others may use it.
  [[nodiscard]] static tl::expected<std::unique_ptr<SocketCanPort>, std::string> open(Loop& loop,
                                                                                      const std::string& interface,
                                                                                      const PortOptions& options);
  ~SocketCanPort() override;
  SocketCanPort(const SocketCanPort&) = delete;
  SocketCanPort& operator=(const SocketCanPort&) = delete;

  // can::Port
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override;
  void withdraw(std::uint32_t tag) noexcept override;
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override;
  [[nodiscard]] can::Status status() const noexcept override;
  /// Blocks while the kernel sets up the controller. With the same rate and without bus-off only the queue is dropped.
  /// False: see `trouble`.
  bool restart(std::uint32_t bit_rate) noexcept override;

  /// Why the last `restart` failed or the interface is not up, and the command that helps; empty without a problem.
  [[nodiscard]] const std::string& trouble() const noexcept;

 private:
  class Impl;
  explicit SocketCanPort(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::io

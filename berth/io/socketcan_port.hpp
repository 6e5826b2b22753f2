/// A Linux SocketCAN interface (can0, vcan0, an slcan or USB adapter with a kernel driver) as a `can::Port`.
///
///     auto port = io::SocketCanPort::open(loop, "can0", {.bit_rate = 250'000});
///     if (!port) print(port.error());     // "can0: ...; ip link set can0 up type can bitrate 250000"
///
/// One raw socket per port; several ports, in one process or in many, share an interface and hear each other.
///
/// Times are the kernel's (SO_TIMESTAMPNS), mapped to the loop's. `sent` is the frame's echo from the driver, at the
/// end of the frame, in order with what was received; an `at` is always before the executor's `now`.
///
/// `send` writes at once when nothing waits. What the kernel does not take (ENOBUFS: its queue is full) waits here, in
/// order, and is tried again after the next echo or a frame's time later; `withdraw` takes back what waits here, and of
/// what was written only the `sent`. Frames that the kernel drops when the interface goes down are not repeated.
///
/// Interface down, unplugged or deleted: status `up` false, the queue is dropped, `send` says `closed`; when an
/// interface of this name is up again the port is bound to it by itself. Bus-off: as `can::Port` says, until `restart`,
/// or until the kernel restarts the controller (`restart-ms`).
///
/// Bit rate, listen-only mode and coming up need CAP_NET_ADMIN (root); without it the errors tell the `ip` command. A
/// virtual interface has no bit rate: what is asked for is taken as a label (`Status::bit_rate_is_label`).
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
  static constexpr unsigned queue_depth = 256;        ///< given and not taken by the kernel; then `Queued::full`
  static constexpr unsigned most_unconfirmed = 1024;  ///< written and not echoed; of more the oldest are never `sent`

  /// Opens an interface that is there and up. With `options.bit_rate` an interface that is down is brought up, and one
  /// with another bit rate set to it, when the system allows that; without, it is used as it stands and must be up.
  /// With `options.listen_only` nothing is ever sent; a controller that this port configures (because of the bit rate,
  /// now or by `restart`) is put into listen-only mode, so that it does not acknowledge either, and is put back as it
  /// was when the port is destroyed. One that is up as wanted is left as it is: others may use it.
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
  /// Blocks for as long as the kernel needs to set up the controller. Same rate and not bus-off: only the queue is
  /// dropped. False: `trouble` says why.
  bool restart(std::uint32_t bit_rate) noexcept override;

  /// Why the last `restart` failed or the interface is not up, and the command that helps; empty when all is well.
  [[nodiscard]] const std::string& trouble() const noexcept;

 private:
  class Impl;
  explicit SocketCanPort(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::io

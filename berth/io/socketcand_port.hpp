/// A bus behind a socketcand server: socketcand itself, `berth serve`, or an adapter that speaks it.
///
///     auto port = io::SocketcandPort::connect(loop, "10.0.0.7:29536/can0", {});
///
/// What the port is not told, it does not know: `Status` has no counters and no bus-off, its bit rate is a label (what
/// `options.bit_rate` says), and the times are those at which this process heard of a frame. Remote and FD frames
/// cannot be said: `send` answers `Queued::closed`, so a device that is watched by node guarding cannot be watched
/// through socketcand.
///
/// **What `sent` means**: the server says nothing of a frame that it was given. Behind each frame this port asks `<
/// echo >`, and `sent` is the answer to that: the server has taken the frame, and what it heard before came before.
/// `berth serve` answers when the frame was acknowledged on the wire (or after 100 ms); socketcand when its kernel has
/// taken the frame. Therefore `knows_sent` is false.
///
/// When the connection ends, or an echo is not answered for 5 s, the port is down (`up` false, the listener is told,
/// what was given is dropped) and connects anew after pauses of 0.25 s to 4 s. The address is looked up once, at the
/// beginning.
#pragma once

#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "berth/can/port.hpp"
#include "berth/io/loop.hpp"

namespace berth::io {

struct SocketcandOptions {
  std::uint32_t bit_rate = 0;  ///< bit/s that `Status` shall say; nothing sets it
  bool listen_only = false;    ///< never sends; the server's interface acknowledges as it is set up
  /// How long `connect` waits for the server. 0: not at all; the port is down, and comes up by itself.
  rt::Duration timeout = std::chrono::seconds(3);
};

/// What went wrong on the way, for people.
struct LineFaults {
  std::uint64_t count = 0;  ///< what came in and could not be understood, and connections that failed or ended
  std::uint64_t at = 0;     ///< of the last: bytes since the connection or line was opened
  std::string what{};       ///< of the last, in words
};

class SocketcandPort final : public can::Port {
 public:
  static constexpr unsigned queue_depth = 64;  ///< frames given and not yet confirmed; then `Queued::full`

  /// `address`: "host:port/bus"; without a port 29536. The bus's name may have blanks. Refused: no such server or bus,
  /// a server that speaks something else; in words.
  [[nodiscard]] static tl::expected<std::unique_ptr<SocketcandPort>, std::string> connect(
      Loop& loop, const std::string& address, const SocketcandOptions& options);
  ~SocketcandPort() override;
  SocketcandPort(const SocketcandPort&) = delete;
  SocketcandPort& operator=(const SocketcandPort&) = delete;

  // can::Port
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override;
  /// The server has the frame already: it is sent all the same, and `sent` does not come.
  void withdraw(std::uint32_t tag) noexcept override;
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override;
  /// `lost`: elements that could not be understood. `errors`: what the server called an error.
  [[nodiscard]] can::Status status() const noexcept override;
  /// Only to the rate it has; nothing happens.
  bool restart(std::uint32_t bit_rate) noexcept override;

  [[nodiscard]] const LineFaults& faults() const noexcept;
  /// Times that the connection was made.
  [[nodiscard]] unsigned connections() const noexcept;

 private:
  class Impl;
  explicit SocketcandPort(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::io

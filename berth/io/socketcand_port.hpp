/// A bus behind a socketcand server: socketcand itself, `berth serve`, or an adapter with this protocol.
///
///     auto port = io::SocketcandPort::connect(loop, "10.0.0.7:29536/can0", {});
///
/// The port knows only what the server reports: `Status` has no counters and no bus-off, its bit rate is a label
/// (`options.bit_rate`), and times are those at which this process received a frame. The protocol has no remote and FD
/// frames: `send` returns `Queued::closed`, so node guarding does not work through socketcand.
///
/// **The meaning of `sent`**: the server does not answer a frame. After each frame this port sends `< echo >`, and
/// `sent` is the answer to that: the server has taken the frame, and frames received before came before. `berth serve`
/// answers when the frame was acknowledged on the wire (or after 100 ms); socketcand when its kernel has taken the
/// frame. Therefore `knows_sent` is false.
///
/// When the connection ends, or an echo is not answered for 5 s, the port is down (`up` false, the listener is called,
/// queued frames are dropped) and connects again after pauses of 0.25 s to 4 s. The address is looked up once, at the
/// beginning.
#pragma once

#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "berth/can/port.hpp"
#include "berth/io/loop.hpp"

namespace berth::io {

struct SocketcandOptions {
  std::uint32_t bit_rate = 0;  ///< bit/s for `Status`; does not set the rate
  bool listen_only = false;    ///< never sends; whether the server's interface acknowledges depends on its setup
  /// How long `connect` waits for the server. 0: not at all; the port is down, and comes up by itself.
  rt::Duration timeout = std::chrono::seconds(3);
};

/// Protocol errors, for users.
struct LineFaults {
  std::uint64_t count = 0;  ///< unintelligible input, and connections that failed or ended
  std::uint64_t at = 0;     ///< of the last: bytes since the connection or line was opened
  std::string what{};       ///< of the last, in words
};

class SocketcandPort final : public can::Port {
 public:
  static constexpr unsigned queue_depth = 64;  ///< frames queued and not yet confirmed; then `Queued::full`

  /// `address`: "host:port/bus"; without a port 29536. The bus's name may have blanks. Refused, in words: no such
  /// server or bus, a server with another protocol.
  [[nodiscard]] static tl::expected<std::unique_ptr<SocketcandPort>, std::string> connect(
      Loop& loop, const std::string& address, const SocketcandOptions& options);
  ~SocketcandPort() override;
  SocketcandPort(const SocketcandPort&) = delete;
  SocketcandPort& operator=(const SocketcandPort&) = delete;

  // can::Port
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override;
  /// The server already has the frame: it is still sent, but `sent` does not come.
  void withdraw(std::uint32_t tag) noexcept override;
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override;
  /// `lost`: unintelligible elements. `errors`: errors reported by the server.
  [[nodiscard]] can::Status status() const noexcept override;
  /// Accepts only the current rate, and does nothing.
  bool restart(std::uint32_t bit_rate) noexcept override;

  [[nodiscard]] const LineFaults& faults() const noexcept;
  /// Number of connections made.
  [[nodiscard]] unsigned connections() const noexcept;

 private:
  class Impl;
  explicit SocketcandPort(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::io

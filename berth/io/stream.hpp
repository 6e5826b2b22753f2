/// Bytes to and from a peer that may be slow, gone or hostile: a connected TCP socket or a serial line, never blocking,
/// bounded. Also helpers: "host:port" texts, listening, connecting.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "berth/io/loop.hpp"

namespace berth::io {

/// Where a server listens. `host` is a name or an address; IPv6 addresses have no brackets here.
struct Endpoint {
  std::string host;
  std::uint16_t port = 0;
  friend bool operator==(const Endpoint&, const Endpoint&) = default;
};
/// "host:port", "[::1]:port", ":port" (the host is `default_host`), "host" (the port is `default_port`). Empty for
/// anything else: a host with blanks, a port above 65535.
[[nodiscard]] std::optional<Endpoint> parse_endpoint(std::string_view text, std::uint16_t default_port,
                                                     std::string_view default_host = "127.0.0.1");
[[nodiscard]] std::string to_string(const Endpoint& endpoint);

/// True if only programs of this computer can reach a server there: all addresses of the host are loopback
/// (127.0.0.0/8, also mapped into IPv6; `::1`). 0.0.0.0 and `::` are not. The error says in words why the host is
/// invalid.
[[nodiscard]] tl::expected<bool, std::string> is_loopback(const Endpoint& endpoint);

/// A listening, non-blocking socket; its owner closes it. Port 0: the system chooses a free one (`local_endpoint`).
/// Errors are in words.
[[nodiscard]] tl::expected<int, std::string> listen_tcp(const Endpoint& endpoint);
/// The socket's own address; empty when it has none.
[[nodiscard]] std::optional<Endpoint> local_endpoint(int fd);
/// The other end, for messages: "127.0.0.1:40022"; "a client" when it is gone.
[[nodiscard]] std::string peer_name(int fd);
/// Sends small messages at once (TCP_NODELAY), and detects a vanished peer within about 20 s (keep-alive,
/// TCP_USER_TIMEOUT).
void tune_tcp(int fd) noexcept;

/// A socket's address, looked up once, because looking up may block for seconds.
struct SocketAddress {
  int family = 0;
  std::vector<std::uint8_t> bytes;
};
[[nodiscard]] tl::expected<std::vector<SocketAddress>, std::string> look_up(const Endpoint& endpoint);
/// Begins to connect; when it is done, the socket can be written, and `connect_error` returns the result. Negative:
/// refused at once, see errno.
[[nodiscard]] int begin_connect(const SocketAddress& address) noexcept;
/// 0 if the connection succeeded, else the errno.
[[nodiscard]] int connect_error(int fd) noexcept;

class Stream {
 public:
  enum class Kind : std::uint8_t { socket, line };

  /// Owns `fd`, which must be non-blocking, and watches it with `watcher` for input. `most_waiting`: limit for bytes
  /// that the peer has not taken; beyond it the stream is given up.
  Stream(Loop& loop, int fd, Kind kind, Watcher& watcher, std::size_t most_waiting);
  ~Stream();
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  /// Queues bytes for `flush`. False: closed, or the peer takes too little: then the stream is `gone`.
  bool put(std::string_view bytes);
  /// Sends as much as possible. If bytes are left, call it again when the descriptor can be written. False: gone.
  bool flush() noexcept;
  /// Received bytes; empty: none now, or `gone`.
  [[nodiscard]] std::string_view get(std::span<char> buffer) noexcept;
  /// True: stops reading, so that the peer must wait. Its hang-up is still reported by EPOLLRDHUP, once.
  void hold(bool on) noexcept;
  [[nodiscard]] bool held() const noexcept { return held_; }

  /// Nothing is sent or received any more.
  [[nodiscard]] bool gone() const noexcept { return fd_ < 0 || gone_; }
  /// True if the peer did not take its output.
  [[nodiscard]] bool too_slow() const noexcept { return too_slow_; }
  /// Total of bytes sent.
  [[nodiscard]] std::uint64_t taken() const noexcept { return taken_; }
  /// Bytes waiting to be sent.
  [[nodiscard]] std::size_t waiting() const noexcept { return out_.size() - sent_; }
  [[nodiscard]] int descriptor() const noexcept { return fd_; }
  void close() noexcept;
  /// Call with EPOLLRDHUP, which is not reported again.
  void hung_up() noexcept;

 private:
  void watch() noexcept;
  Loop* loop_;
  int fd_;
  Kind kind_;
  Watcher* watcher_;
  std::size_t most_waiting_;
  std::string out_;
  std::size_t sent_ = 0;  // of out_
  std::uint64_t taken_ = 0;
  std::uint32_t events_ = 0;
  bool held_ = false;
  bool hung_up_ = false;
  bool gone_ = false;
  bool too_slow_ = false;
};

}  // namespace berth::io

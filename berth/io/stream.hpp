/// Bytes to and from a peer that may be slow, gone or hostile: a connected TCP socket or a serial line, never blocking,
/// bounded. And what is needed to get one: "host:port" texts, listening, connecting.
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

/// Where a server listens. `host` is a name or an address; IPv6 addresses stand without brackets here.
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

/// Whether only programs of this computer reach a server there: every address that the host stands for is loopback
/// (127.0.0.0/8, ::1, ::ffff:127.0.0.0/104). 0.0.0.0 and :: are not. The error says in words why the host is none.
[[nodiscard]] tl::expected<bool, std::string> is_loopback(const Endpoint& endpoint);

/// A listening, non-blocking socket; its owner closes it. Port 0: the system takes a free one (`local_endpoint`). What
/// is wrong is told in words.
[[nodiscard]] tl::expected<int, std::string> listen_tcp(const Endpoint& endpoint);
/// The socket's own address; empty when it has none.
[[nodiscard]] std::optional<Endpoint> local_endpoint(int fd);
/// The other end, for messages: "127.0.0.1:40022"; "a client" when it is gone.
[[nodiscard]] std::string peer_name(int fd);
/// Small messages at once (TCP_NODELAY), and a peer that vanished without a word is noticed within about 20 s
/// (keep-alive, TCP_USER_TIMEOUT).
void tune_tcp(int fd) noexcept;

/// A socket's address, looked up once, because looking up may block for seconds.
struct SocketAddress {
  int family = 0;
  std::vector<std::uint8_t> bytes;
};
[[nodiscard]] tl::expected<std::vector<SocketAddress>, std::string> look_up(const Endpoint& endpoint);
/// Begins to connect; the socket can be written when it is done, and `connect_error` says how it went. Negative: at
/// once refused, errno says why.
[[nodiscard]] int begin_connect(const SocketAddress& address) noexcept;
/// 0 when the connection stands, else the errno.
[[nodiscard]] int connect_error(int fd) noexcept;

class Stream {
 public:
  enum class Kind : std::uint8_t { socket, line };

  /// Owns `fd`, which must be non-blocking, and watches it with `watcher` for bytes that come in. `most_waiting`: bytes
  /// that the peer did not take yet; beyond it is given up.
  Stream(Loop& loop, int fd, Kind kind, Watcher& watcher, std::size_t most_waiting);
  ~Stream();
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  /// Keeps bytes for `flush`. False: closed, or the peer takes too little: then the stream is `gone`.
  bool put(std::string_view bytes);
  /// Sends what can be sent now; what is left is sent when the descriptor can be written: call it then. False: gone.
  bool flush() noexcept;
  /// Bytes that came in; empty: none now, or `gone`.
  [[nodiscard]] std::string_view get(std::span<char> buffer) noexcept;
  /// True: no bytes are taken in, so that the peer has to wait. That it has hung up comes as EPOLLRDHUP, once.
  void hold(bool on) noexcept;
  [[nodiscard]] bool held() const noexcept { return held_; }

  /// Nothing comes or goes any more.
  [[nodiscard]] bool gone() const noexcept { return fd_ < 0 || gone_; }
  /// The peer did not take what it was sent.
  [[nodiscard]] bool too_slow() const noexcept { return too_slow_; }
  /// Bytes that were sent, ever.
  [[nodiscard]] std::uint64_t taken() const noexcept { return taken_; }
  /// Bytes that wait to be sent.
  [[nodiscard]] std::size_t waiting() const noexcept { return out_.size() - sent_; }
  [[nodiscard]] int descriptor() const noexcept { return fd_; }
  void close() noexcept;
  /// To be called with EPOLLRDHUP: it is not told again.
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

#include "berth/io/stream.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <memory>

namespace berth::io {
namespace {

struct Found {
  void operator()(addrinfo* list) const noexcept { ::freeaddrinfo(list); }
};
using Addresses = std::unique_ptr<addrinfo, Found>;

tl::expected<Addresses, std::string> resolve(const Endpoint& endpoint, int flags) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = flags | AI_NUMERICSERV;
  addrinfo* list = nullptr;
  const auto port = std::to_string(endpoint.port);
  const int error = ::getaddrinfo(endpoint.host.c_str(), port.c_str(), &hints, &list);
  if (error != 0 || list == nullptr)
    return tl::unexpected(fmt::format("{}: no such host ({})", endpoint.host, ::gai_strerror(error)));
  return Addresses(list);
}

std::optional<Endpoint> endpoint_of(const sockaddr_storage& address, socklen_t size) {
  std::array<char, NI_MAXHOST> host{};
  std::array<char, NI_MAXSERV> port{};
  const void* const plain = &address;
  if (::getnameinfo(static_cast<const sockaddr*>(plain), size, host.data(), host.size(), port.data(), port.size(),
                    NI_NUMERICHOST | NI_NUMERICSERV) != 0) {
    return std::nullopt;
  }
  Endpoint endpoint{host.data(), 0};
  std::from_chars(port.data(), port.data() + std::strlen(port.data()), endpoint.port);
  return endpoint;
}

template <class Ask>
std::optional<Endpoint> ask_for(int fd, Ask ask) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  void* const plain = &address;
  if (ask(fd, static_cast<sockaddr*>(plain), &size) != 0) return std::nullopt;
  return endpoint_of(address, size);
}

void set(int fd, int level, int option, int value) noexcept { ::setsockopt(fd, level, option, &value, sizeof value); }

}  // namespace

std::optional<Endpoint> parse_endpoint(std::string_view text, std::uint16_t default_port,
                                       std::string_view default_host) {
  Endpoint endpoint{std::string(default_host), default_port};
  std::string_view host = text;
  std::optional<std::string_view> port;
  if (text.starts_with('[')) {
    const auto end = text.find(']');
    if (end == std::string_view::npos) return std::nullopt;
    host = text.substr(1, end - 1);
    const auto rest = text.substr(end + 1);
    if (host.empty() || (!rest.empty() && rest[0] != ':')) return std::nullopt;
    if (!rest.empty()) port = rest.substr(1);
  } else if (const auto colon = text.find(':'); colon != std::string_view::npos) {
    host = text.substr(0, colon);
    port = text.substr(colon + 1);
  }
  if (host.find_first_of(" \t\r\n/") != std::string_view::npos) return std::nullopt;
  if (!host.empty()) endpoint.host = host;
  if (endpoint.host.empty() || text.empty()) return std::nullopt;
  if (!port) return endpoint;
  const auto [end, error] = std::from_chars(port->data(), port->data() + port->size(), endpoint.port);
  if (error != std::errc{} || end != port->data() + port->size()) return std::nullopt;
  return endpoint;
}

std::string to_string(const Endpoint& endpoint) {
  const bool brackets = endpoint.host.find(':') != std::string::npos;
  return fmt::format("{}{}{}:{}", brackets ? "[" : "", endpoint.host, brackets ? "]" : "", endpoint.port);
}

namespace {

bool is_loopback(const addrinfo& address) noexcept {
  const void* const plain = address.ai_addr;
  if (address.ai_family == AF_INET) {
    const auto& v4 = static_cast<const sockaddr_in*>(plain)->sin_addr;
    return ntohl(v4.s_addr) >> 24U == 127;
  }
  if (address.ai_family != AF_INET6) return false;
  const in6_addr& v6 = static_cast<const sockaddr_in6*>(plain)->sin6_addr;
  return IN6_IS_ADDR_LOOPBACK(&v6) || (IN6_IS_ADDR_V4MAPPED(&v6) && v6.s6_addr[12] == 127);
}

}  // namespace

tl::expected<bool, std::string> is_loopback(const Endpoint& endpoint) {
  const auto addresses = resolve(endpoint, AI_PASSIVE);
  if (!addresses) return tl::unexpected(addresses.error());
  for (const addrinfo* a = addresses->get(); a != nullptr; a = a->ai_next) {
    if (!is_loopback(*a)) return false;
  }
  return true;
}

tl::expected<int, std::string> listen_tcp(const Endpoint& endpoint) {
  const auto addresses = resolve(endpoint, AI_PASSIVE);
  if (!addresses) return tl::unexpected(addresses.error());
  int why = 0;
  for (const addrinfo* a = addresses->get(); a != nullptr; a = a->ai_next) {
    const int fd = ::socket(a->ai_family, a->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, a->ai_protocol);
    if (fd >= 0) {
      set(fd, SOL_SOCKET, SO_REUSEADDR, 1);
      if (::bind(fd, a->ai_addr, a->ai_addrlen) == 0 && ::listen(fd, 64) == 0) return fd;
    }
    why = errno;
    if (fd >= 0) ::close(fd);
  }
  const char* const advice = why == EADDRINUSE ? "; another program listens there: stop it or take another port" : "";
  return tl::unexpected(fmt::format("{}: {}{}", to_string(endpoint), std::strerror(why), advice));
}

std::optional<Endpoint> local_endpoint(int fd) { return ask_for(fd, ::getsockname); }

std::string peer_name(int fd) {
  const auto peer = ask_for(fd, ::getpeername);
  return peer ? to_string(*peer) : "a client";
}

void tune_tcp(int fd) noexcept {
  set(fd, IPPROTO_TCP, TCP_NODELAY, 1);
  set(fd, SOL_SOCKET, SO_KEEPALIVE, 1);
  set(fd, IPPROTO_TCP, TCP_KEEPIDLE, 10);
  set(fd, IPPROTO_TCP, TCP_KEEPINTVL, 3);
  set(fd, IPPROTO_TCP, TCP_KEEPCNT, 3);
  set(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, 20'000);
}

tl::expected<std::vector<SocketAddress>, std::string> look_up(const Endpoint& endpoint) {
  const auto addresses = resolve(endpoint, AI_ADDRCONFIG);
  if (!addresses) return tl::unexpected(addresses.error());
  std::vector<SocketAddress> found;
  for (const addrinfo* a = addresses->get(); a != nullptr; a = a->ai_next) {
    const void* const plain = a->ai_addr;
    const auto* const bytes = static_cast<const std::uint8_t*>(plain);
    found.push_back({a->ai_family, {bytes, bytes + a->ai_addrlen}});
  }
  return found;
}

int begin_connect(const SocketAddress& address) noexcept {
  const int fd = ::socket(address.family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0) return -1;
  tune_tcp(fd);
  const void* const plain = address.bytes.data();
  const auto* const where = static_cast<const sockaddr*>(plain);
  if (::connect(fd, where, static_cast<socklen_t>(address.bytes.size())) == 0 || errno == EINPROGRESS) return fd;
  const int why = errno;
  ::close(fd);
  errno = why;
  return -1;
}

int connect_error(int fd) noexcept {
  int error = 0;
  socklen_t size = sizeof error;
  if (::getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size) != 0) return errno;
  if (error != 0) return error;
  // A process that connects again and again to a port of its own machine where nobody listens may connect to itself.
  sockaddr_storage here{};
  sockaddr_storage there{};
  socklen_t here_size = sizeof here;
  socklen_t there_size = sizeof there;
  void* const a = &here;
  void* const b = &there;
  if (::getsockname(fd, static_cast<sockaddr*>(a), &here_size) != 0) return errno;
  if (::getpeername(fd, static_cast<sockaddr*>(b), &there_size) != 0) return errno;
  return here_size == there_size && std::memcmp(a, b, here_size) == 0 ? ECONNREFUSED : 0;
}

Stream::Stream(Loop& loop, int fd, Kind kind, Watcher& watcher, std::size_t most_waiting)
    : loop_(&loop), fd_(fd), kind_(kind), watcher_(&watcher), most_waiting_(most_waiting) {
  watch();
}

Stream::~Stream() { close(); }

void Stream::close() noexcept {
  if (fd_ < 0) return;
  loop_->forget(fd_);
  // Exclusive use outlives the descriptor while anybody else has the line open: without this, the next program would be
  // refused.
  if (kind_ == Kind::line) ::ioctl(fd_, TIOCNXCL);
  ::close(fd_);
  fd_ = -1;
}

void Stream::watch() noexcept {
  const std::uint32_t in = !held_ ? std::uint32_t{EPOLLIN} : hung_up_ ? 0U : std::uint32_t{EPOLLRDHUP};
  const std::uint32_t events = in | (waiting() > 0 ? std::uint32_t{EPOLLOUT} : 0U);
  if (gone() || events_ == (events | 1U << 31U)) return;
  events_ = events | 1U << 31U;
  if (!loop_->watch(fd_, *watcher_, events)) gone_ = true;
}

void Stream::hold(bool on) noexcept {
  held_ = on;
  watch();
}

void Stream::hung_up() noexcept {
  hung_up_ = true;
  watch();
}

bool Stream::put(std::string_view bytes) {
  if (gone()) return false;
  if (waiting() + bytes.size() > most_waiting_) {
    too_slow_ = gone_ = true;
    return false;
  }
  out_.append(bytes);
  return true;
}

bool Stream::flush() noexcept {
  while (!gone() && waiting() > 0) {
    const auto* const from = out_.data() + sent_;
    const auto n = kind_ == Kind::socket ? ::send(fd_, from, waiting(), MSG_NOSIGNAL | MSG_DONTWAIT)
                                         : ::write(fd_, from, waiting());
    if (n >= 0) {
      sent_ += static_cast<std::size_t>(n);
      taken_ += static_cast<std::uint64_t>(n);
    } else if (errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS) {
      break;
    } else if (errno != EINTR) {
      gone_ = true;
    }
  }
  if (waiting() == 0 || sent_ > (1U << 16U)) {
    out_.erase(0, sent_);
    sent_ = 0;
  }
  watch();
  return !gone();
}

std::string_view Stream::get(std::span<char> buffer) noexcept {
  while (!gone()) {
    const auto n = kind_ == Kind::socket ? ::recv(fd_, buffer.data(), buffer.size(), MSG_DONTWAIT)
                                         : ::read(fd_, buffer.data(), buffer.size());
    if (n > 0) return {buffer.data(), static_cast<std::size_t>(n)};
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return {};
    gone_ = true;
  }
  return {};
}

}  // namespace berth::io

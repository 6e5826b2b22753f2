#include "berth/mqtt/line.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <utility>

namespace berth::mqtt {
namespace {

struct SocketAddress {
  sockaddr_storage bytes{};
  socklen_t size = 0;
};

std::optional<SocketAddress> socket_address(const std::string& text, std::uint16_t port) noexcept {
  SocketAddress address;
  void* const plain = &address.bytes;
  auto* const four = static_cast<sockaddr_in*>(plain);
  if (::inet_pton(AF_INET, text.c_str(), &four->sin_addr) == 1) {
    four->sin_family = AF_INET;
    four->sin_port = htons(port);
    address.size = sizeof(sockaddr_in);
    return address;
  }
  auto* const six = static_cast<sockaddr_in6*>(plain);
  if (::inet_pton(AF_INET6, text.c_str(), &six->sin6_addr) != 1) return std::nullopt;
  six->sin6_family = AF_INET6;
  six->sin6_port = htons(port);
  address.size = sizeof(sockaddr_in6);
  return address;
}

int socket_error(int fd) noexcept {
  int error = 0;
  socklen_t size = sizeof error;
  return ::getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size) == 0 ? error : errno;
}

std::string last_line() {
  std::array<char, 256> text{};
  const auto error = ERR_peek_last_error();
  ERR_clear_error();
  if (error == 0) return {};
  const char* const reason = ERR_reason_error_string(error);
  if (reason != nullptr) return reason;
  ERR_error_string_n(error, text.data(), text.size());
  return text.data();
}

bool waits(int error) noexcept { return error == EAGAIN || error == EWOULDBLOCK || error == EINTR; }

}  // namespace

tl::expected<std::unique_ptr<Line>, Cause> Line::open(const std::string& address, std::uint16_t port,
                                                      std::shared_ptr<Tls> tls) {
  const auto where = socket_address(address, port);
  if (!where) return tl::unexpected(of_system_error(EADDRNOTAVAIL));
  const int fd = ::socket(where->bytes.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0) return tl::unexpected(of_system_error(errno));
  std::unique_ptr<Line> line(new Line(fd, std::move(tls)));
  const int on = 1;
  ::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  const void* const plain = &where->bytes;
  if (::connect(fd, static_cast<const sockaddr*>(plain), where->size) != 0 && errno != EINPROGRESS)
    return tl::unexpected(of_system_error(errno));
  return line;
}

Line::~Line() {
  if (ssl_ != nullptr) SSL_free(ssl_);
  ::close(fd_);
}

std::uint32_t Line::events() const noexcept {
  constexpr std::uint32_t in = EPOLLIN | EPOLLRDHUP;
  if (!reached_) return EPOLLOUT;
  const bool writes = open_ ? is_writing() : ssl_ != nullptr && SSL_want_write(ssl_) != 0;
  return writes ? in | EPOLLOUT : in;
}

std::optional<Cause> Line::go_on() noexcept {
  if (!reached_) {
    if (const int error = socket_error(fd_); error != 0) return of_system_error(error);
    reached_ = true;
    open_ = tls_ == nullptr;
    if (tls_) ssl_ = tls_->begin(fd_, news_);
    if (tls_ && ssl_ == nullptr) return of_system_error(ENOMEM);
  }
  if (!open_) {
    if (auto cause = shake_hands()) return cause;
  }
  return open_ ? flush() : std::nullopt;
}

std::optional<Cause> Line::shake_hands() noexcept {
  ERR_clear_error();
  errno = 0;
  const int result = SSL_connect(ssl_);
  if (result == 1) {
    open_ = true;
    return std::nullopt;
  }
  const int error = SSL_get_error(ssl_, result);
  if (error == SSL_ERROR_WANT_READ || error == SSL_ERROR_WANT_WRITE) return std::nullopt;
  return failed(error, errno);
}

// What OpenSSL says of a failure, from the most to the least telling.
Cause Line::failed(int result, int error) noexcept {
  if (news_.verification != 0) return of_verification(tls_->host(), news_.verification);
  if (news_.alert != 0) return of_alert(news_.alert);
  const auto line = last_line();
  if (!open_) return of_tls(result == SSL_ERROR_SYSCALL ? std::string() : line);
  if (result == SSL_ERROR_ZERO_RETURN || line.find("unexpected eof") != std::string::npos) return of_system_error(0);
  return result == SSL_ERROR_SYSCALL ? of_system_error(error) : of_tls(line);
}

tl::expected<std::size_t, Cause> Line::read(std::span<char> buffer) noexcept {
  errno = 0;
  if (ssl_ == nullptr) {
    const auto got = ::recv(fd_, buffer.data(), buffer.size(), 0);
    if (got > 0) return static_cast<std::size_t>(got);
    if (got < 0 && waits(errno)) return std::size_t{0};
    return tl::unexpected(of_system_error(got == 0 ? 0 : errno));
  }
  ERR_clear_error();
  const int got = SSL_read(ssl_, buffer.data(), static_cast<int>(buffer.size()));
  if (got > 0) return static_cast<std::size_t>(got);
  const int error = SSL_get_error(ssl_, got);
  if (error == SSL_ERROR_WANT_READ || error == SSL_ERROR_WANT_WRITE) return std::size_t{0};
  return tl::unexpected(failed(error, errno));
}

std::optional<Cause> Line::write(std::string_view bytes) noexcept {
  out_ += bytes;
  return flush();
}

std::optional<Cause> Line::flush() noexcept {
  std::size_t sent = 0;
  std::optional<Cause> cause;
  while (sent < out_.size() && !cause) {
    errno = 0;
    if (ssl_ == nullptr) {
      const auto got = ::send(fd_, out_.data() + sent, out_.size() - sent, MSG_NOSIGNAL);
      if (got < 0 && waits(errno)) break;
      if (got < 0) cause = of_system_error(errno);
      if (got > 0) sent += static_cast<std::size_t>(got);
      continue;
    }
    ERR_clear_error();
    const int got = SSL_write(ssl_, out_.data() + sent, static_cast<int>(out_.size() - sent));
    const int error = SSL_get_error(ssl_, got);
    if (got <= 0 && (error == SSL_ERROR_WANT_READ || error == SSL_ERROR_WANT_WRITE)) break;
    if (got <= 0) cause = failed(error, errno);
    if (got > 0) sent += static_cast<std::size_t>(got);
  }
  out_.erase(0, sent);
  return cause;
}

void Line::finish() noexcept {
  if (ssl_ != nullptr && open_) SSL_shutdown(ssl_);
  ::shutdown(fd_, SHUT_WR);
}

}  // namespace berth::mqtt

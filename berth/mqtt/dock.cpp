#include "berth/mqtt/dock.hpp"

#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>

namespace berth::mqtt {

Dock::Dock() noexcept : listener_(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  void* const plain = &address;
  socklen_t size = sizeof address;
  const bool listens = listener_ >= 0 && ::bind(listener_, static_cast<sockaddr*>(plain), size) == 0 &&
                       ::listen(listener_, SOMAXCONN) == 0 &&
                       ::getsockname(listener_, static_cast<sockaddr*>(plain), &size) == 0;
  if (listens) port_ = ntohs(address.sin_port);
}

Dock::~Dock() {
  if (listener_ >= 0) ::close(listener_);
}

int Dock::replace(int fd) const noexcept {
  std::array<int, 2> pair{-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, pair.data()) != 0) return -1;
  const bool replaced = ::dup3(pair[0], fd, O_CLOEXEC) == fd;
  const int error = errno;
  ::close(pair[0]);
  for (int came = 0; came >= 0;) {
    came = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    // Reset: an end in order would keep the port of each attempt for a minute.
    const linger at_once{.l_onoff = 1, .l_linger = 0};
    if (came >= 0) ::setsockopt(came, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    if (came >= 0) ::close(came);
  }
  if (replaced) return pair[1];
  ::close(pair[1]);
  errno = error;
  return -1;
}

}  // namespace berth::mqtt

#include "berth/io/acceptor.hpp"

#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>

namespace berth::io {

Acceptor::Acceptor(Loop& loop, int fd, std::function<void(int)> take) : loop_(&loop), fd_(fd), take_(std::move(take)) {
  loop_->watch(fd_, *this, EPOLLIN);
}

Acceptor::~Acceptor() {
  loop_->forget(fd_);
  ::close(fd_);
}

void Acceptor::ready(std::uint32_t) noexcept {
  for (;;) {
    const int fd = ::accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd >= 0) {
      take_(fd);
    } else if (errno == EMFILE || errno == ENFILE || errno == ENOMEM || errno == ENOBUFS) {
      loop_->forget(fd_);
      loop_->executor().after(std::chrono::seconds(1), *this);
      return;
    } else if (errno != EINTR && errno != ECONNABORTED) {
      return;
    }
  }
}

void Acceptor::run() noexcept { loop_->watch(fd_, *this, EPOLLIN); }

}  // namespace berth::io

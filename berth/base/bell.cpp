#include "berth/base/bell.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

namespace berth {

Bell::Bell() noexcept : fd_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {}

Bell::~Bell() {
  if (fd_ >= 0) ::close(fd_);
}

// The counter cannot overflow: it holds 2^64 rings.
void Bell::ring() const noexcept { static_cast<void>(::eventfd_write(fd_, 1)); }

void Bell::silence() const noexcept {
  eventfd_t count = 0;
  static_cast<void>(::eventfd_read(fd_, &count));
}

}  // namespace berth

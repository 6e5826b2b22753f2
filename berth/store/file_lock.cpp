#include "berth/store/file_lock.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

namespace berth::store {

FileLock::~FileLock() {
  if (fd_ >= 0) ::close(fd_);
}

FileLock::Outcome FileLock::take(const std::string& file) {
  const std::string path = file + ".lock";
  fd_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
  if (fd_ < 0) return Outcome::failed;
  if (::flock(fd_, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) return Outcome::failed;
    std::array<char, 16> text{};
    const auto size = ::pread(fd_, text.data(), text.size(), 0);
    const auto end = text.begin() + std::max<std::ptrdiff_t>(size, 0);
    holder_.assign(text.begin(), std::find_if(text.begin(), end, [](char c) { return c < '0' || c > '9'; }));
    return Outcome::held_by_other;
  }
  const std::string pid = std::to_string(::getpid()) + "\n";
  if (::ftruncate(fd_, 0) != 0) return Outcome::failed;
  if (::pwrite(fd_, pid.data(), pid.size(), 0) != static_cast<ssize_t>(pid.size())) return Outcome::failed;
  return Outcome::taken;
}

}  // namespace berth::store

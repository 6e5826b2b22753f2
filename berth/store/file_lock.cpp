#include "berth/store/file_lock.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <sstream>

#include "berth/base/private_file.hpp"

namespace berth::store {

namespace {

/// The name still refers to the open file.
bool is_at(int fd, const std::string& path) noexcept {
  struct stat open {};
  struct stat named {};
  return ::fstat(fd, &open) == 0 && ::lstat(path.c_str(), &named) == 0 && open.st_dev == named.st_dev &&
         open.st_ino == named.st_ino;
}

// Reads the kernel's list of locks, because the process id in the file may still be an earlier holder's. "" if the list
// does not show the holder (it runs on another host, or in another container).
std::string holder_of(int fd) {
  struct stat what {};
  if (::fstat(fd, &what) != 0) return {};
  const std::string inode = ":" + std::to_string(what.st_ino);
  std::ifstream locks("/proc/locks");
  std::string line;
  while (std::getline(locks, line)) {
    std::istringstream words(line);
    std::string number, kind, strength, access, pid, file;
    words >> number >> kind >> strength >> access >> pid >> file;
    if (kind == "FLOCK" && pid != "0" && file.ends_with(inode)) return pid;
  }
  return {};
}

}  // namespace

// Without care, two processes could own two files of one name: one process opened the file before it was removed, the
// other made it again. So only the holder of its lock removes the file, and a lock counts only if the file still has
// its name after locking (`lock`).
FileLock::~FileLock() {
  if (fd_ < 0) return;
  if (!path_.empty() && is_at(fd_, path_)) ::unlink(path_.c_str());
  ::close(fd_);
}

FileLock::Outcome FileLock::lock(const std::string& path) {
  // Every repetition: a process that held the lock has ended meanwhile, and removed the file.
  for (;;) {
    fd_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, private_mode(path));
    if (fd_ < 0) return Outcome::failed;
    // A file made by an earlier version may be open to all users.
    static_cast<void>(::fchmod(fd_, private_mode(path)));
    if (::flock(fd_, LOCK_EX | LOCK_NB) != 0) {
      if (errno != EWOULDBLOCK) return Outcome::failed;
      holder_ = holder_of(fd_);
      return Outcome::held_by_other;
    }
    if (is_at(fd_, path)) return Outcome::taken;
    ::close(fd_);
  }
}

FileLock::Outcome FileLock::take(const std::string& file) {
  const std::string path = file + ".lock";
  if (const auto outcome = lock(path); outcome != Outcome::taken) return outcome;
  path_ = path;
  const std::string pid = std::to_string(::getpid()) + "\n";
  if (::ftruncate(fd_, 0) != 0) return Outcome::failed;
  if (::pwrite(fd_, pid.data(), pid.size(), 0) != static_cast<ssize_t>(pid.size())) return Outcome::failed;
  return Outcome::taken;
}

}  // namespace berth::store

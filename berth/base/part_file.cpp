#include "berth/base/part_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

namespace berth {
namespace {

int write_all(int fd, std::string_view bytes) noexcept {
  while (!bytes.empty()) {
    const auto n = ::write(fd, bytes.data(), bytes.size());
    if (n > 0) bytes.remove_prefix(static_cast<std::size_t>(n));
    if (n < 0 && errno != EINTR) return errno;
  }
  return ::fsync(fd) == 0 ? 0 : errno;
}

}  // namespace

PartFile::PartFile(std::string path) : path_(std::move(path)), part_(fmt::format("{}.{}.part", path_, ::getpid())) {}

PartFile::~PartFile() {
  if (made_) ::unlink(part_.c_str());
}

int PartFile::write(std::string_view bytes, mode_t mode) {
  ::unlink(part_.c_str());  // left by a crashed process with the same process ID
  const int fd = ::open(part_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode);
  if (fd < 0) return errno;
  made_ = true;
  struct stat old {};
  if (keeps_permissions_ && ::stat(path_.c_str(), &old) == 0) static_cast<void>(::fchmod(fd, old.st_mode & 0777U));
  const int error = write_all(fd, bytes);
  ::close(fd);
  return error;
}

int PartFile::replace() {
  if (std::rename(part_.c_str(), path_.c_str()) != 0) return errno;
  placed();
  return 0;
}

int PartFile::place_new() {
  if (::renameat2(AT_FDCWD, part_.c_str(), AT_FDCWD, path_.c_str(), RENAME_NOREPLACE) == 0) {
    placed();
    return 0;
  }
  // The file system may lack RENAME_NOREPLACE but have links. Neither replaces a file that appeared meanwhile.
  if (errno != EINVAL && errno != ENOSYS) return errno;
  return ::link(part_.c_str(), path_.c_str()) == 0 ? 0 : errno;
}

void PartFile::placed() noexcept {
  made_ = false;
  sync_folder_of(path_);
}

void sync_folder_of(const std::string& path) noexcept {
  const auto slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  static_cast<void>(::fsync(fd));
  ::close(fd);
}

}  // namespace berth

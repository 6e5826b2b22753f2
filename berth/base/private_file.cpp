#include "berth/base/private_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

namespace berth {

mode_t private_mode(const std::string& path) noexcept {
  const auto slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : slash == 0 ? "/" : path.substr(0, slash);
  struct stat what {};
  const bool shared = ::stat(folder.c_str(), &what) == 0 && (what.st_mode & S_ISGID) != 0;
  return shared ? 0640 : 0600;
}

bool make_private(const std::string& path) noexcept {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, private_mode(path));
  if (fd < 0) return errno == EEXIST;
  ::close(fd);
  return true;
}

}  // namespace berth

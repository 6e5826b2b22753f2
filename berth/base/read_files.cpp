#include "berth/base/read_files.hpp"

#include <sys/stat.h>

#include <mutex>
#include <optional>
#include <set>
#include <utility>

namespace berth {
namespace {

using FileNumber = std::pair<dev_t, ino_t>;

std::optional<FileNumber> identity(const std::string& path) noexcept {
  struct stat about {};
  if (::stat(path.c_str(), &about) != 0 || !S_ISREG(about.st_mode)) return std::nullopt;
  return FileNumber{about.st_dev, about.st_ino};
}

struct Noted {
  std::mutex mutex;
  std::set<FileNumber> files;
};

Noted& noted() noexcept {
  static Noted all;
  return all;
}

}  // namespace

void note_read(const std::string& path) noexcept {
  const auto file = identity(path);
  if (!file) return;
  const std::lock_guard lock(noted().mutex);
  noted().files.insert(*file);
}

bool was_read(const std::string& path) noexcept {
  const auto file = identity(path);
  if (!file) return false;
  const std::lock_guard lock(noted().mutex);
  return noted().files.contains(*file);
}

}  // namespace berth

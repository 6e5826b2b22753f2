/// Makes one process own a file: an advisory lock (flock) on `<file>.lock`, which also names the process. The lock ends
/// with the process in any case. The lock file is removed at an orderly end; after a crash it remains and does no harm.
#pragma once

#include <string>

namespace berth::store {

class FileLock {
 public:
  FileLock() = default;
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

  enum class Outcome { taken, held_by_other, failed };
  /// Tries once, without waiting. `failed`: see errno.
  [[nodiscard]] Outcome take(const std::string& file);
  /// After `held_by_other`: the holder's process id; "" if this computer does not show it.
  [[nodiscard]] const std::string& holder() const noexcept { return holder_; }

 private:
  [[nodiscard]] Outcome lock(const std::string& path);

  int fd_ = -1;
  std::string path_;  // of the lock file; empty: another process has it
  std::string holder_;
};

}  // namespace berth::store

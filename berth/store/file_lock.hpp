/// One process owns a file: an advisory lock (flock) on `<file>.lock`, which also says which process holds it. The lock
/// goes with the process however it ends. The lock file is removed at an orderly end; after a crash it stays and does
/// no harm.
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
  /// Tries once, without waiting. `failed`: errno says why.
  [[nodiscard]] Outcome take(const std::string& file);
  /// After `held_by_other`: the process id of the holder; "" when this computer does not show it.
  [[nodiscard]] const std::string& holder() const noexcept { return holder_; }

 private:
  [[nodiscard]] Outcome lock(const std::string& path);

  int fd_ = -1;
  std::string path_;  // of the lock file; empty: it is another process's
  std::string holder_;
};

}  // namespace berth::store

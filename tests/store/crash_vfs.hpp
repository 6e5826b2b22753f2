/// A disk that keeps only what was synced: a SQLite VFS in memory for crash tests.
///
/// Every write, truncation, sync and deletion counts as one step. From step `crash_at` on nothing reaches the disk any
/// more and every call fails, as if the power were gone; then `after_crash()` makes what a restart finds. What was not
/// synced may be lost, kept, or kept in part, and the last write may be torn, as `Loss` says.
///
/// A program that dies with the power leaves the same disk whether it ran on before or not: `record` keeps of one whole
/// run what a crash at each of its steps leaves, and `put_back` takes the disk there without running it again.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "berth/base/random.hpp"

namespace berth::store {

/// What becomes of writes that were not synced.
enum class Loss {
  all,             ///< none of them is on the disk
  all_torn_last,   ///< none, but a part of the last one, cut anywhere
  none,            ///< all of them are there, the one at the crash too
  none_torn_last,  ///< all, the last one cut anywhere
  some,            ///< any of them, in any combination, the last one torn
};

class CrashVfs {
 public:
  /// Registers itself with SQLite under `name`.
  explicit CrashVfs(std::string name);
  ~CrashVfs();
  CrashVfs(const CrashVfs&) = delete;
  CrashVfs& operator=(const CrashVfs&) = delete;

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// An empty disk.
  void format();
  /// The power goes at step `k` (from 0) from now; empty: it stays.
  void crash_at(std::optional<std::uint64_t> k);
  /// The next write of a file fails once with "disk full", at step `k` from now.
  void full_at(std::optional<std::uint64_t> k);
  /// Steps since the last `crash_at` or `full_at`.
  [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }
  [[nodiscard]] bool crashed() const noexcept { return crashed_; }
  /// The disk as a crash at one step leaves it, before `after_crash`.
  struct Moment;
  /// From now on each step adds its moment to `moments`, which must outlive this; null: no more.
  void record(std::vector<Moment>* moments) noexcept { moments_ = moments; }
  /// As if the power had gone at `moment`.
  void put_back(const Moment& moment);
  /// What is found after the restart; the disk works again.
  void after_crash(Loss loss, Random& random);

  struct Change {
    std::uint64_t at = 0;
    std::string bytes;
    bool truncate = false;  ///< to the length `at`
  };
  struct File {
    std::string synced;           ///< what is safely on the disk
    std::string now;              ///< what the process sees
    std::vector<Change> pending;  ///< what leads from `synced` to `now`
    bool exists_synced = false;   ///< the folder's entry is safe
    bool exists = true;
  };
  std::map<std::string, File>& files() noexcept { return files_; }

  /// Used by the VFS's functions. Counts a step; the SQLite result that it must give.
  int step(bool writes);
  /// Used by the VFS's functions, where a crash at this step would leave the disk.
  void keep_moment();

 private:
  std::string name_;
  sqlite3_vfs vfs_{};
  std::map<std::string, File> files_;
  std::vector<Moment>* moments_ = nullptr;
  std::uint64_t steps_ = 0;
  std::optional<std::uint64_t> crash_at_;
  std::optional<std::uint64_t> full_at_;
  bool crashed_ = false;
};

struct CrashVfs::Moment {
  std::map<std::string, File> files;
};

}  // namespace berth::store

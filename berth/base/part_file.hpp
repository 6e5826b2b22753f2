/// Replaces a file atomically: a reader, and a crash at any instant, finds the old file or the new one, whole. The new
/// file is written beside its place as PATH.PID.part. If it does not get to its place, it is removed, unless the
/// process dies.
/// process dies.
///
///     PartFile part(path);
///     int error = part.write(text);
///     if (error == 0) error = part.replace();
///     if (error != 0) return std::strerror(error);
#pragma once

#include <string>
#include <string_view>

#include <sys/types.h>

namespace berth {

/// Syncs the folder of `path` to the disk, after a name was added or removed.
void sync_folder_of(const std::string& path) noexcept;

class PartFile {
 public:
  explicit PartFile(std::string path);
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  /// The new file gets the permissions of the existing one, if any.
  void keep_permissions() noexcept { keeps_permissions_ = true; }
  /// Call once; synced. 0, or an errno. `mode` as for `open`.
  [[nodiscard]] int write(std::string_view bytes, mode_t mode = 0644);
  /// Replaces the existing file; the folder is synced. 0, or an errno.
  [[nodiscard]] int replace();
  /// Moves it to its place only if no file is there: EEXIST, else an errno, else 0.
  [[nodiscard]] int place_new();

 private:
  void placed() noexcept;
  std::string path_;
  std::string part_;
  bool made_ = false;
  bool keeps_permissions_ = false;
};

/// Replaces a file of a user; it keeps its permissions. 0, or an errno.
[[nodiscard]] int replace_user_file(const std::string& path, std::string_view bytes);

}  // namespace berth

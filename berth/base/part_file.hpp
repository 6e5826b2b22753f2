/// A file on its way to its place: who reads the place, and a crash at any instant, finds the old file or the new one,
/// whole. It is written beside its place as PATH.PID.part; what does not get to its place is taken away, but where the
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

/// A new name in the folder of `path`, or the end of one, is on the disk.
void sync_folder_of(const std::string& path) noexcept;

class PartFile {
 public:
  explicit PartFile(std::string path);
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  /// The new file gets the permissions of the one in its place, where there is one.
  void keep_permissions() noexcept { keeps_permissions_ = true; }
  /// Once; synced. 0, or an errno. `mode` is as `open` has it.
  [[nodiscard]] int write(std::string_view bytes, mode_t mode = 0644);
  /// In its place, instead of what is there; the folder is synced. 0, or an errno.
  [[nodiscard]] int replace();
  /// In its place, where nothing is: EEXIST, else an errno, else 0.
  [[nodiscard]] int place_new();

 private:
  void placed() noexcept;
  std::string path_;
  std::string part_;
  bool made_ = false;
  bool keeps_permissions_ = false;
};

}  // namespace berth

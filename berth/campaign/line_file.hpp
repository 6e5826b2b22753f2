/// The file that a campaign appends its lines to.
#pragma once

#include <string>
#include <string_view>

#include "berth/campaign/results.hpp"

namespace berth::campaign {

/// Each line is written by one call, so that a process that dies leaves whole lines, or whole ones and a torn last one.
/// Only one process may write a file: it is locked (flock; on a file system that has no locks it is not).
class LineFile {
 public:
  /// Opens it, makes it if there is none, reads its lines into `into`, and takes a torn last line off. Nothing of the
  /// file is changed when it has lines that are none of a campaign, or nothing but a torn one that does not begin as
  /// one: it may be another file, named by mistake. Errors: `Errc::duplicate`: another process writes it;
  /// `Errc::invalid`: it is no file of a campaign (the line in `detail`; 0: it is no plain file); `Errc::io`: the
  /// system says why (errno in `detail`).
  [[nodiscard]] static Result<LineFile> open(const std::string& path, Results& into);
  ~LineFile();
  LineFile(LineFile&& other) noexcept;
  LineFile& operator=(LineFile&&) = delete;

  /// `line` without its line feed. `Errc::io`: nothing of it is in the file, unless that cannot be undone.
  [[nodiscard]] Result<void> append(std::string_view line);
  /// Brings what was appended to the disk. `Errc::io`.
  [[nodiscard]] Result<void> sync();
  /// For a process that was forked, which must not hold the lock: it closes this.
  [[nodiscard]] int descriptor() const noexcept { return fd_; }
  /// What of the file was read when it was opened.
  [[nodiscard]] const FileRead& was() const noexcept { return was_; }

 private:
  LineFile(int fd, FileRead was) noexcept : fd_(fd), was_(std::move(was)) {}
  int fd_;
  FileRead was_;
};

}  // namespace berth::campaign

/// The built-in example files as files, for a program that has no repository beside it.
#pragma once

#include <string>

#include "berth/base/result.hpp"
#include "berth/harness/folders.hpp"

namespace berth::harness {

/// A folder of this process alone (mode 0700, beneath TMPDIR or /tmp) with these files; removed with its object, unless
/// the process dies before. A process that `fork` makes may use it, and must not destroy it (`_exit`).
class ExampleFiles {
 public:
  /// `Errc::io`: the system says why (errno in `detail`).
  [[nodiscard]] static Result<ExampleFiles> make();
  ~ExampleFiles();
  ExampleFiles(ExampleFiles&& other) noexcept;
  ExampleFiles& operator=(ExampleFiles&&) = delete;

  [[nodiscard]] Folders folders() const { return {path_, path_}; }

 private:
  explicit ExampleFiles(std::string path) noexcept;
  std::string path_;  // empty: moved from
};

}  // namespace berth::harness

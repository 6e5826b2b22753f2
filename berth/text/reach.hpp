/// Which files a file may name (docs/security.md): those in its own folder and its subfolders, and in its project,
/// which is the nearest folder above with a file `berth-project.toml`. Machine, plant and library files may come from
/// others, but the files that they name are opened with the user's rights.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/text/toml.hpp"

namespace berth::text {

/// The files that names in one file can reach. A link counts as its target, as far as it has one.
class Reach {
 public:
  /// Marks the folder of a project. A file of another user (not root) marks nothing.
  static constexpr const char* project_file = "berth-project.toml";

  /// `file`: the one that names others; need not exist. `allowed`: further folders allowed by the user
  /// (`--allow-outside`).
  explicit Reach(const std::string& file, std::span<const std::string> allowed = {});

  /// Bytes of the longest name: the system opens no longer one.
  static constexpr std::size_t longest = 4096;

  /// `name` relative to the folder of the file; an absolute name stays. Empty: it is out of reach, or too long. A named
  /// file counts as read (`note_read`), though it may be opened much later.
  [[nodiscard]] std::optional<std::string> path(const std::string& name) const;
  /// After so many names out of reach in one file, further ones are not followed: the file is refused anyway.
  static constexpr unsigned most_refused = 100;

  /// The same for the value of `key`. A name out of reach is an error of the table, and empty. After `most_refused` of
  /// them it is empty without another error.
  [[nodiscard]] std::string path(Table& table, std::string_view key, const std::string& name) const;

  /// Whether the file at `path` (from the function above) exists; else an error of the table: "vlave.eds not found; did
  /// you mean valve.eds?", chosen from the names in its folder with the same ending.
  [[nodiscard]] static bool there(Table& table, std::string_view key, const std::string& path);

  /// The folder of the project, or that of the file.
  [[nodiscard]] const std::string& folder() const noexcept { return folders_.front(); }
  [[nodiscard]] const std::vector<std::string>& allowed() const noexcept { return allowed_; }

 private:
  std::string file_;
  std::vector<std::string> allowed_;
  std::vector<std::string> folders_;  // resolved folders
  mutable unsigned refused_ = 0;
};

}  // namespace berth::text

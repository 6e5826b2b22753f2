/// Which files a file may name (docs/security.md): those in its own folder, in the folders of that, and in its project,
/// which is the nearest folder above with a file `berth-project.toml`. Machine, plant and library files come from
/// others too, and what they name is opened with the rights of the person who uses them.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/text/toml.hpp"

namespace berth::text {

/// What the names in one file reach. A link counts as what it leads to, as far as it leads somewhere.
class Reach {
 public:
  /// Marks the folder of a project. One that belongs to another user (not root) marks nothing.
  static constexpr const char* project_file = "berth-project.toml";

  /// `file`: the one that names others; need not be there. `allowed`: folders that a person named besides
  /// (`--allow-outside`).
  explicit Reach(const std::string& file, std::span<const std::string> allowed = {});

  /// Bytes of the longest name: the system opens no longer one.
  static constexpr std::size_t longest = 4096;

  /// `name` as seen from the folder of the file; an absolute name stays. Empty: it leads elsewhere, or is longer. What
  /// is named counts as read (`note_read`), though it may be opened much later.
  [[nodiscard]] std::optional<std::string> path(const std::string& name) const;
  /// Of so many names in one file that lead elsewhere the next are not followed: the file is refused as it is.
  static constexpr unsigned most_refused = 100;

  /// The same for the value of `key`; what leads elsewhere is an error of the table, and empty. Behind `most_refused`
  /// of them it is empty without another error.
  [[nodiscard]] std::string path(Table& table, std::string_view key, const std::string& name) const;

  /// Whether the file at `path` (of this function above) is there; else an error of the table: "vlave.eds not found;
  /// did you mean valve.eds?", by the names in its folder that end alike.
  [[nodiscard]] static bool there(Table& table, std::string_view key, const std::string& path);

  /// The folder of the project, or that of the file.
  [[nodiscard]] const std::string& folder() const noexcept { return folders_.front(); }
  [[nodiscard]] const std::vector<std::string>& allowed() const noexcept { return allowed_; }

 private:
  std::string file_;
  std::vector<std::string> allowed_;
  std::vector<std::string> folders_;  // real ones
  mutable unsigned refused_ = 0;
};

}  // namespace berth::text

#include "berth/text/reach.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "berth/base/read_files.hpp"
#include "berth/base/real_path.hpp"
#include "berth/text/file.hpp"
#include "berth/text/quantity.hpp"

namespace berth::text {
namespace {

namespace fs = std::filesystem;

bool leads_nowhere(const fs::path& real) {
  std::error_code not_there;
  return fs::is_symlink(fs::symlink_status(real, not_there));
}

// In a folder that two users of the computer can write to, such as /tmp, the other one could turn all of it into a
// project.
bool marks_project(const fs::path& folder) {
  struct stat about {};
  if (::stat((folder / Reach::project_file).c_str(), &about) != 0) return false;
  return about.st_uid == ::geteuid() || about.st_uid == 0;
}

fs::path project_of(const fs::path& folder) {
  for (fs::path at = folder;; at = at.parent_path()) {
    if (marks_project(at)) return at;
    if (at == at.parent_path()) return folder;
  }
}

}  // namespace

Reach::Reach(const std::string& file, std::span<const std::string> allowed)
    : file_(file), allowed_(allowed.begin(), allowed.end()) {
  folders_.push_back(project_of(real_path(file).parent_path()).string());
  for (const auto& each : allowed_) {
    const fs::path folder = real_path(each);
    // A name that ends in a slash has an empty last part.
    if (!folder.empty()) folders_.push_back((folder.has_filename() ? folder : folder.parent_path()).string());
  }
}

std::optional<std::string> Reach::path(const std::string& name) const {
  // The system reads a name up to a NUL: text after it would make a path look as if it led back.
  if (name.size() > longest || name.find('\0') != std::string::npos) return std::nullopt;
  std::string made = beside(file_, name);
  const fs::path leads_to = real_path(made);
  if (leads_to.empty() || leads_nowhere(leads_to)) return std::nullopt;
  const bool reached = std::ranges::any_of(folders_, [&](const auto& each) { return is_beneath(leads_to, each); });
  if (!reached) return std::nullopt;
  note_read(made);
  return made;
}

std::string Reach::path(Table& table, std::string_view key, const std::string& name) const {
  if (name.size() > longest) {
    table.error(key, fmt::format("the file name has {} bytes, {} at most", name.size(), longest), "shorten it");
    return {};
  }
  if (refused_ >= most_refused) return {};
  auto found = path(name);
  if (found) return *std::move(found);
  ++refused_;
  table.error(
      key, fmt::format("{} leads out of {}", text::quoted(name), folder()),
      fmt::format(
          "put the file there; or put an empty {} into a folder above that has both; or give --allow-outside FOLDER",
          project_file));
  return {};
}

bool Reach::there(Table& table, std::string_view key, const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code none;
  const fs::path file(path);
  if (fs::exists(file, none)) return true;
  constexpr std::size_t most = 1000;  // names that are compared
  std::vector<std::string> names;
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  for (fs::directory_iterator at(folder, none), end; !none && at != end && names.size() < most; at.increment(none)) {
    if (at->path().extension() == file.extension()) names.push_back(at->path().filename().string());
  }
  const std::vector<std::string_view> known(names.begin(), names.end());
  const auto near = closest(file.filename().string(), known);
  table.error(
      key, fmt::format("{} not found", path),
      near.empty() ? "file names are relative to the folder of this file" : fmt::format("did you mean {}?", near));
  return false;
}

}  // namespace berth::text

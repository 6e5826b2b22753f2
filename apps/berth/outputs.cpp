#include "outputs.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <utility>
#include <vector>

#include "berth/base/read_files.hpp"
#include "berth/base/real_path.hpp"
#include "options.hpp"
#include "whole_files.hpp"

namespace berth::cli {
namespace {

namespace fs = std::filesystem;

struct Claimed {
  std::string path;  // with links resolved
  std::string option;
};

std::vector<Claimed>& all_claimed() {
  static std::vector<Claimed> all;
  return all;
}

std::string name_of(const std::string& path) {
  const auto real = real_path(path);
  return real.empty() ? path : real.string();
}

// The option that has named this file, which need not exist yet; null: none.
const std::string* claimed_by(const std::string& path) {
  const auto it = std::ranges::find(all_claimed(), name_of(path), &Claimed::path);
  return it == all_claimed().end() ? nullptr : &it->option;
}

std::optional<Failure> claim(const std::string& path, const char* option) {
  const auto* const other = claimed_by(path);
  if (other != nullptr) {
    return failure(Exit::usage,
                   fmt::format("{}: {} and {} both name it; give each a file of its own", path, *other, option));
  }
  all_claimed().push_back({name_of(path), option});
  return std::nullopt;
}

bool has_claimed(const std::string& path, const char* option) {
  const auto* const by = claimed_by(path);
  return by != nullptr && *by == option;
}

bool is_plain(const std::string& path, bool& empty) {
  struct stat about {};
  if (::stat(path.c_str(), &about) != 0) return false;
  empty = about.st_size == 0;
  return S_ISREG(about.st_mode);
}

std::optional<Failure> is_input(const std::string& path, const char* option) {
  if (!was_read(path)) return std::nullopt;
  return failure(Exit::usage, fmt::format("{}: this command reads it; name another file for {}", path, option));
}

}  // namespace

std::optional<Failure> may_write(const std::string& path, const char* option, bool force) {
  if (has_claimed(path, option)) return std::nullopt;
  if (auto input = is_input(path, option)) return input;
  bool empty = false;
  if (!is_plain(path, empty)) {
    std::error_code none;
    return fs::exists(path, none) ? std::nullopt : claim(path, option);
  }
  if (!force && !empty) {
    return failure(Exit::no,
                   fmt::format("{}: is there already; --force replaces it, or name another file for {}", path, option));
  }
  return claim(path, option);
}

std::optional<Failure> write_output(const std::string& path, std::string_view bytes) {
  if (auto input = is_input(path, "its output")) return input;
  bool empty = false;
  std::error_code none;
  if (is_plain(path, empty) || !fs::exists(path, none)) return write_whole({{name_of(path), bytes}}, true);
  std::ofstream stream(path, std::ios::binary);
  stream << bytes;
  stream.close();
  if (stream.good()) return std::nullopt;
  return failure(Exit::failed, path + ": " + std::strerror(errno));
}

std::optional<Failure> may_keep(const std::string& path, const char* option) {
  if (has_claimed(path, option)) return std::nullopt;  // claimed by this option already, and read since as its own file
  if (auto input = is_input(path, option)) return input;
  return claim(path, option);
}

}  // namespace berth::cli

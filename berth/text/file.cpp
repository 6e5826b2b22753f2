#include "berth/text/file.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "berth/base/read_files.hpp"

namespace berth::text {

std::optional<std::string> read_file(const std::string& path, Findings& findings) {
  const auto refuse = [&](std::string message) {
    findings.push_back({Finding::Severity::error, path, 0, 0, "", std::move(message), ""});
    return std::nullopt;
  };
  std::error_code code;
  if (std::filesystem::is_directory(path, code)) return refuse("this is a folder, not a file");
  errno = 0;
  std::ifstream in(path, std::ios::binary);
  if (!in) return refuse(std::string("cannot be read: ") + std::strerror(errno != 0 ? errno : EIO));
  note_read(path);
  constexpr std::uintmax_t limit = 64U << 20U;
  const auto size = std::filesystem::file_size(path, code);
  if (!code && size > limit) return refuse("is larger than 64 MiB");
  // A device or a pipe has no size: the bytes that come are counted.
  std::string text;
  std::array<char, 65536> part{};
  while (in.read(part.data(), part.size()) || in.gcount() > 0) {
    text.append(part.data(), static_cast<std::size_t>(in.gcount()));
    if (text.size() > limit) return refuse("is larger than 64 MiB");
  }
  if (in.bad()) return refuse("cannot be read to its end");
  return text;
}

std::string beside(const std::string& file, const std::string& name) {
  const std::filesystem::path path(name);
  if (path.is_absolute()) return name;
  return (std::filesystem::path(file).parent_path() / path).string();
}

}  // namespace berth::text

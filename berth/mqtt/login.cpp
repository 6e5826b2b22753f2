#include "berth/mqtt/login.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "berth/base/read_files.hpp"

namespace berth::mqtt {
namespace {

constexpr std::size_t longest_file = 4096;

// One line; `text` then begins behind it.
std::string_view take_line(std::string_view& text) noexcept {
  const auto end = text.find('\n');
  auto line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

}  // namespace

tl::expected<Login, std::string> parse_login(std::string_view text) {
  if (text.find('\0') != std::string_view::npos)
    return tl::unexpected(std::string("1: this is not a text file: it has a NUL character"));
  const bool two = text.find('\n') != std::string_view::npos;
  const auto user = take_line(text);
  if (user.empty()) return tl::unexpected(std::string("1: the user is missing: the first line is the user's name"));
  if (!two) return tl::unexpected(std::string("2: the password is missing: the second line is the password"));
  const auto password = take_line(text);
  while (!text.empty()) {
    if (!take_line(text).empty())
      return tl::unexpected(std::string("3: only two lines are expected: the user and the password"));
  }
  return Login{std::string(user), std::string(password)};
}

tl::expected<Login, std::string> read_login(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) return tl::unexpected(fmt::format("{}: {}", path, std::strerror(errno)));
  note_read(path);
  struct stat what {};
  std::array<char, longest_file + 1> buffer{};
  const bool plain = ::fstat(fd, &what) == 0 && S_ISREG(what.st_mode);
  const auto got = plain ? ::read(fd, buffer.data(), buffer.size()) : -1;
  ::close(fd);
  if (!plain || got < 0) return tl::unexpected(fmt::format("{}: this is not a file that can be read", path));
  if ((what.st_mode & 077U) != 0)
    return tl::unexpected(fmt::format("{}: other users can read the password in it: chmod 600 {}", path, path));
  if (static_cast<std::size_t>(got) > longest_file)
    return tl::unexpected(fmt::format("{}: a user and a password take at most {} bytes", path, longest_file));
  auto login = parse_login(std::string_view(buffer.data(), static_cast<std::size_t>(got)));
  if (!login) return tl::unexpected(fmt::format("{}:{}", path, login.error()));
  return login;
}

}  // namespace berth::mqtt

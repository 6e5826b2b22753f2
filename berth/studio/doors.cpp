#include "berth/studio/doors.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <sstream>
#include <utility>

#include "berth/base/words.hpp"

namespace berth::studio {
namespace {

constexpr std::string_view own_names[] = {"127.0.0.1", "localhost", "[::1]"};

std::string_view trimmed(std::string_view text) noexcept {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

/// Creates a file with mode 0600; it must not exist. Returns the error's text.
std::optional<std::string> write_new(const std::string& path, const std::string& text) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
  if (fd < 0) return fmt::format("{}: {}", path, std::strerror(errno));
  const bool whole =
      ::fchmod(fd, 0600) == 0 && ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const int error = errno;
  ::close(fd);
  if (whole) return std::nullopt;
  ::unlink(path.c_str());
  return fmt::format("{}: {}", path, std::strerror(error));
}

}  // namespace

std::string make_token() {
  std::array<unsigned char, 32> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) return {};
  std::string token;
  for (const auto byte : bytes) token += fmt::format("{:02x}", byte);
  return token;
}

// Takes the same time wherever the two differ, so that the duration reveals nothing.
bool same_token(std::string_view given, std::string_view token) noexcept {
  unsigned different = given.size() == token.size() && !token.empty() ? 0 : 1;
  for (std::size_t i = 0; i < given.size(); ++i) {
    const char expected = token.empty() ? '\0' : token[i % token.size()];
    different |= static_cast<unsigned char>(given[i]) ^ static_cast<unsigned char>(expected);
  }
  return different == 0;
}

tl::expected<Tokens, std::string> Tokens::make() {
  Tokens tokens;
  for (auto& token : tokens.each_) {
    token = make_token();
    if (token.empty()) return tl::unexpected(std::string("the system gives no random numbers for the token"));
  }
  return tokens;
}

tl::expected<void, std::string> Tokens::read(const std::string& text) {
  std::istringstream lines(text);
  std::string line;
  for (unsigned number = 1; std::getline(lines, line); ++number) {
    const auto blank = line.find(' ');
    const auto role = command::parse_role(line.substr(0, blank));
    const auto token = trimmed(blank == std::string::npos ? std::string_view() : std::string_view(line).substr(blank));
    const bool hex = std::ranges::all_of(token, [](unsigned char c) { return std::isxdigit(c) != 0; });
    if (!role || token.size() != 64 || !hex)
      return tl::unexpected(
          fmt::format("{}: a line is a role (view, operate, configure) and 64 hexadecimal digits", number));
    each_[static_cast<std::size_t>(*role)] = token;
  }
  for (const auto role : command::all_roles) {
    if (of(role).empty()) return tl::unexpected(fmt::format("1: there is no token for the role {}", name(role)));
    for (const auto other : command::all_roles) {
      if (role != other && of(role) == of(other))
        return tl::unexpected(fmt::format("1: {} and {} have the same token", name(role), name(other)));
    }
  }
  return {};
}

tl::expected<Tokens, std::string> Tokens::keep(const std::string& path) {
  constexpr std::size_t longest = 4096;
  const int fd = ::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0 && errno == ENOENT) {
    auto made = make();
    if (!made) return made;
    std::string text;
    for (const auto role : command::all_roles) text += fmt::format("{} {}\n", name(role), made->of(role));
    if (const auto problem = write_new(path, text)) return tl::unexpected(*problem);
    return made;
  }
  if (fd < 0) return tl::unexpected(fmt::format("{}: {}", path, std::strerror(errno)));
  struct stat what {};
  std::array<char, longest> buffer{};
  const bool plain = ::fstat(fd, &what) == 0 && S_ISREG(what.st_mode);
  const auto got = plain ? ::read(fd, buffer.data(), buffer.size()) : -1;
  ::close(fd);
  if (!plain || got < 0) return tl::unexpected(fmt::format("{}: this is not a file that can be read", path));
  if ((what.st_mode & 077U) != 0)
    return tl::unexpected(fmt::format("{}: other users can read the tokens in it: chmod 600 {}", path, path));
  Tokens tokens;
  const auto read = tokens.read(std::string(buffer.data(), static_cast<std::size_t>(got)));
  if (!read) return tl::unexpected(fmt::format("{}:{}", path, read.error()));
  return tokens;
}

const std::string& Tokens::of(command::Role role) const noexcept { return each_[static_cast<std::size_t>(role)]; }

std::optional<command::Role> Tokens::role_of(std::string_view given) const noexcept {
  std::optional<command::Role> found;
  for (const auto role : command::all_roles) {
    if (same_token(given, of(role))) found = role;
  }
  return found;
}

std::string TokenFiles::file_of(const std::string& path, command::Role role) {
  return role == command::Role::configure ? path : fmt::format("{}.{}", path, name(role));
}

tl::expected<TokenFiles, std::string> TokenFiles::write(const std::string& path, const Tokens& tokens) {
  TokenFiles files;
  for (const auto role : command::all_roles) {
    const auto file = file_of(path, role);
    if (::unlink(file.c_str()) != 0 && errno != ENOENT)
      return tl::unexpected(fmt::format("{}: {}", file, std::strerror(errno)));
    if (const auto problem = write_new(file, tokens.of(role) + '\n')) return tl::unexpected(*problem);
    files.paths_.push_back(file);
  }
  return files;
}

TokenFiles::~TokenFiles() {
  for (const auto& path : paths_) ::unlink(path.c_str());
}

TokenFiles::TokenFiles(TokenFiles&& other) noexcept : paths_(std::exchange(other.paths_, {})) {}

TokenFiles& TokenFiles::operator=(TokenFiles&& other) noexcept {
  std::swap(paths_, other.paths_);
  return *this;
}

bool is_own_host(std::string_view host, std::uint16_t port) noexcept {
  const auto colon = host.rfind(':');
  if (colon == std::string_view::npos || host.substr(colon + 1) != std::to_string(port)) return false;
  const auto name = host.substr(0, colon);
  return std::ranges::any_of(own_names, [&](std::string_view own) { return same_word(name, own); });
}

std::string_view name_in_host(std::string_view host, std::uint16_t port) noexcept {
  constexpr std::uint16_t port_of_https = 443;
  const bool in_brackets = host.starts_with('[');
  const auto close = host.find(']');
  if (in_brackets && close == std::string_view::npos) return {};
  const auto name = in_brackets ? host.substr(1, close - 1) : host.substr(0, host.find(':'));
  const auto rest = in_brackets ? host.substr(close + 1) : host.substr(name.size());
  if (rest.empty()) return port == port_of_https ? name : std::string_view();
  return rest.front() == ':' && rest.substr(1) == std::to_string(port) ? name : std::string_view();
}

std::string_view token_offered(std::string_view subprotocols) noexcept {
  constexpr std::string_view mark = "token.";
  std::string_view token;
  bool speaks = false;
  while (!subprotocols.empty()) {
    const auto comma = subprotocols.find(',');
    const auto word = trimmed(subprotocols.substr(0, comma));
    if (word == "berth.v1") speaks = true;
    if (word.starts_with(mark)) token = word.substr(mark.size());
    subprotocols = comma == std::string_view::npos ? std::string_view() : subprotocols.substr(comma + 1);
  }
  return speaks ? token : std::string_view();
}

std::string_view bearer(std::string_view authorization) noexcept {
  constexpr std::string_view mark = "Bearer ";
  return authorization.size() > mark.size() && same_word(authorization.substr(0, mark.size()), mark)
             ? trimmed(authorization.substr(mark.size()))
             : std::string_view();
}

}  // namespace berth::studio

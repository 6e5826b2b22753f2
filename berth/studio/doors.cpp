#include "berth/studio/doors.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
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

}  // namespace

std::string make_token() {
  std::array<unsigned char, 32> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) return {};
  std::string token;
  for (const auto byte : bytes) token += fmt::format("{:02x}", byte);
  return token;
}

// No step depends on where they differ: who asks again and again learns nothing from how long it took.
bool same_token(std::string_view given, std::string_view token) noexcept {
  unsigned different = given.size() == token.size() && !token.empty() ? 0 : 1;
  for (std::size_t i = 0; i < given.size(); ++i) {
    const char expected = token.empty() ? '\0' : token[i % token.size()];
    different |= static_cast<unsigned char>(given[i]) ^ static_cast<unsigned char>(expected);
  }
  return different == 0;
}

tl::expected<TokenFile, std::string> TokenFile::write(const std::string& path, const std::string& token) {
  const auto problem = [&] { return tl::unexpected(fmt::format("{}: {}", path, std::strerror(errno))); };
  if (::unlink(path.c_str()) != 0 && errno != ENOENT) return problem();
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
  if (fd < 0) return problem();
  TokenFile file;
  file.path_ = path;
  const std::string line = token + '\n';
  const bool whole =
      ::fchmod(fd, 0600) == 0 && ::write(fd, line.data(), line.size()) == static_cast<ssize_t>(line.size());
  const int error = errno;
  ::close(fd);
  errno = error;
  if (!whole) return problem();
  return file;
}

TokenFile::~TokenFile() {
  if (!path_.empty()) ::unlink(path_.c_str());
}

TokenFile::TokenFile(TokenFile&& other) noexcept : path_(std::exchange(other.path_, {})) {}

TokenFile& TokenFile::operator=(TokenFile&& other) noexcept {
  std::swap(path_, other.path_);
  return *this;
}

bool is_own_host(std::string_view host, std::uint16_t port) noexcept {
  const auto colon = host.rfind(':');
  if (colon == std::string_view::npos || host.substr(colon + 1) != std::to_string(port)) return false;
  const auto name = host.substr(0, colon);
  return std::ranges::any_of(own_names, [&](std::string_view own) { return same_word(name, own); });
}

bool is_own_origin(std::string_view origin, std::uint16_t port) noexcept {
  constexpr std::string_view scheme = "http://";
  return origin.starts_with(scheme) && is_own_host(origin.substr(scheme.size()), port);
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

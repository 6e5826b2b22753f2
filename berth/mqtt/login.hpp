/// The user and the password for a broker, from a file: the user in the first line, the password in the second.
#pragma once

#include <string>
#include <string_view>
#include <tl/expected.hpp>

namespace berth::mqtt {

struct Login {
  std::string user{};      ///< empty: none
  std::string password{};  ///< taken as it stands in the line, with its blanks
  friend bool operator==(const Login&, const Login&) = default;
};

/// The two lines of such a file; each may end with CR LF. The password may be empty. Errors in words, after the line's
/// number ("2: ..."); they never repeat what the file says.
[[nodiscard]] tl::expected<Login, std::string> parse_login(std::string_view text);

/// Refused: a file that others than its owner may read or write, a link, more than 4 KiB.
[[nodiscard]] tl::expected<Login, std::string> read_login(const std::string& path);

}  // namespace berth::mqtt

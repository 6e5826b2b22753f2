/// Access control: the tokens of a start, one per role, and the headers that name the server (Host) and the origin of
/// the page (Origin). Pure, except for the random numbers and the token file.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "berth/command/role.hpp"

namespace berth::studio {

/// 32 random bytes as 64 hexadecimal digits. Empty: the system gave none.
[[nodiscard]] std::string make_token();

/// Equal in all characters. The time depends only on the length of `given`.
[[nodiscard]] bool same_token(std::string_view given, std::string_view token) noexcept;

/// A token for each role: whoever presents it has that role.
class Tokens {
 public:
  /// New ones. Errors as text.
  [[nodiscard]] static tl::expected<Tokens, std::string> make();
  /// The tokens of a file with a line "ROLE TOKEN" for each role; a missing file is made with new ones (mode 0600). A
  /// file that other users can read, or that is not of this form, is refused with the line.
  [[nodiscard]] static tl::expected<Tokens, std::string> keep(const std::string& path);
  [[nodiscard]] const std::string& of(command::Role role) const noexcept;
  /// The role of this token; empty: none. The time depends only on the length of `given`.
  [[nodiscard]] std::optional<command::Role> role_of(std::string_view given) const noexcept;

 private:
  [[nodiscard]] tl::expected<void, std::string> read(const std::string& text);
  std::array<std::string, command::all_roles.size()> each_;
};

/// The tokens in files that only their user can read (mode 0600). Made anew, and removed with this object. Next to the
/// control socket, so that programs of the same user find them.
class TokenFiles {
 public:
  /// The file of a role's token: PATH for configure, PATH.operate and PATH.view for the others.
  [[nodiscard]] static std::string file_of(const std::string& path, command::Role role);
  /// Existing files of these names are removed first: a link is not followed. Errors as text.
  [[nodiscard]] static tl::expected<TokenFiles, std::string> write(const std::string& path, const Tokens& tokens);
  TokenFiles() = default;  ///< none
  ~TokenFiles();
  TokenFiles(TokenFiles&& other) noexcept;
  TokenFiles& operator=(TokenFiles&& other) noexcept;

 private:
  std::vector<std::string> paths_;
};

/// `Host` is one of this server's own names: 127.0.0.1, localhost or [::1], with its port. A page whose name another
/// name server directs here (DNS rebinding) sends a different one.
[[nodiscard]] bool is_own_host(std::string_view host, std::uint16_t port) noexcept;

/// The name in `Host` if its port is this one ("plant.example:8302", "[::1]:8302" without brackets; for 443 also
/// without a port); empty: another port.
[[nodiscard]] std::string_view name_in_host(std::string_view host, std::uint16_t port) noexcept;

/// The token in "berth.v1, token.TOKEN" (Sec-WebSocket-Protocol), in any order; empty: no token, or no "berth.v1".
[[nodiscard]] std::string_view token_offered(std::string_view subprotocols) noexcept;

/// The token in "Bearer TOKEN" (Authorization); empty: none.
[[nodiscard]] std::string_view bearer(std::string_view authorization) noexcept;

}  // namespace berth::studio

/// Who is let in: the tokens of a start, one a role, and the words by which a request says whom it means (Host) and
/// where the page that sends it comes from (Origin). Pure, but for the random number and the token's file.
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

/// Equal in all characters, by a time that depends on the length of `given` alone.
[[nodiscard]] bool same_token(std::string_view given, std::string_view token) noexcept;

/// A token for each role: who shows it, has that role.
class Tokens {
 public:
  /// New ones. Failures in words.
  [[nodiscard]] static tl::expected<Tokens, std::string> make();
  /// Those of a file with a line "ROLE TOKEN" for each role; a file that is not there is made with new ones (mode
  /// 0600). One that other users can read, or that is no such file, is refused with its line.
  [[nodiscard]] static tl::expected<Tokens, std::string> keep(const std::string& path);
  [[nodiscard]] const std::string& of(command::Role role) const noexcept;
  /// Whose token it is; empty: nobody's. The time depends on the length of `given` alone.
  [[nodiscard]] std::optional<command::Role> role_of(std::string_view given) const noexcept;

 private:
  [[nodiscard]] tl::expected<void, std::string> read(const std::string& text);
  std::array<std::string, command::all_roles.size()> each_;
};

/// The tokens in files that only their user can read (mode 0600), made anew; taken away when this goes. Beside the
/// control socket, so that programs of the same user find them.
class TokenFiles {
 public:
  /// Where a role's token stands: PATH has that of configure, PATH.operate and PATH.view have those of the others.
  [[nodiscard]] static std::string file_of(const std::string& path, command::Role role);
  /// What is there under these
  /// names goes first: a link is not followed. Failures in words.
  [[nodiscard]] static tl::expected<TokenFiles, std::string> write(const std::string& path, const Tokens& tokens);
  TokenFiles() = default;  ///< none
  ~TokenFiles();
  TokenFiles(TokenFiles&& other) noexcept;
  TokenFiles& operator=(TokenFiles&& other) noexcept;

 private:
  std::vector<std::string> paths_;
};

/// `Host` is this server by one of its own names: 127.0.0.1, localhost or [::1], with its port. A page whose name a
/// stranger's name server points here (DNS rebinding) says another.
[[nodiscard]] bool is_own_host(std::string_view host, std::uint16_t port) noexcept;

/// The name in `Host` where its port is this one ("plant.example:8302", "[::1]:8302" without brackets; for 443 also
/// without a port); empty: it is another port.
[[nodiscard]] std::string_view name_in_host(std::string_view host, std::uint16_t port) noexcept;

/// The token in "berth.v1, token.TOKEN" (Sec-WebSocket-Protocol), in any order; empty: there is none, or no "berth.v1".
[[nodiscard]] std::string_view token_offered(std::string_view subprotocols) noexcept;

/// The token in "Bearer TOKEN" (Authorization); empty: none.
[[nodiscard]] std::string_view bearer(std::string_view authorization) noexcept;

}  // namespace berth::studio

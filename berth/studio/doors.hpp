/// Who is let in: the token of a start, and the words by which a request says whom it means (Host) and where the page
/// that sends it comes from (Origin). Pure, but for the random number and the token's file.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

namespace berth::studio {

/// 32 random bytes as 64 hexadecimal digits. Empty: the system gave none.
[[nodiscard]] std::string make_token();

/// Equal in all characters, by a time that depends on the length of `given` alone.
[[nodiscard]] bool same_token(std::string_view given, std::string_view token) noexcept;

/// The token in a file that only its user can read (mode 0600), made anew; taken away when this goes. Beside the
/// control socket, so that programs of the same user find it.
class TokenFile {
 public:
  /// What is there under that name goes first: a link is not followed. Failures in words.
  [[nodiscard]] static tl::expected<TokenFile, std::string> write(const std::string& path, const std::string& token);
  TokenFile() = default;  ///< none
  ~TokenFile();
  TokenFile(TokenFile&& other) noexcept;
  TokenFile& operator=(TokenFile&& other) noexcept;

 private:
  std::string path_;
};

/// `Host` is this server by one of its own names: 127.0.0.1, localhost or [::1], with its port. A page whose name a
/// stranger's name server points here (DNS rebinding) says another.
[[nodiscard]] bool is_own_host(std::string_view host, std::uint16_t port) noexcept;

/// `Origin` is a page of this server: "http://" and one of these names.
[[nodiscard]] bool is_own_origin(std::string_view origin, std::uint16_t port) noexcept;

/// The token in "berth.v1, token.TOKEN" (Sec-WebSocket-Protocol), in any order; empty: there is none, or no "berth.v1".
[[nodiscard]] std::string_view token_offered(std::string_view subprotocols) noexcept;

/// The token in "Bearer TOKEN" (Authorization); empty: none.
[[nodiscard]] std::string_view bearer(std::string_view authorization) noexcept;

}  // namespace berth::studio

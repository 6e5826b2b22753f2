/// Where an MQTT broker is, as people write it: `mqtt://HOST[:PORT]`, or by TLS `mqtts://HOST[:PORT]`.
///
/// HOST is a name, an IPv4 address, or an IPv6 address in brackets. Without a port it is 1883, by TLS 8883 (IANA's
/// registered ports). A user in the address is refused: addresses appear in lists of processes, in logs and in tickets.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

namespace berth::mqtt {

inline constexpr std::uint16_t default_port = 1883;
inline constexpr std::uint16_t default_tls_port = 8883;

struct Where {
  bool tls = false;
  std::string host{};  ///< IPv6 without brackets
  std::uint16_t port = default_port;
  friend bool operator==(const Where&, const Where&) = default;
};

/// Errors in words. They do not repeat an address with a user in it.
[[nodiscard]] tl::expected<Where, std::string> parse_where(std::string_view text);
/// With its port: "mqtts://broker.plant:8883".
[[nodiscard]] std::string to_string(const Where& where);
/// True if `host` is an IPv4 or IPv6 address.
[[nodiscard]] bool is_address(const std::string& host) noexcept;

}  // namespace berth::mqtt

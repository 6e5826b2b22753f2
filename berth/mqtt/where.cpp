#include "berth/mqtt/where.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>

#include <algorithm>
#include <charconv>
#include <optional>

#include "berth/base/words.hpp"

namespace berth::mqtt {
namespace {

constexpr std::size_t longest_host = 253;  // RFC 1035 §2.3.4, without the root's dot
constexpr std::size_t longest_label = 63;

using Read = tl::expected<Where, std::string>;

// The system reads up to a NUL.
bool is_of(int family, const std::string& host) noexcept {
  in6_addr address{};  // the larger one
  return host.find('\0') == std::string::npos && ::inet_pton(family, host.c_str(), &address) == 1;
}

bool is_ipv4(const std::string& host) noexcept { return is_of(AF_INET, host); }
bool is_ipv6(const std::string& host) noexcept { return is_of(AF_INET6, host); }

bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }

// The underscore is in no standard, and in the names of many plants.
bool is_name_character(char c) noexcept {
  return is_digit(c) || (lower(c) >= 'a' && lower(c) <= 'z') || c == '-' || c == '_';
}

bool is_label(std::string_view label) noexcept {
  return !label.empty() && label.size() <= longest_label && std::ranges::all_of(label, is_name_character);
}

// "10.0.0.300" and "10.1" are no names: the system would read the second as 10.0.0.1.
bool is_name(std::string_view host) noexcept {
  if (host.ends_with('.')) host.remove_suffix(1);
  if (host.empty() || host.size() > longest_host) return false;
  for (;;) {
    const auto dot = host.find('.');
    const auto label = host.substr(0, dot);
    if (!is_label(label)) return false;
    if (dot == std::string_view::npos) return !std::ranges::all_of(label, is_digit);
    host.remove_prefix(dot + 1);
  }
}

std::optional<std::uint16_t> parse_port(std::string_view text) noexcept {
  std::uint16_t port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (error != std::errc() || end != text.data() + text.size() || port == 0) return std::nullopt;
  return port;
}

tl::unexpected<std::string> refuse(std::string_view text, std::string_view why) {
  return tl::unexpected(fmt::format("{}: {}", berth::quoted(text), why));
}

Read with_port(Where where, std::string_view text, std::optional<std::string_view> port) {
  if (!port) return where;
  const auto number = parse_port(*port);
  if (!number) return refuse(text, "the port is a number from 1 to 65535");
  where.port = *number;
  return where;
}

Read in_brackets(Where where, std::string_view text, std::string_view rest) {
  const auto close = rest.find(']');
  where.host = rest.substr(1, close == std::string_view::npos ? close : close - 1);
  if (close == std::string_view::npos || !is_ipv6(where.host))
    return refuse(text, "an IPv6 address stands in the brackets: mqtt://[::1]:1883");
  const auto after = rest.substr(close + 1);
  if (after.empty()) return where;
  if (after.front() != ':') return refuse(text, "after the address comes nothing, or a colon and the port");
  return with_port(std::move(where), text, after.substr(1));
}

Read with_name(Where where, std::string_view text, std::string_view rest) {
  if (std::ranges::count(rest, ':') > 1)
    return refuse(text, "an IPv6 address is written in brackets: mqtt://[::1]:1883");
  const auto colon = rest.find(':');
  where.host = rest.substr(0, colon);
  if (where.host.empty()) return refuse(text, "the host is missing: mqtt://HOST or mqtt://HOST:PORT");
  if (!is_ipv4(where.host) && !is_name(where.host))
    return refuse(text, fmt::format("{} is neither a host's name nor an address", berth::quoted(where.host)));
  if (colon == std::string_view::npos) return where;
  return with_port(std::move(where), text, rest.substr(colon + 1));
}

}  // namespace

tl::expected<Where, std::string> parse_where(std::string_view text) {
  constexpr std::string_view mark = "://";
  if (text.find('@') != std::string_view::npos)
    return tl::unexpected(
        std::string("an address of a broker has no user or password, because others can read addresses: put both into "
                    "a file, the user in the first line and the password in the second"));
  const auto end = text.find(mark);
  const auto scheme = text.substr(0, end);
  Where where;
  where.tls = same_word(scheme, "mqtts");
  if (end == std::string_view::npos || (!where.tls && !same_word(scheme, "mqtt")))
    return refuse(text, "write mqtt://HOST, or with TLS mqtts://HOST");
  if (where.tls) where.port = default_tls_port;
  const auto rest = text.substr(end + mark.size());
  if (rest.find_first_of("/?#") != std::string_view::npos) return refuse(text, "nothing follows the host and the port");
  return rest.starts_with('[') ? in_brackets(std::move(where), text, rest) : with_name(std::move(where), text, rest);
}

std::string to_string(const Where& where) {
  const bool brackets = where.host.find(':') != std::string::npos;
  return fmt::format("{}://{}{}{}:{}", where.tls ? "mqtts" : "mqtt", brackets ? "[" : "", where.host,
                     brackets ? "]" : "", where.port);
}

bool is_address(const std::string& host) noexcept { return is_ipv4(host) || is_ipv6(host); }

}  // namespace berth::mqtt

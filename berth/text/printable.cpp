#include "berth/text/printable.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <iterator>

namespace berth::text {
namespace {

struct Character {
  std::uint32_t point = 0;
  std::size_t length = 0;  ///< bytes; 0: no UTF-8
};

Character character_at(std::string_view text, std::size_t at) noexcept {
  const auto byte = [&](std::size_t i) {
    return at + i < text.size() ? static_cast<std::uint32_t>(static_cast<unsigned char>(text[at + i])) : 0U;
  };
  const std::uint32_t lead = byte(0);
  if (lead < 0x80) return {lead, 1};
  const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4) return {};
  std::uint32_t point = lead & (0xFFU >> (length + 1));
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0U) != 0x80) return {};
    point = point << 6U | (byte(i) & 0x3FU);
  }
  constexpr std::uint32_t least[]{0, 0, 0x80, 0x800, 0x10000};
  const bool surrogate = point >= 0xD800 && point <= 0xDFFF;
  if (point < least[length] || surrogate || point > 0x10FFFF) return {};
  return {point, length};
}

bool harmless(std::uint32_t point) noexcept {
  if (point == '\n' || point == '\t') return true;
  const bool control = point < 0x20 || (point >= 0x7F && point < 0xA0);
  const bool direction = point == 0x061C || point == 0x200E || point == 0x200F ||
                         (point >= 0x202A && point <= 0x202E) || (point >= 0x2066 && point <= 0x2069);
  const bool separator = point == 0x2028 || point == 0x2029;
  return !control && !direction && !separator;
}

bool plain(char c) noexcept { return (c >= ' ' && c <= '~') || c == '\n' || c == '\t'; }

}  // namespace

bool is_printable(std::string_view text) noexcept {
  for (std::size_t at = 0; at < text.size();) {
    const auto character = character_at(text, at);
    if (character.length == 0 || !harmless(character.point)) return false;
    at += character.length;
  }
  return true;
}

std::string printable(std::string_view text) {
  if (std::ranges::all_of(text, plain)) return std::string(text);
  std::string out;
  out.reserve(text.size());
  for (std::size_t at = 0; at < text.size();) {
    const auto character = character_at(text, at);
    if (character.length == 0) {
      fmt::format_to(std::back_inserter(out), "\\x{:02x}", static_cast<unsigned char>(text[at]));
    } else if (!harmless(character.point)) {
      fmt::format_to(std::back_inserter(out), "\\u{:04x}", character.point);
    } else {
      out += text.substr(at, character.length);
    }
    at += std::max<std::size_t>(character.length, 1);
  }
  return out;
}

std::string one_line(std::string_view text) {
  std::string line = printable(text);
  constexpr std::string_view shown = "\\u000a";
  for (auto at = line.find('\n'); at != std::string::npos; at = line.find('\n', at + shown.size()))
    line.replace(at, 1, shown);
  return line;
}

}  // namespace berth::text

#include "berth/od/notation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "berth/base/words.hpp"

namespace berth::od {
namespace {

std::optional<unsigned> digits(std::string_view word, int base, std::size_t most) {
  unsigned value = 0;
  if (word.empty() || word.size() > most) return std::nullopt;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value, base);
  if (error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

bool starts_with_0x(std::string_view word) noexcept { return word.starts_with("0x") || word.starts_with("0X"); }
bool ends_with_h(std::string_view word) noexcept { return word.ends_with('h') || word.ends_with('H'); }

// A hexadecimal number, and whether it is marked as one.
struct Hex {
  std::optional<unsigned> value;
  bool marked = false;
};

Hex hex(std::string_view word, std::size_t most) {
  const bool marked = starts_with_0x(word) || ends_with_h(word);
  if (starts_with_0x(word)) {
    word.remove_prefix(2);
  } else if (ends_with_h(word)) {
    word.remove_suffix(1);
  }
  return {digits(word, 16, most), marked};
}

/// The parts of "1018h:04".
struct Parts {
  std::string_view index;
  std::optional<std::string_view> sub;
  bool as_section = false;  // "1018sub4", as an EDS calls its sections: always hexadecimal
};

Parts split(std::string_view word) {
  if (const auto at = word.find_first_of(":/"); at != std::string_view::npos) {
    return {word.substr(0, at), word.substr(at + 1), false};
  }
  constexpr std::string_view sub = "sub";
  const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  const auto found = std::ranges::search(word, sub, {}, lower);
  if (found.empty()) return {word, std::nullopt, false};
  const auto at = static_cast<std::size_t>(found.begin() - word.begin());
  return {word.substr(0, at), word.substr(at + sub.size()), true};
}

std::string written(unsigned index, const std::optional<unsigned>& sub) {
  return sub ? fmt::format("{:04X}h:{:02X}", index, *sub) : fmt::format("{:04X}h", index);
}

NoObject both_readings(std::string_view word, const Parts& parts, const std::optional<unsigned>& sub) {
  const auto as_hex = digits(parts.index, 16, 4);
  const auto as_decimal = digits(parts.index, 10, 5);
  const bool decimal = as_decimal && *as_decimal <= 0xFFFF;
  if (as_hex && decimal) {
    return {NoObject::Kind::bare, fmt::format("{} is {} or, read as a decimal number, {}: write the one that is meant",
                                              berth::quoted(word), written(*as_hex, sub), written(*as_decimal, sub))};
  }
  if (as_hex)
    return {NoObject::Kind::unmarked,
            fmt::format("{} is not an object: write {}", berth::quoted(word), written(*as_hex, sub))};
  return {NoObject::Kind::bare,
          fmt::format("{} is not an object: an index has up to four hexadecimal digits, such as 1018h",
                      berth::quoted(word))};
}

}  // namespace

tl::expected<ObjectWord, NoObject> read_object(std::string_view word) {
  const Parts parts = split(word);
  const Hex index = hex(parts.index, 4);
  const Hex sub = parts.sub ? hex(*parts.sub, 2) : Hex{};
  const bool good_sub = !parts.sub || sub.value;
  if (index.value && good_sub && (index.marked || parts.as_section)) {
    const auto number = static_cast<std::uint16_t>(*index.value);
    if (!parts.sub) return ObjectWord{number, std::nullopt};
    return ObjectWord{number, static_cast<std::uint8_t>(*sub.value)};
  }
  const bool digits_only =
      !parts.index.empty() && std::ranges::all_of(parts.index, [](char c) { return c >= '0' && c <= '9'; });
  if (good_sub && !index.marked && (index.value || digits_only)) {
    return tl::unexpected(both_readings(word, parts, sub.value));
  }
  return tl::unexpected(
      NoObject{NoObject::Kind::other,
               fmt::format("{} is not an object: write index and sub-index such as 1018h:04", berth::quoted(word))});
}

std::optional<ObjectRef> parse_object(std::string_view word) {
  const auto object = read_object(word);
  return object ? std::optional(object->ref()) : std::nullopt;
}

tl::expected<std::uint8_t, std::string> read_sub_index(std::string_view word) {
  const Hex sub = hex(word, 2);
  if (sub.value && (sub.marked || *sub.value < 10)) return static_cast<std::uint8_t>(*sub.value);
  const auto decimal = digits(word, 10, 3);
  if (sub.value && decimal) {
    return tl::unexpected(
        fmt::format("sub-index {} is {:02X}h or, read as a decimal number, {:02X}h: write the one that "
                    "is meant",
                    berth::quoted(word), *sub.value, *decimal));
  }
  if (sub.value) return tl::unexpected(fmt::format("sub-index {}: write {:02X}h", berth::quoted(word), *sub.value));
  return tl::unexpected(fmt::format("{} is not a sub-index; write 00h to FFh", berth::quoted(word)));
}

std::string write_object(ObjectRef object) { return fmt::format("{:04X}h:{:02X}", object.index, object.sub); }

}  // namespace berth::od

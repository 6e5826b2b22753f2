#include "berth/command/meanings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "berth/base/words.hpp"
#include "berth/od/mapping_text.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

constexpr std::size_t most_digits = 18;

/// `digits` times 10 to the power of `exponent`.
struct Decimal {
  bool negative = false;
  std::uint64_t digits = 0;
  int exponent = 0;
};

// Parses "23.5" or "-7"; empty for anything else.
std::optional<Decimal> decimal(std::string_view text) {
  Decimal made;
  if (text.starts_with('-') || text.starts_with('+')) {
    made.negative = text.front() == '-';
    text.remove_prefix(1);
  }
  bool behind_point = false;
  std::size_t count = 0;
  for (const char c : text) {
    if (c == '.' && !behind_point && count > 0) {
      behind_point = true;
      continue;
    }
    if (c < '0' || c > '9' || ++count > most_digits) return std::nullopt;
    made.digits = made.digits * 10 + static_cast<unsigned>(c - '0');
    if (behind_point) --made.exponent;
  }
  if (count == 0 || text.back() == '.') return std::nullopt;
  return made;
}

std::string written(const Decimal& value) {
  std::string text = fmt::format("{}", value.digits);
  if (value.exponent > 0 && value.digits != 0) text.append(static_cast<std::size_t>(value.exponent), '0');
  if (value.exponent < 0) {
    const auto behind = static_cast<std::size_t>(-value.exponent);
    if (text.size() <= behind) text.insert(0, behind + 1 - text.size(), '0');
    text.insert(text.size() - behind, ".");
  }
  return (value.negative ? "-" : "") + text;
}

double scale_of(const od::Meaning& meaning) {
  return static_cast<double>(meaning.number) * std::pow(10.0, meaning.exponent);
}

/// A number and the text after it.
struct Quantity {
  std::string_view number;
  std::string_view unit;
};

Quantity split(std::string_view text) {
  const auto end = text.find_first_not_of("0123456789.", text.starts_with('-') || text.starts_with('+') ? 1 : 0);
  if (end == std::string_view::npos) return {text, {}};
  Quantity parts{text.substr(0, end), text.substr(end)};
  while (parts.unit.starts_with(' ')) parts.unit.remove_prefix(1);
  return parts;
}

// A whole number of counts. A value between two counts is refused, not rounded.
std::optional<std::uint64_t> counts_of(const od::Meaning& meaning, const Decimal& value) {
  std::uint64_t digits = value.digits;
  for (int e = value.exponent - meaning.exponent; e != 0 && digits != 0; e += e < 0 ? 1 : -1) {
    if (e > 0 && __builtin_mul_overflow(digits, std::uint64_t{10}, &digits)) return std::nullopt;
    if (e < 0 && digits % 10 != 0) return std::nullopt;
    if (e < 0) digits /= 10;
  }
  const auto number = static_cast<std::uint64_t>(meaning.number);
  return digits % number == 0 ? std::optional(digits / number) : std::nullopt;
}

Checked<std::uint64_t> raw_of_quantity(const KnownObject& object, const Quantity& parts, const std::string& text,
                                       NodeId node) {
  const od::Meaning& meaning = *object.meaning;
  const auto value = decimal(parts.number);
  if (!value) return tl::unexpected(fmt::format("value {} is not a number of {}", text::quoted(text), meaning.unit));
  if (od::is_real(object.type)) {
    const double counts = std::stod(std::string(parts.number)) / scale_of(meaning);
    const auto parsed = od::parse(object.type, fmt::format("{}", counts));
    if (parsed && parsed->value.present()) return parsed->value.resolve(object.type, node.value());
    return tl::unexpected(fmt::format("value {} does not fit {}", text::quoted(text), od::name(object.type)));
  }
  const auto counts = counts_of(meaning, *value);
  if (!counts) {
    return tl::unexpected(fmt::format("value {} is not a multiple of {}, the unit of {}", text::quoted(text),
                                      one_count(meaning), od::write_object(object.ref)));
  }
  const bool fits = value->negative ? od::is_signed(object.type) && *counts <= (1ULL << 63U)
                                    : !od::is_signed(object.type) || *counts < (1ULL << 63U);
  if (fits || *counts == 0) return value->negative ? 0 - *counts : *counts;
  return tl::unexpected(fmt::format("value {} does not fit {}", text::quoted(text), od::name(object.type)));
}

std::string number_text(const KnownObject& object, std::uint64_t raw) {
  std::vector<std::uint8_t> bytes(od::byte_size(object.type));
  od::store(object.type, raw, bytes.data());
  return od::print(object.type, bytes);
}

std::string candidates(const KnownObject& object, const std::vector<const od::NamedValue*>& values) {
  std::vector<std::string> shown;
  for (const auto* const value : values) {
    const std::string number = number_text(object, value->raw);
    shown.push_back(value->name.empty() ? number : fmt::format("{} ({})", text::quoted(value->name), number));
  }
  return some_of(shown, 12);
}

std::vector<const od::NamedValue*> all_of(const od::Meaning& meaning) {
  std::vector<const od::NamedValue*> all;
  for (const auto& value : meaning.values) all.push_back(&value);
  return all;
}

// Matches like names of objects: the exact name; else the same name in any case; else all names with this beginning.
std::vector<const od::NamedValue*> named(const od::Meaning& meaning, std::string_view word) {
  std::vector<const od::NamedValue*> exact;
  std::vector<const od::NamedValue*> same;
  std::vector<const od::NamedValue*> begins;
  for (const auto& value : meaning.values) {
    if (word.empty() || value.name.empty()) continue;
    if (value.name == word) exact.push_back(&value);
    if (same_word(value.name, word)) same.push_back(&value);
    if (same_word(std::string_view(value.name).substr(0, word.size()), word)) begins.push_back(&value);
  }
  return !exact.empty() ? exact : !same.empty() ? same : begins;
}

// Refuses a name such as "9600" that is also the number of another value.
Checked<std::uint64_t> number_or_name(const KnownObject& object, const od::NamedValue& named, const std::string& text) {
  const auto parsed = od::parse(object.type, text);
  const bool other = parsed && parsed->value.present() && parsed->value.raw != named.raw;
  if (!other) return named.raw;
  return tl::unexpected(fmt::format("value {} is a number and the name of {}: write {}, or 0x{:X} for the number",
                                    text::quoted(text), number_text(object, named.raw), number_text(object, named.raw),
                                    parsed->value.raw));
}

bool like_a_number(const std::string& text) {
  const std::size_t first = text.starts_with('-') || text.starts_with('+') ? 1 : 0;
  return text.size() > first && text[first] >= '0' && text[first] <= '9';
}

}  // namespace

std::string one_count(const od::Meaning& meaning) {
  if (meaning.number == 1 && meaning.exponent == 0) return meaning.unit;
  return written({false, static_cast<std::uint64_t>(meaning.number), meaning.exponent}) + " " + meaning.unit;
}

std::string quantity_text(const KnownObject& object, std::span<const std::uint8_t> bytes) {
  const bool known = object.meaning != nullptr && object.type_is_described() && !object.meaning->unit.empty();
  if (!known || bytes.size() != od::byte_size(object.type)) return {};
  const od::Meaning& meaning = *object.meaning;
  const std::uint64_t raw = od::load(object.type, bytes.data());
  if (od::is_real(object.type)) {
    const bool plain = meaning.number == 1 && meaning.exponent == 0;
    const std::string text = od::print(object.type, bytes);
    if (plain || text.starts_with("0x")) return text + " " + meaning.unit;
    return fmt::format("{} {}", std::stod(text) * scale_of(meaning), meaning.unit);
  }
  if (!od::is_integer(object.type)) return {};
  Decimal value{od::is_signed(object.type) && static_cast<std::int64_t>(raw) < 0, raw, meaning.exponent};
  if (value.negative) value.digits = 0 - raw;
  if (__builtin_mul_overflow(value.digits, static_cast<std::uint64_t>(meaning.number), &value.digits)) return {};
  return written(value) + " " + meaning.unit;
}

std::string value_name(const KnownObject& object, std::span<const std::uint8_t> bytes) {
  if (auto mapped = od::mapping_text(object.ref, bytes); !mapped.empty()) return mapped;
  const bool known = object.meaning != nullptr && object.type_is_described();
  if (!known || bytes.size() != od::byte_size(object.type)) return {};
  const auto raw = od::load(object.type, bytes.data());
  const auto found = std::ranges::find(object.meaning->values, raw, &od::NamedValue::raw);
  return found == object.meaning->values.end() ? std::string() : found->name;
}

std::optional<Checked<std::uint64_t>> raw_meant(const KnownObject& object, const std::string& text, NodeId node) {
  using Answer = Checked<std::uint64_t>;
  const od::Meaning& meaning = *object.meaning;
  const auto found = named(meaning, text);
  const bool number = like_a_number(text);
  if (found.size() == 1 && (!number || found.front()->name == text)) {
    if (!number) return Answer(found.front()->raw);
    return number_or_name(object, *found.front(), text);
  }
  if (found.size() > 1 && !number) {
    return Answer(tl::unexpected(fmt::format("value {} can be {}", text::quoted(text), candidates(object, found))));
  }
  const Quantity parts = split(text);
  if (number && !parts.unit.empty() && !meaning.unit.empty()) {
    if (same_word(parts.unit, meaning.unit)) return raw_of_quantity(object, parts, text, node);
    if (od::parse(object.type, text)) return std::nullopt;  // a number with letters, such as "0x1F" or "1e3"
    return Answer(tl::unexpected(fmt::format("value {}: the unit of {} is {}; write that unit, or the number alone",
                                             text::quoted(text), od::write_object(object.ref), one_count(meaning))));
  }
  if (number || text.empty() || text.starts_with('$') || meaning.values.empty()) return std::nullopt;
  return Answer(tl::unexpected(fmt::format("value {} is not a value of {}; its values are: {}", text::quoted(text),
                                           od::write_object(object.ref), candidates(object, all_of(meaning)))));
}

std::string not_allowed(const KnownObject& object, std::uint64_t raw, const std::string& text) {
  if (object.meaning == nullptr || !object.type_is_described() || !object.meaning->only_these) return {};
  const auto& values = object.meaning->values;
  if (std::ranges::find(values, raw, &od::NamedValue::raw) != values.end()) return {};
  return fmt::format("value {} is not allowed for {} by the description; these are: {}; write it with --anyway",
                     text::quoted(text), od::write_object(object.ref), candidates(object, all_of(*object.meaning)));
}

}  // namespace berth::command

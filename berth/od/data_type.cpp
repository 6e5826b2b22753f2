#include "berth/od/data_type.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <system_error>

namespace berth::od {
namespace {

struct TypeName {
  DataType type;
  std::string_view name;
  std::string_view brief;  ///< CiA 309-3
};
constexpr std::array names{
    TypeName{DataType::boolean, "BOOLEAN", "b"},
    TypeName{DataType::integer8, "INTEGER8", "i8"},
    TypeName{DataType::integer16, "INTEGER16", "i16"},
    TypeName{DataType::integer32, "INTEGER32", "i32"},
    TypeName{DataType::unsigned8, "UNSIGNED8", "u8"},
    TypeName{DataType::unsigned16, "UNSIGNED16", "u16"},
    TypeName{DataType::unsigned32, "UNSIGNED32", "u32"},
    TypeName{DataType::real32, "REAL32", "r32"},
    TypeName{DataType::visible_string, "VISIBLE_STRING", "vs"},
    TypeName{DataType::octet_string, "OCTET_STRING", "os"},
    TypeName{DataType::unicode_string, "UNICODE_STRING", "us"},
    TypeName{DataType::time_of_day, "TIME_OF_DAY", "t"},
    TypeName{DataType::time_difference, "TIME_DIFFERENCE", "td"},
    TypeName{DataType::domain, "DOMAIN", "d"},
    TypeName{DataType::integer24, "INTEGER24", "i24"},
    TypeName{DataType::real64, "REAL64", "r64"},
    TypeName{DataType::integer40, "INTEGER40", "i40"},
    TypeName{DataType::integer48, "INTEGER48", "i48"},
    TypeName{DataType::integer56, "INTEGER56", "i56"},
    TypeName{DataType::integer64, "INTEGER64", "i64"},
    TypeName{DataType::unsigned24, "UNSIGNED24", "u24"},
    TypeName{DataType::unsigned40, "UNSIGNED40", "u40"},
    TypeName{DataType::unsigned48, "UNSIGNED48", "u48"},
    TypeName{DataType::unsigned56, "UNSIGNED56", "u56"},
    TypeName{DataType::unsigned64, "UNSIGNED64", "u64"},
};
constexpr auto types = [] {
  std::array<DataType, names.size()> list{};
  for (std::size_t i = 0; i < names.size(); ++i) list[i] = names[i].type;
  return list;
}();

constexpr char lower(char c) noexcept { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + ('a' - 'A')) : c; }

bool same(std::string_view a, std::string_view b) noexcept {
  return std::ranges::equal(a, b, [](char x, char y) { return lower(x) == lower(y); });
}

constexpr bool blank(char c) noexcept { return c == ' ' || c == '\t'; }

constexpr int digit(char c) noexcept {
  if (c >= '0' && c <= '9') return c - '0';
  const char small = lower(c);
  return small >= 'a' && small <= 'f' ? small - 'a' + 10 : -1;
}

constexpr std::uint64_t mask(unsigned bits) noexcept { return bits >= 64 ? ~0ULL : (1ULL << bits) - 1; }

tl::unexpected<TextError> wrong(const char* what, std::size_t at) noexcept {
  return tl::unexpected<TextError>(TextError{what, at});
}

constexpr std::string_view node_id_word = "$NODEID";

/// A cursor over one value's text.
struct Cursor {
  std::string_view text;
  std::size_t at = 0;

  [[nodiscard]] bool end() const noexcept { return at >= text.size(); }
  [[nodiscard]] char peek() const noexcept { return end() ? '\0' : text[at]; }
  void skip_blanks() noexcept {
    while (!end() && blank(text[at])) ++at;
  }
  bool take(char c) noexcept {
    if (peek() != c) return false;
    ++at;
    return true;
  }
  bool take_node_id() noexcept {
    if (!same(text.substr(at, node_id_word.size()), node_id_word)) return false;
    at += node_id_word.size();
    return true;
  }
};

/// Digits with their prefix, no sign.
tl::expected<std::uint64_t, TextError> magnitude(Cursor& in, Number& number) noexcept {
  unsigned base = 10;
  if (in.peek() == '0' && in.at + 1 < in.text.size()) {
    const char next = in.text[in.at + 1];
    if (lower(next) == 'x') {
      base = 16;
      number.hex = true;
      in.at += 2;
    } else if (digit(next) >= 0 && digit(next) <= 9) {
      base = 8;
      ++in.at;
    }
  }
  const std::size_t first = in.at;
  std::uint64_t value = 0;
  for (; !in.end(); ++in.at) {
    const int d = digit(in.peek());
    if (d < 0 || static_cast<unsigned>(d) >= base) break;
    if (value > (~0ULL - static_cast<unsigned>(d)) / base) return wrong("a number of more than 64 bits", first);
    value = value * base + static_cast<unsigned>(d);
  }
  if (in.at == first) return wrong(in.end() ? "a number without digits" : "not a digit", in.at);
  if (base == 8 && value != 0) number.notes.set(Note::octal);
  return value;
}

bool ends_number(const Cursor& in) noexcept { return in.end() || blank(in.peek()) || in.peek() == '+'; }

tl::expected<void, TextError> signed_part(Cursor& in, Number& number) noexcept {
  if (in.take('-')) {
    number.negative = true;
  } else {
    in.take('+');
  }
  const auto value = magnitude(in, number);
  if (!value) return tl::unexpected<TextError>(value.error());
  if (!ends_number(in)) return wrong("not a digit", in.at);
  number.magnitude = *value;
  return {};
}

/// The raw value of a number, or why the type cannot hold it.
tl::expected<std::uint64_t, TextError> fit(DataType type, const Number& number, Notes& notes) noexcept {
  const unsigned bits = bit_length(type);
  const std::uint64_t half = 1ULL << (bits - 1);
  if (type == DataType::boolean && (number.negative || number.magnitude > 1)) {
    return wrong("a BOOLEAN is 0 or 1", 0);
  }
  if (number.negative && number.magnitude > half) return wrong("too low for the data type", 0);
  if (!number.negative && number.magnitude > mask(bits)) return wrong("too high for the data type", 0);
  const bool by_width =
      is_signed(type) ? !number.negative && number.magnitude >= half : number.negative && number.magnitude != 0;
  // Files write the lowest INTEGER32 as 0x80000000; a decimal number beyond the range is a mistake.
  if (by_width && !(is_signed(type) && number.hex)) notes.set(Note::wrapped);
  return wrap(type, number.negative ? 0 - number.magnitude : number.magnitude);
}

tl::expected<Parsed, TextError> parse_integer(DataType type, std::string_view text) noexcept {
  const auto number = parse_number(text);
  if (!number) return tl::unexpected<TextError>(number.error());
  Parsed parsed;
  parsed.notes = number->notes;
  if (number->node_id && type == DataType::boolean) return wrong("a BOOLEAN cannot depend on the node-ID", 0);
  const auto raw = fit(type, *number, parsed.notes);
  if (!raw) return tl::unexpected<TextError>(raw.error());
  parsed.value = number->node_id ? Literal::node_id_plus(*raw) : Literal::number(*raw);
  return parsed;
}

tl::expected<double, TextError> decimal_real(DataType type, std::string_view text) noexcept {
  const bool plus = text.front() == '+';
  const char* const end = text.data() + text.size();
  double value = 0;
  const char* const begin = text.data() + (plus ? 1 : 0);
  const auto result = std::from_chars(begin, end, value);
  const auto at = static_cast<std::size_t>(result.ptr - text.data());
  if (result.ec == std::errc::result_out_of_range) return wrong("out of the range of a REAL", 0);
  if (result.ec != std::errc{} || result.ptr != end) return wrong("not a number", at);
  // A REAL32 is read directly: rounding twice can change the last bit.
  if (type == DataType::real32) {
    float single = 0;
    const auto narrow = std::from_chars(begin, end, single);
    if (narrow.ec == std::errc::result_out_of_range) return wrong("out of the range of a REAL32", 0);
    value = static_cast<double>(single);
  }
  return value;
}

tl::expected<Parsed, TextError> parse_real(DataType type, std::string_view text) noexcept {
  Parsed parsed;
  if (text.size() > 1 && text[0] == '0' && lower(text[1]) == 'x') {
    const auto number = parse_number(text);
    if (!number) return tl::unexpected<TextError>(number.error());
    if (number->node_id) return wrong("a REAL cannot depend on the node-ID", 0);
    if (number->magnitude > mask(bit_length(type))) return wrong("too many bits for the data type", 0);
    parsed.notes.set(Note::real_bits);
    parsed.value = Literal::number(number->magnitude);
    return parsed;
  }
  const auto value = decimal_real(type, text);
  if (!value) return tl::unexpected<TextError>(value.error());
  parsed.value = Literal::real(type, *value);
  return parsed;
}

tl::expected<Parsed, TextError> parse_time(DataType type, std::string_view text) noexcept {
  Cursor in{text};
  Number days;
  Number milliseconds;
  const auto first = magnitude(in, days);
  if (!first) return tl::unexpected<TextError>(first.error());
  Parsed parsed;
  if (in.end()) {
    if (*first > mask(48)) return wrong("too high for the data type", 0);
    parsed.notes = days.notes;
    parsed.value = Literal::number(*first);
    return parsed;
  }
  in.skip_blanks();
  const std::size_t second_at = in.at;
  const auto second = magnitude(in, milliseconds);
  if (!second) return tl::unexpected<TextError>(second.error());
  if (!in.end()) return wrong("text after \"days milliseconds\"", in.at);
  if (*first > mask(16)) return wrong("more days than 16 bits hold", 0);
  if (*second > mask(32)) return wrong("more milliseconds than 32 bits hold", second_at);
  parsed.notes.bits = static_cast<std::uint8_t>(days.notes.bits | milliseconds.notes.bits);
  parsed.value = Literal::number(wrap(type, (*first << 32U) | *second));
  return parsed;
}

/// Reads hex digits in pairs, with or without blanks between bytes; empty if the text is something else.
std::optional<std::vector<std::uint8_t>> hex_bytes(std::string_view text) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(text.size() / 2);
  for (std::size_t i = 0; i < text.size();) {
    if (blank(text[i])) {
      ++i;
      continue;
    }
    const int high = digit(text[i]);
    const int low = i + 1 < text.size() ? digit(text[i + 1]) : -1;
    if (high < 0 || low < 0) return std::nullopt;
    bytes.push_back(static_cast<std::uint8_t>(high * 16 + low));
    i += 2;
  }
  return bytes;
}

void push_utf16(std::vector<std::uint8_t>& out, std::uint32_t unit) {
  out.push_back(static_cast<std::uint8_t>(unit));
  out.push_back(static_cast<std::uint8_t>(unit >> 8U));
}

/// UTF-8 to UTF-16LE. A byte that is not UTF-8 counts as Latin-1, so that nothing is lost or refused.
std::vector<std::uint8_t> utf16_of(std::string_view text) {
  std::vector<std::uint8_t> out;
  out.reserve(text.size() * 2);
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<std::uint8_t>(text[i]);
    const unsigned more = lead >= 0xF0 && lead < 0xF8 ? 3U : lead >= 0xE0 ? 2U : lead >= 0xC2 ? 1U : 0U;
    std::uint32_t point = lead;
    bool valid = more != 0 && lead < 0xF8 && i + more < text.size();
    if (valid) {
      point = lead & (0x3FU >> more);
      for (unsigned k = 1; k <= more; ++k) {
        const auto next = static_cast<std::uint8_t>(text[i + k]);
        valid = valid && (next & 0xC0U) == 0x80;
        point = (point << 6U) | (next & 0x3FU);
      }
      valid = valid && point <= 0x10FFFF;
    }
    if (!valid) point = lead;
    if (point >= 0x10000) {
      push_utf16(out, 0xD800 + ((point - 0x10000) >> 10U));
      push_utf16(out, 0xDC00 + ((point - 0x10000) & 0x3FFU));
    } else {
      push_utf16(out, point);
    }
    i += valid ? more + 1 : 1;
  }
  return out;
}

Parsed parse_unicode(std::string_view text) {
  Parsed parsed;
  auto bytes =
      text.size() % 4 == 0 && text.find_first_of(" \t") == std::string_view::npos ? hex_bytes(text) : std::nullopt;
  if (!bytes) {
    parsed.notes.set(Note::plain_text);
    parsed.value = Literal{Literal::Kind::bytes, 0, utf16_of(text)};
    return parsed;
  }
  for (std::size_t i = 0; i + 1 < bytes->size(); i += 2) std::swap((*bytes)[i], (*bytes)[i + 1]);
  parsed.value = Literal{Literal::Kind::bytes, 0, std::move(*bytes)};
  return parsed;
}

Parsed parse_bytes(std::string_view text) {
  Parsed parsed;
  auto bytes = hex_bytes(text);
  if (bytes) {
    parsed.value = Literal{Literal::Kind::bytes, 0, std::move(*bytes)};
  } else {
    parsed.notes.set(Note::plain_text);
    parsed.value = Literal::text(text);
  }
  return parsed;
}

std::string hex_text(std::span<const std::uint8_t> bytes) {
  constexpr std::string_view digits = "0123456789ABCDEF";
  std::string out;
  out.reserve(bytes.size() * 2);
  for (const std::uint8_t byte : bytes) {
    out.push_back(digits[byte >> 4U]);
    out.push_back(digits[byte & 15U]);
  }
  return out;
}

std::string real_text(DataType type, std::uint64_t raw) {
  const double value = real_of(type, raw);
  if (!std::isfinite(value)) return fmt::format("0x{:0{}X}", raw, byte_size(type) * 2);
  return type == DataType::real32 ? fmt::format("{}", static_cast<float>(value)) : fmt::format("{}", value);
}

}  // namespace

std::string_view name(DataType type) noexcept {
  const auto* found = std::ranges::find(names, type, &TypeName::type);
  return found == names.end() ? std::string_view{} : found->name;
}

std::optional<DataType> data_type(std::string_view wanted) noexcept {
  for (const auto& each : names) {
    if (same(wanted, each.name) || same(wanted, each.brief)) return each.type;
  }
  return std::nullopt;
}

bool known(DataType type) noexcept {
  const auto value = static_cast<unsigned>(type);
  return value >= 1 && value <= 0x1B && value != 0x0E && value != 0x17;
}

std::span<const DataType> all_data_types() noexcept { return types; }

std::uint64_t load(DataType type, const std::uint8_t* from) noexcept {
  std::uint64_t raw = 0;
  const std::size_t size = byte_size(type);
  for (std::size_t i = 0; i < size; ++i) raw |= static_cast<std::uint64_t>(from[i]) << (8 * i);
  return is_signed(type) ? wrap(type, raw) : raw;
}

void store(DataType type, std::uint64_t raw, std::uint8_t* to) noexcept {
  const std::size_t size = byte_size(type);
  for (std::size_t i = 0; i < size; ++i) to[i] = static_cast<std::uint8_t>(raw >> (8 * i));
}

std::uint64_t wrap(DataType type, std::uint64_t raw) noexcept {
  const unsigned bits = bit_length(type);
  if (bits == 0 || bits >= 64) return raw;
  const std::uint64_t cut = raw & mask(bits);
  return is_signed(type) && ((cut >> (bits - 1)) & 1U) != 0 ? cut | ~mask(bits) : cut;
}

int compare(DataType type, std::uint64_t a, std::uint64_t b) noexcept {
  const auto order = [](auto x, auto y) { return x < y ? -1 : x > y ? 1 : 0; };
  if (is_real(type)) {
    const double x = real_of(type, a);
    const double y = real_of(type, b);
    return std::isnan(x) || std::isnan(y) ? 2 : order(x, y);
  }
  if (is_signed(type)) return order(static_cast<std::int64_t>(a), static_cast<std::int64_t>(b));
  if (is_time(type)) {
    const auto days = order((a >> 32U) & 0xFFFF, (b >> 32U) & 0xFFFF);
    return days != 0 ? days : order(a & 0x0FFF'FFFF, b & 0x0FFF'FFFF);
  }
  return order(a, b);
}

std::uint64_t raw_of(DataType real, double value) noexcept {
  if (real == DataType::real32) return std::bit_cast<std::uint32_t>(static_cast<float>(value));
  return std::bit_cast<std::uint64_t>(value);
}

double real_of(DataType real, std::uint64_t raw) noexcept {
  if (real == DataType::real32) return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw)));
  return std::bit_cast<double>(raw);
}

std::uint64_t Literal::resolve(DataType type, std::uint8_t node_id) const noexcept {
  if (kind != Kind::node_id_plus) return raw;
  return wrap(type, raw + (node_id <= 127 ? node_id : 0U));
}

Literal Literal::text(std::string_view text) {
  Literal literal{Kind::bytes, 0, {}};
  literal.bytes.assign(text.begin(), text.end());
  return literal;
}

Literal Literal::octets(std::span<const std::uint8_t> bytes) {
  return {Kind::bytes, 0, std::vector<std::uint8_t>(bytes.begin(), bytes.end())};
}

tl::expected<Number, TextError> parse_number(std::string_view text) noexcept {
  Number number;
  Cursor in{text};
  in.skip_blanks();
  if (in.end()) return wrong("no number", in.at);
  if (in.peek() == '$') {
    if (!in.take_node_id()) return wrong("not $NODEID", in.at);
    number.node_id = true;
    in.skip_blanks();
    if (in.end()) return number;
    if (in.peek() != '+' && in.peek() != '-') return wrong("after $NODEID only + and a number can follow", in.at);
    const std::size_t sign_at = in.at;
    if (in.take('+')) {
      in.skip_blanks();
    } else {
      ++in.at;
      in.skip_blanks();
      number.negative = true;
    }
    if (in.end()) return wrong("a sign without a number", sign_at);
    const auto value = magnitude(in, number);
    if (!value) return tl::unexpected<TextError>(value.error());
    number.magnitude = *value;
  } else {
    const auto read = signed_part(in, number);
    if (!read) return tl::unexpected<TextError>(read.error());
    in.skip_blanks();
    if (in.take('+')) {
      in.skip_blanks();
      if (!in.take_node_id()) return wrong("only $NODEID can be added to a number", in.at);
      number.node_id = true;
      number.notes.set(Note::node_id_last);
    }
  }
  in.skip_blanks();
  if (!in.end()) return wrong("not a digit", in.at);
  return number;
}

tl::expected<Parsed, TextError> parse(DataType type, std::string_view text) {
  if (text.empty()) return Parsed{};
  if (is_integer(type)) return parse_integer(type, text);
  if (is_real(type)) return parse_real(type, text);
  if (is_time(type)) return parse_time(type, text);
  if (type == DataType::visible_string) return Parsed{Literal::text(text), {}};
  if (type == DataType::unicode_string) return parse_unicode(text);
  return parse_bytes(text);
}

std::string print(DataType type, std::span<const std::uint8_t> bytes) {
  if (type == DataType::visible_string) return {bytes.begin(), bytes.end()};
  if (type == DataType::unicode_string && bytes.size() % 2 == 0) {
    std::vector<std::uint8_t> swapped(bytes.begin(), bytes.end());
    for (std::size_t i = 0; i + 1 < swapped.size(); i += 2) std::swap(swapped[i], swapped[i + 1]);
    return hex_text(swapped);
  }
  if (byte_size(type) == 0 || bytes.size() != byte_size(type)) return hex_text(bytes);
  const std::uint64_t raw = load(type, bytes.data());
  if (is_real(type)) return real_text(type, raw);
  if (is_time(type)) return fmt::format("{} {}", raw >> 32U, raw & 0xFFFF'FFFF);
  if (is_signed(type)) return fmt::format("{}", static_cast<std::int64_t>(raw));
  return fmt::format("{}", raw);
}

}  // namespace berth::od

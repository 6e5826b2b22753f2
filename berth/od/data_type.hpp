/// The data types of CiA 301 (§7.4.7; indices of the static data types): their size, their bytes on the wire, and
/// their text in device descriptions (CiA 306) and on a command line.
///
/// This file handles scalars (BOOLEAN, integers, reals, TIME_*) as one 64-bit word, called *raw*: unsigned: the value;
/// signed: the value sign-extended to 64 bits; REAL32/REAL64: the IEEE bits; TIME_OF_DAY and TIME_DIFFERENCE: bits
/// 0..31 milliseconds (0..27 used), bits 32..47 days. Bytes are always little-endian.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

namespace berth::od {

enum class DataType : std::uint16_t {
  none = 0x00,
  boolean = 0x01,
  integer8 = 0x02,
  integer16 = 0x03,
  integer32 = 0x04,
  unsigned8 = 0x05,
  unsigned16 = 0x06,
  unsigned32 = 0x07,
  real32 = 0x08,
  visible_string = 0x09,
  octet_string = 0x0A,
  unicode_string = 0x0B,
  time_of_day = 0x0C,
  time_difference = 0x0D,
  domain = 0x0F,
  integer24 = 0x10,
  real64 = 0x11,
  integer40 = 0x12,
  integer48 = 0x13,
  integer56 = 0x14,
  integer64 = 0x15,
  unsigned24 = 0x16,
  unsigned40 = 0x18,
  unsigned48 = 0x19,
  unsigned56 = 0x1A,
  unsigned64 = 0x1B,
  pdo_communication = 0x20,  ///< record types 20h..23h: the type of a whole object, never of a value
  pdo_mapping = 0x21,
  sdo_parameter = 0x22,
  identity = 0x23,
};

/// How many bits a value has: BOOLEAN 1, UNSIGNED24 24, ...; 0 for strings, DOMAIN and types unknown here.
[[nodiscard]] constexpr unsigned bit_length(DataType type) noexcept {
  switch (type) {
    case DataType::boolean: return 1;
    case DataType::integer8:
    case DataType::unsigned8: return 8;
    case DataType::integer16:
    case DataType::unsigned16: return 16;
    case DataType::integer24:
    case DataType::unsigned24: return 24;
    case DataType::integer32:
    case DataType::unsigned32:
    case DataType::real32: return 32;
    case DataType::integer40:
    case DataType::unsigned40: return 40;
    case DataType::integer48:
    case DataType::unsigned48:
    case DataType::time_of_day:
    case DataType::time_difference: return 48;
    case DataType::integer56:
    case DataType::unsigned56: return 56;
    case DataType::integer64:
    case DataType::unsigned64:
    case DataType::real64: return 64;
    default: return 0;
  }
}
/// Bytes in an SDO or in memory: BOOLEAN 1; 0 = of variable length (strings, DOMAIN, unknown types).
[[nodiscard]] constexpr std::size_t byte_size(DataType type) noexcept { return (bit_length(type) + 7) / 8; }

[[nodiscard]] constexpr bool is_signed(DataType type) noexcept {
  switch (type) {
    case DataType::integer8:
    case DataType::integer16:
    case DataType::integer24:
    case DataType::integer32:
    case DataType::integer40:
    case DataType::integer48:
    case DataType::integer56:
    case DataType::integer64: return true;
    default: return false;
  }
}
[[nodiscard]] constexpr bool is_real(DataType type) noexcept {
  return type == DataType::real32 || type == DataType::real64;
}
[[nodiscard]] constexpr bool is_time(DataType type) noexcept {
  return type == DataType::time_of_day || type == DataType::time_difference;
}
/// UNSIGNED8..64 and BOOLEAN.
[[nodiscard]] constexpr bool is_unsigned(DataType type) noexcept {
  return bit_length(type) != 0 && !is_signed(type) && !is_real(type) && !is_time(type);
}
/// BOOLEAN and all integers: the types that allow `$NODEID`.
[[nodiscard]] constexpr bool is_integer(DataType type) noexcept { return is_signed(type) || is_unsigned(type); }

/// "UNSIGNED32"; empty for types without a name, such as 0040h.
[[nodiscard]] std::string_view name(DataType type) noexcept;
/// The type of a CiA 301 name ("UNSIGNED32", also lower case) or a short one (u8 i16 f32 bool str, as CiA 309-3 uses:
/// b i8 i16 i24 i32 i40 i48 i56 i64 u8 ... u64 r32 r64 t td vs os us d).
[[nodiscard]] std::optional<DataType> data_type(std::string_view name) noexcept;
/// True for a type whose values this library can encode: scalars, strings, DOMAIN.
[[nodiscard]] bool known(DataType type) noexcept;
/// All known types, ascending.
[[nodiscard]] std::span<const DataType> all_data_types() noexcept;

/// Reads `byte_size(type)` bytes at `from`; `type` must be a scalar.
[[nodiscard]] std::uint64_t load(DataType type, const std::uint8_t* from) noexcept;
/// Writes `byte_size(type)` bytes at `to`; bits of `raw` beyond the width are dropped.
void store(DataType type, std::uint64_t raw, std::uint8_t* to) noexcept;
/// -1, 0 or 1: `a` and `b` compared as values of the type; 2 when one of them is NaN.
[[nodiscard]] int compare(DataType type, std::uint64_t a, std::uint64_t b) noexcept;
/// `raw` cut to the type's width and extended again (as `store` then `load` do).
[[nodiscard]] std::uint64_t wrap(DataType type, std::uint64_t raw) noexcept;
[[nodiscard]] std::uint64_t raw_of(DataType real, double value) noexcept;  ///< REAL32 rounds
[[nodiscard]] double real_of(DataType real, std::uint64_t raw) noexcept;

/// A value in a description: none, a scalar's raw, node-ID plus an offset, or bytes.
struct Literal {
  enum class Kind : std::uint8_t { none, number, node_id_plus, bytes };
  Kind kind = Kind::none;
  std::uint64_t raw = 0;            ///< number: the raw; node_id_plus: the offset
  std::vector<std::uint8_t> bytes;  ///< strings and DOMAIN, as in an SDO

  [[nodiscard]] bool present() const noexcept { return kind != Kind::none; }
  /// The raw for a node-ID. An unconfigured node-ID counts as 0, so that the result is never another node's COB-ID.
  [[nodiscard]] std::uint64_t resolve(DataType type, std::uint8_t node_id) const noexcept;
  [[nodiscard]] static Literal number(std::uint64_t raw) { return {Kind::number, raw, {}}; }
  [[nodiscard]] static Literal real(DataType type, double value) { return {Kind::number, raw_of(type, value), {}}; }
  [[nodiscard]] static Literal node_id_plus(std::uint64_t offset) { return {Kind::node_id_plus, offset, {}}; }
  [[nodiscard]] static Literal text(std::string_view text);
  [[nodiscard]] static Literal octets(std::span<const std::uint8_t> bytes);
  friend bool operator==(const Literal&, const Literal&) = default;
};

/// Oddities in a text that was understood nevertheless (a set).
enum class Note : std::uint8_t {
  octal = 1,         ///< leading 0: read as octal, as CiA 306 and C do
  node_id_last = 2,  ///< `0x180+$NODEID`: CiA 306 requires `$NODEID` first
  wrapped = 4,       ///< -1 for an unsigned type, 0xFFFFFFFF for INTEGER32: cut to the type's width
  plain_text = 8,    ///< UNICODE_STRING, OCTET_STRING or DOMAIN as text instead of hex digits
  real_bits = 16,    ///< a REAL written as the bits of its number (0x3F800000)
};
struct Notes {
  std::uint8_t bits = 0;
  void set(Note note) noexcept { bits = static_cast<std::uint8_t>(bits | static_cast<std::uint8_t>(note)); }
  [[nodiscard]] bool has(Note note) const noexcept { return (bits & static_cast<std::uint8_t>(note)) != 0; }
};

/// Why a text is not a value: `what` is a static sentence fragment, `at` the offset of the offending character.
struct TextError {
  const char* what = "";
  std::size_t at = 0;
};

/// An integer as written: decimal, 0x hex, leading-0 octal; optional sign; `$NODEID` alone, first or last.
struct Number {
  std::uint64_t magnitude = 0;
  bool negative = false;
  bool node_id = false;
  bool hex = false;
  Notes notes;
};
[[nodiscard]] tl::expected<Number, TextError> parse_number(std::string_view text) noexcept;

struct Parsed {
  Literal value;
  Notes notes;
};
/// Reads a value's text as in device descriptions. Scalars as `parse_number`; REAL: decimal, or 0x + the bits;
/// VISIBLE_STRING: the text itself; OCTET_STRING, DOMAIN: hex bytes (blanks between them allowed); UNICODE_STRING: four
/// hex digits a character; TIME_*: "days milliseconds". Text of a string type that is not hex is taken as plain text
/// (UNICODE_STRING: UTF-8 to UTF-16) with `Note::plain_text`. Empty text is no value (kind none), also for
/// VISIBLE_STRING: a description cannot distinguish "missing" from "empty" (CiA 306 §4.3).
[[nodiscard]] tl::expected<Parsed, TextError> parse(DataType type, std::string_view text);

/// The text from which `parse` reads the same bytes: decimal for integers, REAL in the shortest exact form, NaN and
/// infinities as 0x bits. `bytes` of a scalar must be `byte_size(type)` long; else, and for unknown types, the text is
/// hex. (A description file's trimming loses blanks at the ends of a VISIBLE_STRING and its line breaks.)
[[nodiscard]] std::string print(DataType type, std::span<const std::uint8_t> bytes);

}  // namespace berth::od

#include "berth/client/value.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "berth/base/bytes.hpp"

namespace berth::client {

namespace {

constexpr Complaint unfit_type{.what = "the C++ type does not fit", .code = od::AbortCode::none};
constexpr char32_t replacement = 0xFFFD;

void put_utf8(char32_t c, std::string& into) {
  const auto put = [&](char32_t byte) { into.push_back(static_cast<char>(byte)); };
  if (c < 0x80) return put(c);
  if (c < 0x800) {
    put(0xC0 | c >> 6);
  } else if (c < 0x1'0000) {
    put(0xE0 | c >> 12);
    put(0x80 | (c >> 6 & 0x3F));
  } else {
    put(0xF0 | c >> 18);
    put(0x80 | (c >> 12 & 0x3F));
    put(0x80 | (c >> 6 & 0x3F));
  }
  put(0x80 | (c & 0x3F));
}

bool high_surrogate(char32_t c) noexcept { return c >= 0xD800 && c < 0xDC00; }
bool low_surrogate(char32_t c) noexcept { return c >= 0xDC00 && c < 0xE000; }

std::string utf8_of(std::span<const std::uint8_t> utf16) {
  std::string out;
  const std::size_t units = utf16.size() / 2;
  const auto unit = [&](std::size_t i) -> char32_t { return load_le<std::uint16_t>(utf16.data() + 2 * i); };
  for (std::size_t i = 0; i < units && unit(i) != 0; ++i) {
    char32_t c = unit(i);
    if (high_surrogate(c) && i + 1 < units && low_surrogate(unit(i + 1))) {
      c = 0x1'0000 + ((c - 0xD800) << 10) + (unit(++i) - 0xDC00);
    } else if (high_surrogate(c) || low_surrogate(c)) {
      c = replacement;
    }
    put_utf8(c, out);
  }
  return out;
}

/// Reads the code point at `at` and moves `at` after it. False: this is not UTF-8.
bool take_utf8(std::string_view text, std::size_t& at, char32_t& c) noexcept {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned first = byte(at++);
  const unsigned more = first < 0x80 ? 0 : first >> 5 == 6 ? 1 : first >> 4 == 14 ? 2 : first >> 3 == 30 ? 3 : 4;
  if (more == 4 || at + more > text.size()) return false;
  c = more == 0 ? first : first & (0x3FU >> more);
  for (unsigned i = 0; i < more; ++i, ++at) {
    if (byte(at) >> 6 != 2) return false;
    c = c << 6 | (byte(at) & 0x3FU);
  }
  constexpr char32_t least[] = {0, 0x80, 0x800, 0x1'0000};
  return c >= least[more] && c < 0x11'0000 && !high_surrogate(c) && !low_surrogate(c);
}

bool utf16_of(std::string_view text, Bytes& into) {
  const auto put = [&](char32_t unit) {
    into.push_back(static_cast<std::uint8_t>(unit));
    into.push_back(static_cast<std::uint8_t>(unit >> 8));
  };
  for (std::size_t at = 0; at < text.size();) {
    char32_t c = 0;
    if (!take_utf8(text, at, c)) return false;
    if (c < 0x1'0000) {
      put(c);
    } else {
      put(0xD800 + ((c - 0x1'0000) >> 10));
      put(0xDC00 + ((c - 0x1'0000) & 0x3FF));
    }
  }
  return true;
}

void put_scalar(od::DataType type, std::uint64_t raw, Bytes& into) {
  into.resize(od::byte_size(type));
  od::store(type, raw, into.data());
}

}  // namespace

bool readable_as(od::DataType type, CppType wanted) noexcept {
  const unsigned bits = od::bit_length(type);
  switch (wanted.kind) {
    case Kind::boolean: return type == od::DataType::boolean;
    case Kind::unsigned_integer: return od::is_unsigned(type) && bits <= wanted.bits;
    case Kind::signed_integer:
      return (od::is_signed(type) && bits <= wanted.bits) || (od::is_unsigned(type) && bits < wanted.bits);
    case Kind::real: return od::is_real(type) && bits <= wanted.bits;
    case Kind::text: return type == od::DataType::visible_string || type == od::DataType::unicode_string;
    case Kind::time: return od::is_time(type);
    case Kind::bytes:
    case Kind::any: return true;
  }
  return false;
}

const char* best_cpp_type(od::DataType type) noexcept {
  if (type == od::DataType::boolean) return "bool";
  if (type == od::DataType::real32) return "float";
  if (type == od::DataType::real64) return "double";
  if (type == od::DataType::visible_string || type == od::DataType::unicode_string) return "std::string";
  if (od::is_time(type)) return "co::TimeOfDay";
  const unsigned bits = od::bit_length(type);
  if (bits == 0) return "Bytes";
  constexpr const char* signed_names[] = {"std::int8_t", "std::int16_t", "std::int32_t", "std::int64_t"};
  constexpr const char* unsigned_names[] = {"std::uint8_t", "std::uint16_t", "std::uint32_t", "std::uint64_t"};
  const unsigned at = bits <= 8 ? 0 : bits <= 16 ? 1 : bits <= 32 ? 2 : 3;
  return od::is_signed(type) ? signed_names[at] : unsigned_names[at];
}

od::DataType natural_type(CppType cpp) noexcept {
  using enum od::DataType;
  constexpr od::DataType signed_types[] = {integer8, integer16, integer32, integer64};
  constexpr od::DataType unsigned_types[] = {unsigned8, unsigned16, unsigned32, unsigned64};
  const unsigned at = cpp.bits <= 8 ? 0 : cpp.bits <= 16 ? 1 : cpp.bits <= 32 ? 2 : 3;
  switch (cpp.kind) {
    case Kind::boolean: return boolean;
    case Kind::unsigned_integer: return unsigned_types[at];
    case Kind::signed_integer: return signed_types[at];
    case Kind::real: return cpp.bits == 32 ? real32 : real64;
    case Kind::text: return visible_string;
    case Kind::time: return time_of_day;
    case Kind::bytes:
    case Kind::any: break;
  }
  return domain;
}

bool decode(od::DataType type, std::span<const std::uint8_t> bytes, std::uint64_t& raw) noexcept {
  const std::size_t size = od::byte_size(type);
  if (size == 0 || bytes.size() < size) return false;
  raw = od::load(type, bytes.data());
  if (bytes.size() == size) return true;
  if (bytes.size() != 4) return false;
  const auto word = load_le<std::uint32_t>(bytes.data());
  return word == static_cast<std::uint32_t>(raw) || word >> (8 * size) == 0;
}

std::string decode_text(od::DataType type, std::span<const std::uint8_t> bytes) {
  if (type == od::DataType::unicode_string) return utf8_of(bytes);
  std::string out(bytes.begin(), bytes.end());
  out.resize(std::min(out.size(), out.find('\0')));
  return out;
}

Complaint Input::encode(od::DataType type, Bytes& into) const {
  switch (cpp_.kind) {
    case Kind::boolean:
      if (type != od::DataType::boolean) return unfit_type;
      return encode_integer(type, into);
    case Kind::unsigned_integer:
    case Kind::signed_integer: return encode_integer(type, into);
    case Kind::real: return encode_real(type, into);
    case Kind::text: return encode_text(type, into);
    case Kind::bytes: return encode_bytes(type, into);
    case Kind::any:
      if (type_ != type) return unfit_type;
      return encode_bytes(type, into);
    case Kind::time: {
      if (!od::is_time(type)) return unfit_type;
      const auto bytes = time_.encode();
      into.assign(bytes.begin(), bytes.end());
      return {};
    }
  }
  return unfit_type;
}

Complaint Input::encode_integer(od::DataType type, Bytes& into) const {
  if (!od::is_integer(type)) return unfit_type;
  const std::uint64_t kept = od::wrap(type, number_);
  const bool same_sign = negative_ == (od::is_signed(type) && static_cast<std::int64_t>(kept) < 0);
  if (kept != number_ || !same_sign || (type == od::DataType::boolean && number_ > 1)) {
    return negative_ ? Complaint{"the value is below the range of the object's type", od::AbortCode::value_too_low}
                     : Complaint{"the value is above the range of the object's type", od::AbortCode::value_too_high};
  }
  put_scalar(type, number_, into);
  return {};
}

Complaint Input::encode_real(od::DataType type, Bytes& into) const {
  if (!od::is_real(type)) return unfit_type;
  constexpr double most = std::numeric_limits<float>::max();
  if (type == od::DataType::real32 && std::isfinite(real_) && std::fabs(real_) > most) {
    return real_ < 0 ? Complaint{"the value is below the range of a REAL32", od::AbortCode::value_too_low}
                     : Complaint{"the value is above the range of a REAL32", od::AbortCode::value_too_high};
  }
  put_scalar(type, od::raw_of(type, real_), into);
  return {};
}

Complaint Input::encode_text(od::DataType type, Bytes& into) const {
  if (type == od::DataType::visible_string) {
    into.assign(text_.begin(), text_.end());
    return {};
  }
  if (type != od::DataType::unicode_string) return unfit_type;
  if (!utf16_of(text_, into)) return {"the text is not UTF-8", od::AbortCode::invalid_value};
  return {};
}

Complaint Input::encode_bytes(od::DataType type, Bytes& into) const {
  const std::size_t size = od::byte_size(type);
  if (size != 0 && bytes_.size() < size) return {"too few bytes for the object's type", od::AbortCode::length_too_low};
  if (size != 0 && bytes_.size() > size)
    return {"too many bytes for the object's type", od::AbortCode::length_too_high};
  into.assign(bytes_.begin(), bytes_.end());
  return {};
}

}  // namespace berth::client

// Converts the values of CiA 309-3 between words and bytes.
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <limits>

#include "berth/base/base64.hpp"
#include "berth/serve/cia309.hpp"

namespace berth::serve::cia309 {
namespace {

using Bytes = std::vector<std::uint8_t>;
using od::DataType;

constexpr std::uint64_t longest_milliseconds = 0x0FFF'FFFF;  // 28 bits

std::optional<unsigned> hex_digit(char c) noexcept {
  if (c >= '0' && c <= '9') return static_cast<unsigned>(c - '0');
  if (c >= 'a' && c <= 'f') return static_cast<unsigned>(c - 'a' + 10);
  if (c >= 'A' && c <= 'F') return static_cast<unsigned>(c - 'A' + 10);
  return std::nullopt;
}

Bytes stored(DataType type, std::uint64_t raw) {
  Bytes bytes(od::byte_size(type));
  od::store(type, raw, bytes.data());
  return bytes;
}

std::optional<Bytes> integer(DataType type, std::string_view word) {
  const auto number = od::parse_number(word);
  if (!number || number->node_id) return std::nullopt;
  const unsigned bits = od::bit_length(type);
  const std::uint64_t top = bits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
  const std::uint64_t half = std::uint64_t{1} << (bits - 1);
  const bool is_signed = od::is_signed(type);
  const bool fits = number->negative ? number->magnitude == 0 || (is_signed && number->magnitude <= half)
                                     : number->magnitude <= (is_signed ? half - 1 : top);
  if (!fits) return std::nullopt;
  return stored(type, number->negative ? ~number->magnitude + 1 : number->magnitude);
}

template <class Real>
std::optional<Real> real(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  Real value = 0;
  const char* const last = word.data() + word.size();
  const auto [end, error] = std::from_chars(word.data(), last, value);
  if (error != std::errc{} || end != last) return std::nullopt;
  return value;
}

std::optional<Bytes> real_bytes(DataType type, std::string_view word) {
  if (type == DataType::real32) {
    const auto value = real<float>(word);
    if (!value) return std::nullopt;
    return stored(type, od::raw_of(type, static_cast<double>(*value)));
  }
  const auto value = real<double>(word);
  if (!value) return std::nullopt;
  return stored(type, od::raw_of(type, *value));
}

std::optional<Bytes> time_bytes(DataType type, std::span<const Word> words) {
  if (words.size() != 2 || words[0].quoted || words[1].quoted) return std::nullopt;
  const auto days = od::parse_number(words[0].text);
  const auto ms = od::parse_number(words[1].text);
  const bool good = days && ms && !days->negative && !ms->negative && !days->node_id && !ms->node_id;
  if (!good || days->magnitude > 0xFFFF || ms->magnitude > longest_milliseconds) return std::nullopt;
  return stored(type, ms->magnitude | days->magnitude << 32U);
}

// \\ and \xNN, as `value_text` writes them; any other backslash stands for itself.
Bytes unescaped(std::string_view text) {
  Bytes bytes;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char next = i + 1 < text.size() ? text[i + 1] : '\0';
    if (text[i] == '\\' && next == '\\') {
      ++i;
    } else if (text[i] == '\\' && next == 'x' && i + 3 < text.size()) {
      const auto high = hex_digit(text[i + 2]);
      const auto low = hex_digit(text[i + 3]);
      if (high && low) {
        bytes.push_back(static_cast<std::uint8_t>(*high << 4U | *low));
        i += 3;
        continue;
      }
    }
    bytes.push_back(static_cast<std::uint8_t>(text[i]));
  }
  return bytes;
}

std::string quoted(std::span<const std::uint8_t> bytes) {
  std::string text = "\"";
  for (const auto byte : bytes) {
    if (byte < 0x20 || byte == 0x7F) {
      text += fmt::format("\\x{:02X}", byte);
    } else if (byte == '"' || byte == '\\') {
      text.append(2, static_cast<char>(byte));
    } else {
      text += static_cast<char>(byte);
    }
  }
  return text + '"';
}

std::optional<Bytes> hex_row(std::span<const Word> words) {
  Bytes bytes;
  for (const auto& word : words) {
    if (word.quoted || word.text.size() % 2 != 0) return std::nullopt;
    for (std::size_t i = 0; i < word.text.size(); i += 2) {
      const auto high = hex_digit(word.text[i]);
      const auto low = hex_digit(word.text[i + 1]);
      if (!high || !low) return std::nullopt;
      bytes.push_back(static_cast<std::uint8_t>(*high << 4U | *low));
    }
  }
  if (words.empty()) return std::nullopt;
  return bytes;
}

std::string hex_text(std::span<const std::uint8_t> bytes) {
  if (bytes.empty()) return "\"\"";
  std::string text;
  for (const auto byte : bytes) text += fmt::format("{}{:02X}", text.empty() ? "" : " ", byte);
  return text;
}

bool in_base64(DataType type) noexcept {
  return type == DataType::octet_string || type == DataType::unicode_string || type == DataType::domain;
}

std::string number_text(DataType type, std::uint64_t raw) {
  if (od::is_time(type)) return fmt::format("{} {}", raw >> 32U & 0xFFFFU, raw & longest_milliseconds);
  if (type == DataType::real32) return fmt::format("{}", static_cast<float>(od::real_of(type, raw)));
  if (type == DataType::real64) return fmt::format("{}", od::real_of(type, raw));
  if (od::is_signed(type)) return fmt::format("{}", static_cast<std::int64_t>(raw));
  return fmt::format("{}", raw);
}

}  // namespace

std::optional<Type> type_named(std::string_view word) {
  std::string name;
  for (const char c : word) name += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  if (name == "hex") return Type{DataType::none, Type::Shown::hex_bytes};
  const bool in_hex = name == "x8" || name == "x16" || name == "x32" || name == "x64";
  if (in_hex) name.front() = 'u';
  static constexpr std::string_view known[] = {"b",   "i8",  "i16", "i24", "i32", "i40", "i48", "i56", "i64",
                                               "u8",  "u16", "u24", "u32", "u40", "u48", "u56", "u64", "r32",
                                               "r64", "t",   "td",  "vs",  "os",  "us",  "d"};
  bool found = false;
  for (const auto one : known) found = found || one == name;
  const auto type = found ? od::data_type(name) : std::nullopt;
  if (!type) return std::nullopt;
  return Type{*type, in_hex ? Type::Shown::hex_number : Type::Shown::plain};
}

std::optional<std::string> value_text(Type type, std::span<const std::uint8_t> bytes) {
  if (type.shown == Type::Shown::hex_bytes) return hex_text(bytes);
  if (type.type == DataType::visible_string) return quoted(bytes);
  if (in_base64(type.type)) return bytes.empty() ? "\"\"" : to_base64(bytes);
  const std::size_t size = od::byte_size(type.type);
  if (bytes.size() != size) return std::nullopt;
  const auto raw = od::load(type.type, bytes.data());
  if (type.shown == Type::Shown::hex_number) return fmt::format("0x{:0{}X}", raw, 2 * static_cast<int>(size));
  return number_text(type.type, raw);
}

std::optional<std::vector<std::uint8_t>> value_bytes(Type type, std::span<const Word> words) {
  if (type.shown == Type::Shown::hex_bytes) return hex_row(words);
  if (od::is_time(type.type)) return time_bytes(type.type, words);
  if (words.size() != 1) return std::nullopt;
  const Word& word = words.front();
  if (type.type == DataType::visible_string) return unescaped(word.text);
  if (word.quoted && !(in_base64(type.type) && word.text.empty())) return std::nullopt;
  if (in_base64(type.type)) return from_base64(word.text);
  if (od::is_real(type.type)) return real_bytes(type.type, word.text);
  if (type.type == DataType::boolean && word.text != "0" && word.text != "1") return std::nullopt;
  return integer(type.type, word.text);
}

}  // namespace berth::serve::cia309

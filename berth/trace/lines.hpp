/// Shared by the readers and writers of text formats: lines from chunks, fast hex and decimal digits, names of buses.
/// Inside of room `trace`.
#pragma once

#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>

#include "berth/trace/stream.hpp"

namespace berth::trace {

constexpr bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }
constexpr bool is_blank(char c) noexcept { return c == ' ' || c == '\t'; }

/// The value of a hex digit, 0xFF for any other character.
inline constexpr auto hex_values = [] {
  std::array<std::uint8_t, 256> values{};
  values.fill(0xFF);
  for (unsigned c = '0'; c <= '9'; ++c) values[c] = static_cast<std::uint8_t>(c - '0');
  for (unsigned i = 0; i < 6; ++i) values['A' + i] = values['a' + i] = static_cast<std::uint8_t>(10 + i);
  return values;
}();
constexpr std::uint8_t hex_value(char c) noexcept { return hex_values[static_cast<unsigned char>(c)]; }
constexpr bool is_hex(char c) noexcept { return hex_value(c) != 0xFF; }

/// "00" to "FF".
inline constexpr auto hex_pairs = [] {
  std::array<char, 512> pairs{};
  constexpr const char* digits = "0123456789ABCDEF";
  for (unsigned i = 0; i < 256; ++i) {
    pairs[2 * i] = digits[i >> 4];
    pairs[2 * i + 1] = digits[i & 15];
  }
  return pairs;
}();
inline char* put_byte(char* to, std::uint8_t byte) noexcept {
  std::memcpy(to, hex_pairs.data() + std::size_t{2} * byte, 2);
  return to + 2;
}
/// The last `digits` hex digits of a value.
inline char* put_hex(char* to, std::uint32_t value, unsigned digits) noexcept {
  for (unsigned i = digits; i-- > 0; value >>= 4) to[i] = "0123456789ABCDEF"[value & 15U];
  return to + digits;
}
/// The last `digits` decimal digits of a value.
inline char* put_decimal(char* to, std::uint64_t value, unsigned digits) noexcept {
  for (unsigned i = digits; i-- > 0; value /= 10) to[i] = static_cast<char>('0' + value % 10);
  return to + digits;
}
/// Right-aligned with blanks to at least `width` characters.
inline char* put_number(char* to, std::uint64_t value, unsigned width) noexcept {
  char reversed[20];
  unsigned count = 0;
  do {
    reversed[count++] = static_cast<char>('0' + value % 10);
    value /= 10;
  } while (value != 0);
  for (; width > count; --width) *to++ = ' ';
  while (count > 0) *to++ = reversed[--count];
  return to;
}
inline char* put_text(char* to, std::string_view text) noexcept {
  std::memcpy(to, text.data(), text.size());
  return to + text.size();
}

/// A bus's name made fit for a line: no blanks, no line end, not empty.
[[nodiscard]] std::string line_name(std::string_view name);

/// Names by number for a writer, each made fit for a line once.
class LineNames {
 public:
  /// True: seen for the first time.
  bool add(std::uint16_t bus, std::string_view name);
  [[nodiscard]] const std::string& of(std::uint16_t bus) const noexcept { return names_[bus]; }
  /// 1 for the first bus, and so on.
  [[nodiscard]] unsigned number(std::uint16_t bus) const noexcept { return numbers_[bus]; }

 private:
  std::vector<std::string> names_;
  std::vector<unsigned> numbers_;  // 0: not seen yet
  unsigned count_ = 0;
};

/// More seconds do not fit into nanoseconds of 64 bits.
inline constexpr std::int64_t most_seconds = 9'000'000'000;

/// Reads lines. A line longer than `longest_line` is an error and skipped.
class LineReader : public Reader {
 public:
  static constexpr std::size_t longest_line = 16'384;
  /// No machine has so many; each costs memory (a statistic of 2048 identifiers, a decoder's nodes).
  static constexpr std::size_t most_buses = 256;

  void feed(std::string_view bytes, Sink& sink) final;
  void finish(Sink& sink) final;

 protected:
  explicit LineReader(std::string file) : file_(std::move(file)) {}
  /// One line without its end, not empty.
  virtual void line(std::string_view line) = 0;
  /// The end of the file.
  virtual void over() {}

  /// A finding about the present line; columns count from 0 here.
  void tell(Finding::Severity severity, std::size_t column, std::string message, std::string fix = {});
  void error(std::size_t column, std::string message, std::string fix = {}) {
    tell(Finding::Severity::error, column, std::move(message), std::move(fix));
  }
  /// About the file as a whole.
  void tell_of_file(Finding::Severity severity, std::string message, std::string fix = {});
  /// The number of a name; empty (with a finding) if there are too many.
  std::optional<std::uint16_t> bus(std::string_view name);
  /// The same without adding it.
  [[nodiscard]] std::optional<std::uint16_t> known_bus(std::string_view name) const;
  /// Passes the entry on. A time before the bus's last one is a warning, once for each step back.
  void keep(const Entry& entry) {
    rt::Duration& latest = latest_[entry.bus];
    if (entry.at < latest) [[unlikely]]
      tell_back();
    latest = entry.at;
    sink_->entry(entry);
  }

 private:
  void one(std::string_view line) {
    if (++number_ == 1 && line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (!line.empty()) this->line(line);
  }
  void tell_back();
  void partial(std::string_view bytes);

  std::string file_;
  std::string rest_;  // of a line that is not complete yet
  bool passing_ = false;
  int number_ = 0;
  Sink* sink_ = nullptr;
  std::vector<rt::Duration> latest_;  // by bus
  std::unordered_map<std::string, std::uint16_t> known_;
};

}  // namespace berth::trace

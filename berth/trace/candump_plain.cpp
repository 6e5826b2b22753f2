#include "berth/trace/candump_plain.hpp"

#include <charconv>
#include <chrono>
#include <string>

#include "berth/trace/calendar.hpp"
#include "berth/trace/lines.hpp"

namespace berth::trace {
namespace {

/// Takes words off the front of a line.
class Words {
 public:
  explicit Words(std::string_view line) noexcept : rest_(line) {}
  std::string_view next() noexcept {
    while (!rest_.empty() && is_blank(rest_.front())) rest_.remove_prefix(1);
    std::size_t end = 0;
    while (end < rest_.size() && !is_blank(rest_[end])) ++end;
    const auto word = rest_.substr(0, end);
    rest_.remove_prefix(end);
    return word;
  }
  [[nodiscard]] std::string_view rest() const noexcept { return rest_; }

 private:
  std::string_view rest_;
};

template <class Number>
bool read_number(std::string_view text, Number& into, int base = 10) {
  const auto [end, bad] = std::from_chars(text.data(), text.data() + text.size(), into, base);
  return !text.empty() && bad == std::errc{} && end == text.data() + text.size();
}

// "1436509052.249713", "000.000120"
std::optional<rt::Duration> seconds_of(std::string_view text) {
  const bool has_point = text.find('.') != std::string_view::npos;
  return has_point && is_digit(text.front()) ? parse_seconds(text) : std::nullopt;
}

// "2015-07-10" and "14:24:12.249713"
std::optional<rt::Duration> date_of(std::string_view date, std::string_view time) {
  const bool forms = date.size() == 10 && time.size() >= 10 && date[4] == '-' && date[7] == '-' && time[2] == ':' &&
                     time[5] == ':' && time[8] == '.';
  if (!forms) return std::nullopt;
  int year = 0;
  unsigned month = 0;
  unsigned day = 0;
  unsigned h = 0;
  unsigned m = 0;
  const auto seconds = seconds_of(time.substr(6));
  const bool numbers = read_number(date.substr(0, 4), year) && read_number(date.substr(5, 2), month) &&
                       read_number(date.substr(8), day) && read_number(time.substr(0, 2), h) &&
                       read_number(time.substr(3, 2), m);
  const std::chrono::year_month_day ymd{std::chrono::year(year), std::chrono::month(month), std::chrono::day(day)};
  const bool good = numbers && seconds && ymd.ok() && year >= 1970 && year <= 2250 && h <= 23 && m <= 59;
  if (!good || *seconds >= std::chrono::seconds(61)) return std::nullopt;
  return std::chrono::sys_days(ymd).time_since_epoch() + std::chrono::hours(h) + std::chrono::minutes(m) + *seconds;
}

// "(TIME)" or "(DATE TIME)", whose first word is given.
std::optional<rt::Duration> time_of(std::string_view first, Words& words) {
  first.remove_prefix(1);
  if (first.ends_with(')')) return seconds_of(first.substr(0, first.size() - 1));
  const auto second = words.next();
  if (!second.ends_with(')')) return std::nullopt;
  return date_of(first, second.substr(0, second.size() - 1));
}

// "RX - -" or "TX B E", from option -x. The first word is given.
bool take_flags(std::string_view first, Words& words, PlainLine& line) {
  line.direction = first == "RX" ? Direction::received : Direction::sent;
  const auto brs = words.next();
  const auto esi = words.next();
  if ((brs != "-" && brs != "B") || (esi != "-" && esi != "E")) return false;
  line.frame.brs = brs == "B";
  line.frame.esi = esi == "E";
  return true;
}

bool take_identifier(std::string_view text, PlainLine& line) {
  std::uint32_t id = 0;
  const bool width = text.size() == 3 || text.size() == 8;
  if (!width || !read_number(text, id, 16)) return false;
  line.error = text.size() == 8 && (id & 0x2000'0000U) != 0;
  line.frame.extended = text.size() == 8 && !line.error;
  line.frame.id = line.error ? id & can::extended_mask : id;
  return line.frame.id == id || line.error;
}

// "{F}": a classic frame of eight bytes with its raw DLC.
bool is_raw_dlc(std::string_view text) noexcept {
  return text.size() == 3 && text.front() == '{' && text.back() == '}' && is_hex(text[1]) && hex_value(text[1]) > 8;
}

// "[8]" or, FD, "[12]" and "[08]", with the data after it.
bool take_data(Words& words, PlainLine& line) {
  auto brackets = words.next();
  if (is_raw_dlc(brackets)) brackets = "[8]";
  if (brackets.size() < 3 || brackets.front() != '[' || brackets.back() != ']') return false;
  const auto digits = brackets.substr(1, brackets.size() - 2);
  unsigned size = 0;
  if (!is_digit(digits.front()) || !read_number(digits, size)) return false;
  line.frame.fd = digits.size() == 2;
  const bool known = line.frame.fd ? size <= 8 || size == 12 || size == 16 || size == 20 || size == 24 || size == 32 ||
                                         size == 48 || size == 64
                                   : size <= 8;
  if (!known) return false;
  line.frame.size = static_cast<std::uint8_t>(size);
  if (line.frame.id > (line.frame.extended || line.error ? can::extended_mask : can::base_mask)) return false;
  Words ahead = words;
  if (ahead.next() == "remote") {
    line.frame.remote = true;
    return !line.frame.fd && ahead.next() == "request";
  }
  for (unsigned i = 0; i < size; ++i) {
    const auto byte = words.next();
    if (byte.size() != 2 || !is_hex(byte[0]) || !is_hex(byte[1])) return false;
    line.frame.data[i] = static_cast<std::uint8_t>(hex_value(byte[0]) << 4 | hex_value(byte[1]));
  }
  const auto behind = words.next();  // option -a adds '........'
  return behind.empty() || behind.front() == '\'' || (line.error && behind == "ERRORFRAME");
}

}  // namespace

std::optional<PlainLine> parse_plain_candump(std::string_view text) {
  Words words(text);
  PlainLine line;
  auto word = words.next();
  if (word.starts_with('(')) {
    const auto at = time_of(word, words);
    if (!at) return std::nullopt;
    line.at = *at;
    line.timed = true;
    word = words.next();
  }
  if (word.empty()) return std::nullopt;
  line.bus = word;
  word = words.next();
  if (word == "RX" || word == "TX") {
    if (!take_flags(word, words, line)) return std::nullopt;
    word = words.next();
  }
  if (!take_identifier(word, line) || !take_data(words, line)) return std::nullopt;
  if (!line.frame.fd) line.frame.brs = line.frame.esi = false;
  return line;
}

}  // namespace berth::trace

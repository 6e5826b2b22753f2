#include "berth/trace/calendar.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <chrono>

#include "berth/trace/lines.hpp"

namespace berth::trace {
namespace {

constexpr std::array<std::string_view, 12> months{"jan", "feb", "mar", "apr", "may", "jun",
                                                  "jul", "aug", "sep", "oct", "nov", "dec"};
constexpr std::int64_t days_to_1970 = 25'569;  // since 30 December 1899
constexpr int last_year = 2255;                // that of `most_seconds`

std::string_view next_word(std::string_view& text) {
  const auto begin = std::min(text.find_first_not_of(" \t"), text.size());
  const auto end = std::min(text.find_first_of(" \t", begin), text.size());
  const auto found = text.substr(begin, end - begin);
  text.remove_prefix(end);
  return found;
}

std::optional<unsigned> digits(std::string_view text, unsigned most) {
  unsigned value = 0;
  const auto [end, bad] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || bad != std::errc{} || end != text.data() + text.size() || value > most) return std::nullopt;
  return value;
}

// 1 to 12; accepts Mrz, Mär (in any encoding), Mai, Okt and Dez, too.
unsigned month_of(std::string_view word) {
  if (word.size() < 3) return 0;
  std::string small(word.substr(0, 3));
  for (char& c : small) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + ('a' - 'A')) : c;
  for (unsigned i = 0; i < months.size(); ++i) {
    if (small == months[i]) return i + 1;
  }
  if (small == "mrz" || (small[0] == 'm' && static_cast<unsigned char>(small[1]) >= 0x80)) return 3;
  if (small == "mai") return 5;
  if (small == "okt") return 10;
  return small == "dez" ? 12 : 0;
}

// "06:17:32.249"
std::optional<rt::Duration> clock_of(std::string_view word) {
  const auto first = word.find(':');
  const auto second = first == std::string_view::npos ? first : word.find(':', first + 1);
  if (second == std::string_view::npos) return std::nullopt;
  const auto hours = digits(word.substr(0, first), 23);
  const auto minutes = digits(word.substr(first + 1, second - first - 1), 59);
  const auto seconds = parse_seconds(word.substr(second + 1));
  if (!hours || !minutes || !seconds || *seconds >= std::chrono::seconds(61)) return std::nullopt;
  return std::chrono::hours(*hours) + std::chrono::minutes(*minutes) + *seconds;
}

}  // namespace

std::optional<rt::Duration> parse_date(std::string_view text) {
  auto word = next_word(text);
  unsigned month = month_of(word);
  // A weekday may look like a month ("Mar"), so a word counts as a month only with the day after it.
  auto rest = text;
  auto day = digits(next_word(rest), 31);
  if (month == 0 || !day) {
    word = next_word(text);
    month = month_of(word);
    rest = text;
    day = digits(next_word(rest), 31);
  }
  auto clock = clock_of(next_word(rest));
  auto year_word = next_word(rest);
  const bool am = year_word == "am" || year_word == "AM";
  const bool pm = year_word == "pm" || year_word == "PM";
  if (am || pm) year_word = next_word(rest);
  const auto year = digits(year_word, last_year);
  if (month == 0 || !day || !clock || !year || *year < 1970) return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(static_cast<int>(*year)), std::chrono::month(month),
                                         std::chrono::day(*day)};
  if (!date.ok()) return std::nullopt;
  if (am && *clock >= std::chrono::hours(12)) *clock -= std::chrono::hours(12);
  if (pm && *clock < std::chrono::hours(12)) *clock += std::chrono::hours(12);
  return std::chrono::sys_days(date).time_since_epoch() + *clock;
}

std::string write_date(rt::Duration since_1970) {
  constexpr const char* weekdays[] = {"Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"};
  constexpr const char* names[] = {"Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"};
  const auto days = std::chrono::floor<std::chrono::days>(since_1970);
  const std::chrono::sys_days day(days);
  const std::chrono::year_month_day date(day);
  const auto millis = std::chrono::floor<std::chrono::milliseconds>(since_1970 - days).count();
  return fmt::format("{} {} {:02} {:02}:{:02}:{:02}.{:03} {}", weekdays[std::chrono::weekday(day).c_encoding()],
                     names[static_cast<unsigned>(date.month()) - 1], static_cast<unsigned>(date.day()),
                     millis / 3'600'000, millis / 60'000 % 60, millis / 1000 % 60, millis % 1000,
                     static_cast<int>(date.year()));
}

namespace {

// A decimal number of units; a unit is a power of ten of nanoseconds.
std::optional<rt::Duration> parse_units(std::string_view text, std::int64_t unit) noexcept {
  const std::int64_t most = most_seconds * (1'000'000'000 / unit);
  std::size_t at = 0;
  std::int64_t whole = 0;
  for (; at < text.size() && is_digit(text[at]); ++at) {
    whole = whole * 10 + (text[at] - '0');
    if (whole > most) return std::nullopt;
  }
  if (at == 0) return std::nullopt;
  std::int64_t nanos = 0;
  if (at < text.size()) {
    if (text[at] != '.' || at + 1 == text.size()) return std::nullopt;
    std::int64_t part = unit / 10;
    for (++at; at < text.size(); ++at, part /= 10) {
      if (!is_digit(text[at])) return std::nullopt;
      nanos += part * (text[at] - '0');
    }
  }
  return std::chrono::nanoseconds(whole * unit + nanos);
}

}  // namespace

std::optional<rt::Duration> parse_seconds(std::string_view text) noexcept { return parse_units(text, 1'000'000'000); }

std::optional<rt::Duration> parse_milliseconds(std::string_view text) noexcept { return parse_units(text, 1'000'000); }

std::optional<rt::Duration> parse_ole_date(std::string_view text) noexcept {
  std::size_t at = 0;
  std::int64_t days = 0;
  for (; at < text.size() && is_digit(text[at]); ++at) {
    days = days * 10 + (text[at] - '0');
    if (days > days_to_1970 + most_seconds / 86'400) return std::nullopt;
  }
  if (at == 0 || days < days_to_1970) return std::nullopt;
  std::uint64_t fraction = 0;  // of a day, in units of 1e-15
  if (at < text.size()) {
    if (text[at] != '.' && text[at] != ',') return std::nullopt;
    std::uint64_t unit = 100'000'000'000'000;
    for (++at; at < text.size(); ++at, unit /= 10) {
      if (!is_digit(text[at])) return std::nullopt;
      fraction += unit * static_cast<std::uint64_t>(text[at] - '0');
    }
  }
  // 864 * 10^8 microseconds a day; 10^15 / 10^8 = 10^7. The product has 10^15 * 864 < 2^60.
  const auto micros = static_cast<std::int64_t>((fraction * 864 + 5'000'000) / 10'000'000);
  return std::chrono::days(days - days_to_1970) + std::chrono::microseconds(micros);
}

std::string write_ole_date(rt::Duration since_1970) {
  const auto days = std::chrono::floor<std::chrono::days>(since_1970);
  const auto micros =
      static_cast<std::uint64_t>(std::chrono::round<std::chrono::microseconds>(since_1970 - days).count());
  // In units of 1e-14 day: micros * 10^14 / (864 * 10^8) = micros * 10^6 / 864.
  return fmt::format("{}.{:014}", days.count() + days_to_1970, (micros * 1'000'000 + 432) / 864);
}

}  // namespace berth::trace

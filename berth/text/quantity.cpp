#include "berth/text/quantity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "berth/base/words.hpp"

namespace berth::text {
namespace {

struct Unit {
  std::string_view name;
  std::int64_t nanoseconds;
};
constexpr std::array<Unit, 6> units{{{"h", 3'600'000'000'000},
                                     {"min", 60'000'000'000},
                                     {"s", 1'000'000'000},
                                     {"ms", 1'000'000},
                                     {"us", 1'000},
                                     {"ns", 1}}};
constexpr std::int64_t hundred_years = 100LL * 366 * 24 * 3600 * 1'000'000'000;

bool digit(char c) noexcept { return c >= '0' && c <= '9'; }

std::string_view trimmed(std::string_view text) noexcept {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

std::string_view take_digits(std::string_view& text) noexcept {
  std::size_t n = 0;
  while (n < text.size() && digit(text[n])) ++n;
  const auto digits = text.substr(0, n);
  text.remove_prefix(n);
  return digits;
}

std::optional<std::int64_t> to_number(std::string_view digits, std::int64_t high) noexcept {
  std::int64_t value = 0;
  for (const char c : digits) {
    if (value > (high - (c - '0')) / 10) return std::nullopt;
    value = value * 10 + (c - '0');
  }
  return value;
}

/// whole.fraction of a unit, in nanoseconds; empty if this is not a whole number of them.
std::optional<std::int64_t> scaled(std::string_view whole, std::string_view fraction, std::int64_t unit) noexcept {
  const auto value = to_number(whole, hundred_years / unit);
  if (!value) return std::nullopt;
  while (fraction.ends_with('0')) fraction.remove_suffix(1);
  const auto digits = to_number(fraction, 999'999'999'999'999);
  if (!digits || fraction.size() > 15) return std::nullopt;
  std::int64_t part = unit;  // unit = part * 10^tens; then part * digits cannot overflow
  std::size_t tens = 0;
  for (; part % 10 == 0; part /= 10) ++tens;
  std::int64_t rest = part * *digits;
  for (; tens < fraction.size(); ++tens) {
    if (rest % 10 != 0) return std::nullopt;
    rest /= 10;
  }
  for (; tens > fraction.size(); --tens) rest *= 10;
  return *value * unit + rest;
}

}  // namespace

std::optional<Duration> parse_duration(std::string_view text) {
  if (text == "0") return Duration(0);
  const auto whole = take_digits(text);
  if (whole.empty()) return std::nullopt;
  std::string_view fraction;
  if (!text.empty() && text.front() == '.') {
    text.remove_prefix(1);
    fraction = take_digits(text);
    if (fraction.empty()) return std::nullopt;
  }
  if (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  const auto unit = std::ranges::find(units, text, &Unit::name);
  if (unit == units.end()) return std::nullopt;
  const auto value = scaled(whole, fraction, unit->nanoseconds);
  if (!value) return std::nullopt;
  return Duration(*value);
}

std::string write_duration(Duration duration) {
  const auto value = duration.count();
  if (value == 0) return "0 s";
  for (const auto& unit : units) {
    if (value % unit.nanoseconds == 0) return fmt::format("{} {}", value / unit.nanoseconds, unit.name);
  }
  return {};
}

std::optional<std::vector<unsigned>> parse_ranges(std::string_view text, unsigned low, unsigned high) {
  std::vector<unsigned> numbers;
  while (true) {
    const auto comma = text.find(',');
    std::string_view part = trimmed(text.substr(0, comma));
    const auto first = take_digits(part);
    auto last = first;
    if (part.starts_with("..")) {
      part.remove_prefix(2);
      last = take_digits(part);
    }
    const auto from = to_number(first, high);
    const auto to = to_number(last, high);
    if (first.empty() || last.empty() || !part.empty() || !from || !to || *from > *to) return std::nullopt;
    const auto begin = static_cast<unsigned>(*from);
    if (begin < low || (!numbers.empty() && begin <= numbers.back())) return std::nullopt;
    for (unsigned n = begin; n <= static_cast<unsigned>(*to); ++n) numbers.push_back(n);
    if (comma == std::string_view::npos) return numbers;
    text.remove_prefix(comma + 1);
  }
}

std::string fill(std::string_view pattern, std::string_view key, std::string_view value) {
  const std::string mark = fmt::format("{{{}}}", key);
  std::string out;
  for (auto at = pattern.find(mark); at != std::string_view::npos; at = pattern.find(mark)) {
    out += pattern.substr(0, at);
    out += value;
    pattern.remove_prefix(at + mark.size());
  }
  return out += pattern;
}

}  // namespace berth::text

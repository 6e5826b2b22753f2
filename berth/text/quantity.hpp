/// Small values in users' files: durations with their unit, ranges of numbers, words from a list.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/words.hpp"

namespace berth::text {

using Duration = std::chrono::nanoseconds;

/// Reads `"4 ms"`: a decimal number without sign or exponent, an optional space, and one of ns, us, ms, s, min, h;
/// `"0"` needs no unit. Exact: empty for anything finer than a nanosecond, and for more than 100 years.
[[nodiscard]] std::optional<Duration> parse_duration(std::string_view text);

/// Writes a non-negative duration so that `parse_duration` reads it back: with the largest unit that needs no decimals
/// ("1500 ms", "2 s", "0 s").
[[nodiscard]] std::string write_duration(Duration duration);

/// Reads `"1..60"`, `"7"` or `"1..10, 20, 30..32"`: ascending, every number at least `low` and at most `high`. Empty
/// for anything else.
[[nodiscard]] std::optional<std::vector<unsigned>> parse_ranges(std::string_view text, unsigned low, unsigned high);

using berth::closest;
using berth::quoted;

/// `pattern` with every `{key}` replaced by `value`.
[[nodiscard]] std::string fill(std::string_view pattern, std::string_view key, std::string_view value);

}  // namespace berth::text

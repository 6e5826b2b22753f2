/// The table of `berth watch`, and of watched values in the live table of `berth up`: a row for each object, with its
/// value, the value's age and a small plot of the last values. Pure: the drawing depends on the arguments alone.
///
///     slot            object                value    age  last values
///     unloader        total               1240 kg  0.4 s  ▁▁▂▂▃▄▅▅▆▇█
///     quay            flow              188.9 kg/s  9.1 s  no answer
///     main            7777h:00        06020000h object does not exist
///
/// If the rows are wider than the terminal, these are cut, in this order:
/// 1. the plot becomes shorter, then disappears
/// 2. the age
/// 3. names of objects are shortened
/// 4. names of slots are shortened
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "berth/rt/executor.hpp"
#include "board.hpp"

namespace berth::cli {

struct WatchRow {
  std::string slot;                          ///< the node, as the user named it
  std::string object;                        ///< its name; without a name its number, as 6010h:00
  std::string value{};                       ///< the last value with its unit; empty: none
  std::string trouble{};                     ///< why the last reading failed; empty: it succeeded
  std::optional<rt::Time> read_at{};         ///< when `value` was read
  std::deque<std::optional<double>> past{};  ///< oldest first; empty: that reading failed, or is not a number
};

/// How many of the last values are kept.
inline constexpr std::size_t most_past = 120;

/// The newest is at the right. One column per value, scaled between the lowest and the highest; a gap for a missing
/// one. `utf8`: block characters, else ASCII: . : - = + * # @
[[nodiscard]] std::string sparkline(const std::deque<std::optional<double>>& past, std::size_t width, bool utf8);

/// The heading, then a line for each row, none wider than `width`. A row with a failed reading is urgent.
[[nodiscard]] std::vector<BoardLine> watch_lines(const std::vector<WatchRow>& rows, std::size_t width, rt::Time now,
                                                 bool utf8);

/// The first of LC_ALL, LC_CTYPE and LANG that is set names UTF-8.
[[nodiscard]] bool terminal_has_utf8() noexcept;

}  // namespace berth::cli

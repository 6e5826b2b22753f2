/// The table of `berth watch`, and of watched values in the live table of `berth up`: a row for each object, with its
/// value, the value's age and a small plot of the last values. Pure: what is drawn follows from what is given.
///
///     slot            object                value    age  last values
///     unloader        total               1240 kg  0.4 s  ▁▁▂▂▃▄▅▅▆▇█
///     quay            flow              188.9 kg/s  9.1 s  no answer
///     main            7777h:00        06020000h object does not exist
///
/// When the rows are wider than the terminal, columns are given up in this order: the plot becomes shorter, then it
/// goes, then the age; then names of objects are cut, and last names of slots.
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
  std::string object;                        ///< its name; one without a name as 6010h:00
  std::string value{};                       ///< that was read last, with its unit; empty: none was
  std::string trouble{};                     ///< why the last reading failed; empty: it did not
  std::optional<rt::Time> read_at{};         ///< when `value` was read
  std::deque<std::optional<double>> past{};  ///< oldest first; empty: that reading failed, or is no number
};

/// So many of the last values are kept.
inline constexpr std::size_t most_past = 120;

/// The newest at the right, one column each, from the lowest to the highest of them; a gap where there is none. `utf8`:
/// in block characters, else in ASCII: . : - = + * # @
[[nodiscard]] std::string sparkline(const std::deque<std::optional<double>>& past, std::size_t width, bool utf8);

/// The heading, then a line for each row, none wider than `width`. A row in trouble is urgent.
[[nodiscard]] std::vector<BoardLine> watch_lines(const std::vector<WatchRow>& rows, std::size_t width, rt::Time now,
                                                 bool utf8);

/// LC_ALL, LC_CTYPE or LANG, the first that is set, names UTF-8.
[[nodiscard]] bool terminal_has_utf8() noexcept;

}  // namespace berth::cli

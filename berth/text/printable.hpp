/// Makes text from outside (a device's strings, names in a trace, a peer's words) safe for a terminal. Applied once,
/// where lines are printed; everywhere else texts stay unchanged.
#pragma once

#include <string>
#include <string_view>

namespace berth::text {

/// True if it cannot move a cursor, change a colour or change the writing direction: UTF-8 without control characters
/// (C0 except line feed and tab, DEL, C1) and without Unicode's bidirectional controls and line separators.
[[nodiscard]] bool is_printable(std::string_view text) noexcept;

/// The text with each such character as `\u001b`, and each byte that is not UTF-8 as `\x9b`. Inside a JSON string the
/// first form is JSON's own. Line feeds stay: use it only for a text whose lines are Berth's own (JSON, a file that it
/// wrote).
[[nodiscard]] std::string printable(std::string_view text);

/// The same as one line: a line feed becomes `\u000a`, too. For every text that a device, a file or a client may
/// influence, so that a name with a line feed cannot forge a table row, an event or a log line.
[[nodiscard]] std::string one_line(std::string_view text);

}  // namespace berth::text

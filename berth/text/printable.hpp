/// Text from outside (a device's strings, names in a trace, a peer's words) made fit for a terminal. Applied once,
/// where lines are printed; everywhere else texts stay as they are.
#pragma once

#include <string>
#include <string_view>

namespace berth::text {

/// Nothing in it moves a cursor, changes a colour or turns the direction of writing: UTF-8 without control characters
/// (C0 but line feed and tab, DEL, C1) and without Unicode's bidirectional controls and line separators.
[[nodiscard]] bool is_printable(std::string_view text) noexcept;

/// The text with each such character as \u001b, and each byte that is no UTF-8 as \x9b. Inside a JSON string the first
/// form is JSON's own.
[[nodiscard]] std::string printable(std::string_view text);

}  // namespace berth::text

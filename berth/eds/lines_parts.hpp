/// The lines of an EDS or a DCF (CiA 306 §4.2).
#pragma once

#include <cstddef>

namespace berth::eds {

inline constexpr std::size_t longest_line = 255;

/// NUL counts as blank, because files padded with NULs exist.
[[nodiscard]] constexpr bool blank(char c) noexcept {
  return c == ' ' || c == '\t' || c == '\0' || c == '\v' || c == '\f';
}
[[nodiscard]] constexpr bool line_break(char c) noexcept { return c == '\n' || c == '\r'; }

}  // namespace berth::eds

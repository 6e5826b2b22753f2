/// The width of a text on a terminal: an ideograph or an emoji is two columns wide, a combining mark none.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace berth::text {

/// Columns of a line of UTF-8 without control characters (`printable`). Bytes that are not UTF-8 count one each.
[[nodiscard]] std::size_t columns(std::string_view line);
/// The longest beginning that is at most `most` columns wide.
[[nodiscard]] std::string cut(std::string_view line, std::size_t most);
/// The line with spaces after it up to `least` columns.
[[nodiscard]] std::string padded(std::string_view line, std::size_t least);
/// Broken at spaces into lines no wider than `most` (1 or more); a longer word is broken anywhere. At least one line.
[[nodiscard]] std::vector<std::string> wrapped(std::string_view line, std::size_t most);

}  // namespace berth::text

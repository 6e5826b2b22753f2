/// Words as people write and read them.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace berth {

/// Of an ASCII letter; anything else stays as it is.
[[nodiscard]] constexpr char lower(char c) noexcept {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

/// Equal but for upper and lower case of ASCII letters.
[[nodiscard]] bool same_word(std::string_view a, std::string_view b) noexcept;

/// "a, b, c and 37 more": `most` names at most, of which the last stands for the rest when there are more.
[[nodiscard]] std::string some_of(const std::vector<std::string>& names, std::size_t most = 8);

/// The word that a person most likely meant: at most two letters wrong (one in words of up to four letters), in either
/// case. Empty when none is near.
[[nodiscard]] std::string_view closest(std::string_view word, std::span<const std::string_view> candidates);

/// As text of HTML, XML and SVG, between tags or in an attribute's double quotes; control characters become spaces.
[[nodiscard]] std::string markup(std::string_view text);

/// A TOML basic string, quoted and escaped: also how messages write what a person typed.
[[nodiscard]] std::string quoted(std::string_view text);

}  // namespace berth

/// Words for people.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace berth {

/// Converts an ASCII letter; others stay unchanged.
[[nodiscard]] constexpr char lower(char c) noexcept {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

/// True if equal, ignoring the case of ASCII letters.
[[nodiscard]] bool same_word(std::string_view a, std::string_view b) noexcept;

/// "a, b, c and 37 more": at most `most` items, of which the last gives the number of the rest.
[[nodiscard]] std::string some_of(const std::vector<std::string>& names, std::size_t most = 8);

/// The word that a user most likely meant: at most two wrong letters (one in words of up to four letters), in either
/// case. Empty when none is near.
[[nodiscard]] std::string_view closest(std::string_view word, std::span<const std::string_view> candidates);

/// Text for HTML, XML and SVG, between tags or in an attribute's double quotes; control characters become spaces.
[[nodiscard]] std::string markup(std::string_view text);

/// A TOML basic string, quoted and escaped; messages also quote user input with it.
[[nodiscard]] std::string quoted(std::string_view text);

}  // namespace berth

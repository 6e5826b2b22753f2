/// Words as people write and read them.
#pragma once

#include <cstddef>
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

}  // namespace berth

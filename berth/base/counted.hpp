/// A number and a noun, in the singular or the plural.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace berth {

/// "1 device", "2 devices", "0 devices". `several`: the plural, if it is not formed with s ("buses").
[[nodiscard]] inline std::string counted(std::size_t number, std::string_view one, std::string_view several = {}) {
  const std::string text = std::to_string(number) + " ";
  if (number == 1) return text + std::string(one);
  return text + (several.empty() ? std::string(one) + "s" : std::string(several));
}

}  // namespace berth

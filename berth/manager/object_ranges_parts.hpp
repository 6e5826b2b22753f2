/// Where an object stands.
#pragma once

#include <cstdint>

namespace berth::manager {

[[nodiscard]] constexpr bool within(std::uint16_t index, std::uint16_t first, std::uint16_t last) noexcept {
  return index >= first && index <= last;
}

/// Registers, commands and clocks: no configuration.
[[nodiscard]] constexpr bool is_left_alone(std::uint16_t index) noexcept {
  return within(index, 0x1001, 0x1003) || within(index, 0x1010, 0x1011) || index == 0x1013 ||
         within(index, 0x1023, 0x1026) || within(index, 0x1F50, 0x1F57);
}

}  // namespace berth::manager

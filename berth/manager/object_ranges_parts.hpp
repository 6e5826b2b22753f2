/// Ranges of object indexes.
#pragma once

#include <cstdint>

#include "berth/od/cia301.hpp"

namespace berth::manager {

using od::within;

/// Registers, commands and clocks: no configuration.
[[nodiscard]] constexpr bool is_left_alone(std::uint16_t index) noexcept {
  return within(index, 0x1001, 0x1003) || within(index, 0x1010, 0x1011) || index == 0x1013 ||
         within(index, 0x1023, 0x1026) || within(index, 0x1F50, 0x1F57);
}

}  // namespace berth::manager

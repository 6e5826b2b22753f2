/// Where an object stands.
#pragma once

#include <cstdint>

namespace berth::manager {

[[nodiscard]] constexpr bool within(std::uint16_t index, std::uint16_t first, std::uint16_t last) noexcept {
  return index >= first && index <= last;
}

}  // namespace berth::manager

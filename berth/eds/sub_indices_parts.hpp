/// Which objects have sub-indices, and how many.
#pragma once

#include <cstdint>

#include "berth/od/description.hpp"

namespace berth::eds {

inline constexpr std::uint8_t most_sub = 254;

[[nodiscard]] constexpr bool takes_subs(od::ObjectCode code) noexcept {
  return code == od::ObjectCode::array || code == od::ObjectCode::record || code == od::ObjectCode::defstruct;
}

}  // namespace berth::eds

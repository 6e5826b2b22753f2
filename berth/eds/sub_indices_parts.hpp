/// Which objects have sub-indices, how many, and which keys they cannot have themselves.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>

#include "berth/od/description.hpp"

namespace berth::eds {

inline constexpr std::uint8_t most_sub = 254;

[[nodiscard]] constexpr bool takes_subs(od::ObjectCode code) noexcept {
  return code == od::ObjectCode::array || code == od::ObjectCode::record || code == od::ObjectCode::defstruct;
}

/// Limit for a fault that a file may have thousands of times: so many are reported at their lines, the others counted.
inline constexpr std::size_t most_told = 5;

/// A value at the object itself belongs to none of its sub-objects. `berth eds convert` recognises both by their ends.
[[nodiscard]] inline std::string no_own_value(od::ObjectCode code) {
  return fmt::format("{} {} has no value of its own: left out", code == od::ObjectCode::array ? "an" : "a",
                     od::name(code));
}
[[nodiscard]] inline std::string more_own_values(std::size_t count) {
  return fmt::format("{} more values of RECORDs and ARRAYs that have none of their own: left out", count);
}

}  // namespace berth::eds

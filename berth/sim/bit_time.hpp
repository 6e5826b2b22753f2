/// Bit times of a bit rate. Internal to `sim`.
#pragma once

#include <cstdint>

#include "berth/rt/executor.hpp"

namespace berth::sim {

/// Rounded to whole nanoseconds.
[[nodiscard]] inline rt::Duration bit_time_of(std::uint32_t bit_rate) noexcept {
  return rt::Duration((1'000'000'000LL + bit_rate / 2) / bit_rate);
}
/// From the beginning of a bit.
[[nodiscard]] inline rt::Duration sample_point(rt::Duration bit) noexcept { return bit * 7 / 8; }

}  // namespace berth::sim

/// Which bit rate does a bus run at? Heard, never probed: what was heard at each rate goes in, the verdict comes out.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace berth::live {

/// CiA 301 §4.5, in the order in which they are tried: the usual ones first.
inline constexpr std::array<std::uint32_t, 8> rates_to_try{250'000, 500'000, 125'000, 1'000'000,
                                                           50'000,  800'000, 20'000,  10'000};

/// What was heard at one rate, listening only.
struct RateHeard {
  std::uint32_t rate = 0;    ///< bit/s
  std::uint32_t frames = 0;  ///< good ones: a CRC that fits by chance at a wrong rate is one in 32768 frames at most
  std::uint32_t errors = 0;  ///< where the port counts them
  std::string problem{};     ///< why it could not be listened at this rate
};

/// A rate at which two frames were heard, or one and no error; of several the one with the most frames. Empty: the bus
/// is silent, or nothing that came in was a frame.
[[nodiscard]] std::optional<std::uint32_t> decide(std::span<const RateHeard> heard) noexcept;
/// Something was on the wire at all.
[[nodiscard]] bool anything(std::span<const RateHeard> heard) noexcept;

}  // namespace berth::live

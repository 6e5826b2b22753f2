/// Finds the bit rate of a bus by listening only, from what was heard at each rate.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace berth::live {

/// CiA 301 §4.5, in the order of trying: the usual ones first.
inline constexpr std::array<std::uint32_t, 8> rates_to_try{250'000, 500'000, 125'000, 1'000'000,
                                                           50'000,  800'000, 20'000,  10'000};

/// What was heard at one rate.
struct RateHeard {
  std::uint32_t rate = 0;    ///< bit/s
  std::uint32_t frames = 0;  ///< good ones: at a wrong rate at most one frame in 32768 has a correct CRC by chance
  std::uint32_t errors = 0;  ///< if the port counts them
  std::string problem{};     ///< why listening at this rate failed
};

/// A rate at which two frames were heard, or one and no error; if several, the one with the most frames. Empty: the bus
/// is silent, or nothing heard was a frame.
[[nodiscard]] std::optional<std::uint32_t> decide(std::span<const RateHeard> heard) noexcept;
/// Anything was on the wire.
[[nodiscard]] bool anything(std::span<const RateHeard> heard) noexcept;

}  // namespace berth::live

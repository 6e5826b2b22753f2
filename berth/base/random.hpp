/// Berth's own random numbers: a seed must give the same world everywhere, but the standard library's distributions
/// differ between systems.
#pragma once

#include <cstdint>

namespace berth {

/// xoshiro256** seeded by splitmix64 (Blackman and Vigna, public domain algorithms).
class Random {
 public:
  explicit constexpr Random(std::uint64_t seed) noexcept {
    for (auto& word : state_) word = split_mix(seed);
  }
  /// Uniform over all 64-bit values.
  constexpr std::uint64_t next() noexcept {
    const std::uint64_t result = rotl(state_[1] * 5, 7) * 9;
    const std::uint64_t shifted = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= shifted;
    state_[3] = rotl(state_[3], 45);
    return result;
  }
  /// Uniform in [0, bound); 0 when `bound` is 0. The bias of the modulus is below 2^-32 for bounds below 2^32.
  constexpr std::uint64_t below(std::uint64_t bound) noexcept { return bound == 0 ? 0 : next() % bound; }
  /// Uniform in [low, high], both included; `low` when the range is empty.
  constexpr std::int64_t between(std::int64_t low, std::int64_t high) noexcept {
    if (high <= low) return low;
    const auto first = static_cast<std::uint64_t>(low);  // unsigned: the width of the range may not fit the signed type
    const auto width = static_cast<std::uint64_t>(high) - first + 1;
    return static_cast<std::int64_t>(first + (width == 0 ? next() : below(width)));
  }
  /// True `per_million` times in a million.
  constexpr bool chance(std::uint32_t per_million) noexcept { return below(1'000'000) < per_million; }
  /// A separate generator, independent of how often this one is used afterwards.
  [[nodiscard]] constexpr Random fork() noexcept { return Random(next()); }

 private:
  static constexpr std::uint64_t rotl(std::uint64_t x, int k) noexcept { return (x << k) | (x >> (64 - k)); }
  static constexpr std::uint64_t split_mix(std::uint64_t& seed) noexcept {
    std::uint64_t z = (seed += 0x9E3779B97F4A7C15ULL);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
  }
  std::uint64_t state_[4]{};
};

}  // namespace berth

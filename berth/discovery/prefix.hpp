/// A node of the tree of bits of one 32-bit part: its upper bits are fixed, the others are free.
#pragma once

#include <cstdint>

namespace berth::discovery {

struct Prefix {
  std::uint32_t value = 0;  ///< the free bits are 0
  std::uint8_t bit = 32;    ///< the lowest fixed bit: 32 = none, 0 = the whole number

  /// Its children and its sibling. `bit` must not be 0; for the sibling, not 32.
  [[nodiscard]] constexpr Prefix zero() const noexcept { return {value, static_cast<std::uint8_t>(bit - 1U)}; }
  [[nodiscard]] constexpr Prefix one() const noexcept {
    return {value | 1U << (bit - 1U), static_cast<std::uint8_t>(bit - 1U)};
  }
  [[nodiscard]] constexpr Prefix brother() const noexcept { return {value ^ 1U << bit, bit}; }
  /// The child `width` bits further down; `bit` must be at least `width`.
  [[nodiscard]] constexpr Prefix child(std::uint32_t chunk, unsigned width) const noexcept {
    return {value | chunk << (bit - width), static_cast<std::uint8_t>(bit - width)};
  }
  /// The prefix of `number` that leaves the lowest `bit` bits free.
  [[nodiscard]] static constexpr Prefix of(std::uint32_t number, unsigned bit) noexcept {
    return {bit >= 32 ? 0U : number >> bit << bit, static_cast<std::uint8_t>(bit)};
  }
  [[nodiscard]] constexpr bool contains(std::uint32_t number) const noexcept {
    return bit >= 32 || ((value ^ number) >> bit) == 0;
  }
  friend constexpr bool operator==(const Prefix&, const Prefix&) noexcept = default;
};

}  // namespace berth::discovery

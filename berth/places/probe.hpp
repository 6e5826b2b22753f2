/// An object of a device that tells which place it sits in: a coding in the harness, an input that only the left one
/// has wired (paper 4, S4.19).
#pragma once

#include <cstdint>
#include <optional>

#include "berth/base/ids.hpp"

namespace berth::places {

/// `probe = { object = "6000h:01", value = 1, mask = 0x0F }` of a slot: the device whose object has this value in the
/// bits of `mask` sits in this slot.
struct Probe {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  std::uint32_t value = 0;
  std::uint32_t mask = 0xFFFF'FFFF;

  [[nodiscard]] constexpr bool matches(std::uint32_t read) const noexcept { return ((read ^ value) & mask) == 0; }
  friend bool operator==(const Probe&, const Probe&) = default;
};

/// What was read from an object of a device that no slot can be given to without it.
struct Reading {
  Identity device;
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  std::optional<std::uint32_t> value;  ///< none: the device has no such object, or it is longer than four bytes
  friend bool operator==(const Reading&, const Reading&) = default;
};

}  // namespace berth::places

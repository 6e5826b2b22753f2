/// An object of a device that shows where it sits: a coding in the harness, an input that is wired only on the left one
/// (paper 4, S4.19).
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

/// A value read from a device that cannot get a slot without it.
struct Reading {
  Identity device;
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  std::optional<std::uint32_t> value;  ///< none: the device has no such object, or its value is longer than four bytes
  friend bool operator==(const Reading&, const Reading&) = default;
};

}  // namespace berth::places

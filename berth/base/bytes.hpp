/// Little-endian access to unaligned bytes, the byte order of every CANopen field (CiA 301 §7.1.4).
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace berth {

/// Reads an unsigned integer of `sizeof(T)` bytes at `from`.
template <class T>
[[nodiscard]] constexpr T load_le(const std::uint8_t* from) noexcept {
  static_assert(std::is_unsigned_v<T>);
  T value = 0;
  if constexpr (std::endian::native == std::endian::little) {
    // In one piece: g++ 12 makes one load or store of four bytes of the loop below, but not of eight.
    if (!std::is_constant_evaluated()) {
      std::memcpy(&value, from, sizeof value);
      return value;
    }
  }
  for (std::size_t i = 0; i < sizeof(T); ++i) value = static_cast<T>(value | (static_cast<T>(from[i]) << (8 * i)));
  return value;
}

/// Writes `sizeof(T)` bytes at `to`.
template <class T>
constexpr void store_le(std::uint8_t* to, T value) noexcept {
  static_assert(std::is_unsigned_v<T>);
  if constexpr (std::endian::native == std::endian::little) {
    if (!std::is_constant_evaluated()) {
      std::memcpy(to, &value, sizeof value);
      return;
    }
  }
  for (std::size_t i = 0; i < sizeof(T); ++i) to[i] = static_cast<std::uint8_t>(value >> (8 * i));
}

}  // namespace berth

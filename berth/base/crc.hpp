/// Checksums. The CAN frame's own CRC-15 is in `berth/can/length.hpp`.
#pragma once

#include <cstdint>
#include <span>

namespace berth {

/// CRC-16/XMODEM of the SDO block transfer: polynomial 1021h, initial 0, no reflection, no final XOR;
/// "123456789" gives 31C3h (CiA 301 §7.2.4.3.16). `crc` continues an earlier part.
[[nodiscard]] std::uint16_t crc16(std::span<const std::uint8_t> bytes, std::uint16_t crc = 0) noexcept;

/// CRC-32 (IEEE 802.3, reflected, as zlib's): guards a device's non-volatile records. "123456789" gives CBF43926h.
[[nodiscard]] std::uint32_t crc32(std::span<const std::uint8_t> bytes, std::uint32_t crc = 0) noexcept;

}  // namespace berth

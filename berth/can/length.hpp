/// How long a classic frame is on the wire, exactly and at worst. Bits include SOF, stuff bits, CRC and ACK
/// delimiters, EOF and the three bits of intermission (Bosch CAN 2.0; facts page G.1, G.4).
#pragma once

#include "berth/can/frame.hpp"

namespace berth::can {

/// The exact number of bits of this classic frame, stuff bits counted.
[[nodiscard]] unsigned exact_bits(const Frame& frame) noexcept;

/// The usual bound: 55 + 10s (base), 80 + 10s (extended); s data bytes, 0 for a remote frame. Never reached.
[[nodiscard]] unsigned worst_case_bits(bool extended, unsigned data_bytes) noexcept;

/// The length that some frame of this kind really has at most: fixed fields and the CRC cannot be stuffed at will.
[[nodiscard]] unsigned reachable_most_bits(bool extended, unsigned data_bytes) noexcept;

/// The CRC-15 of a classic frame (polynomial 4599h, initial 0) over SOF to the last data bit, unstuffed.
[[nodiscard]] std::uint16_t crc15(const Frame& frame) noexcept;

}  // namespace berth::can

/// How long a frame is on the wire, exactly and at worst. Bits include SOF, stuff bits, CRC and ACK
/// delimiters, EOF and the three bits of intermission (Bosch CAN 2.0; ISO 11898-1:2015 for FD;
/// docs/protocols/can-frames.md §Frame layout, §Lengths).
#pragma once

#include <optional>

#include "berth/can/frame.hpp"

namespace berth::can {

/// The exact number of bits of this classic frame, with stuff bits.
[[nodiscard]] unsigned exact_bits(const Frame& frame) noexcept;

/// The usual bound: 55 + 10s (base), 80 + 10s (extended); s data bytes, 0 for a remote frame. Never reached.
[[nodiscard]] unsigned worst_case_bits(bool extended, unsigned data_bytes) noexcept;

/// The largest length that a frame of this kind can really have: fixed fields and the CRC limit the stuffing.
[[nodiscard]] unsigned reachable_most_bits(bool extended, unsigned data_bytes) noexcept;

/// The CRC-15 of a classic frame (polynomial 4599h, initial 0) over SOF to the last data bit, unstuffed.
[[nodiscard]] std::uint16_t crc15(const Frame& frame) noexcept;

/// The exact length of an FD frame, in bits, by its phases. Stuff bits depend on the content only in the frame's head
/// and data; stuff count and CRC have stuff bits at fixed places, so their values do not affect the length.
struct FdBits {
  unsigned head = 0;  ///< SOF to BRS, at the nominal bit rate
  unsigned data = 0;  ///< ESI to CRC delimiter, at the data bit rate if the frame has BRS
  unsigned tail = 0;  ///< ACK slot to intermission, at the nominal bit rate: always 12
  [[nodiscard]] unsigned all() const noexcept { return head + data + tail; }
  friend bool operator==(const FdBits&, const FdBits&) = default;
};
/// BRS counts wholly to the head and the CRC delimiter wholly to the data. Both are cut at their sample points; if that
/// point is the same share of a bit in both phases, the sum is exact. `frame.esi` counts: set it as it is sent.
[[nodiscard]] FdBits exact_fd_bits(const Frame& frame) noexcept;

/// The DLC of an FD frame of so many bytes; empty for a number that FD does not allow.
[[nodiscard]] std::optional<unsigned> fd_dlc(unsigned bytes) noexcept;

}  // namespace berth::can

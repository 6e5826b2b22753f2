#include "berth/can/length.hpp"

namespace berth::can {
namespace {

// The stuffed part of a frame is worked through byte by byte. Its head (start of frame to DLC) is put right in whole
// bytes, so that the data bytes stand whole behind it; leading bits that are missing are filled up by alternating ones.
constexpr unsigned base_head = 19;      // SOF, 11, RTR, IDE, r0, DLC: in 3 bytes
constexpr unsigned extended_head = 39;  // SOF, 11, SRR, IDE, 18, RTR, r1, r0, DLC: in 5 bytes
constexpr unsigned longest = 5 + 8;     // bytes of head and data

struct Tables {
  // The CRC is linear: that of a message is the sum of those of its bytes, each followed by as many zero bytes.
  std::uint16_t crc[longest][256];
  // For each run state (value of the last bit, run length 1..4) and byte: stuff bits << 4 | next state.
  std::uint8_t run[8][256];
};

constexpr unsigned shift_crc(unsigned crc, unsigned bits) noexcept {
  while (bits-- > 0) crc = (crc & 0x4000U) != 0 ? ((crc << 1) ^ 0x4599U) & 0x7FFFU : (crc << 1) & 0x7FFFU;
  return crc;
}

// Run state 2 * (length - 1) + value. Five equal bits are followed by a stuff bit, which begins the next run.
constexpr std::uint8_t run_over(unsigned state, unsigned byte) noexcept {
  unsigned stuffed = 0;
  for (int i = 7; i >= 0; --i) {
    const unsigned bit = (byte >> i) & 1U;
    if (bit != (state & 1U)) {
      state = bit;
    } else if (state / 2 < 3) {
      state += 2;
    } else {
      state = bit ^ 1U;
      ++stuffed;
    }
  }
  return static_cast<std::uint8_t>(stuffed << 4 | state);
}

constexpr Tables make_tables() noexcept {
  Tables t{};
  for (unsigned byte = 0; byte < 256; ++byte) {
    unsigned crc = shift_crc(byte << 7, 8);
    for (auto& column : t.crc) {
      column[byte] = static_cast<std::uint16_t>(crc);
      crc = shift_crc(crc, 8);
    }
    for (unsigned state = 0; state < 8; ++state) t.run[state][byte] = run_over(state, byte);
  }
  return t;
}

constexpr Tables tables = make_tables();

struct Bytes {
  std::uint8_t bytes[longest + 2];
  unsigned count;
  unsigned crc;
};

// Head and data; fillers are 0, which the CRC does not see.
Bytes message(const Frame& f) noexcept {
  Bytes m;
  const std::uint64_t rtr = f.remote ? 1U : 0U;
  const std::uint64_t size = f.size < 8 ? f.size : 8U;
  std::uint64_t head = 0;
  if (f.extended) {
    const std::uint64_t id = f.id;
    head = (id >> 18 & 0x7FFU) << 27 | 3ULL << 25 | (id & 0x3FFFFU) << 7 | rtr << 6 | size;
    m.count = 5;
  } else {
    head = (f.id & 0x7FFULL) << 7 | rtr << 6 | size;
    m.count = 3;
  }
  for (unsigned i = 0; i < m.count; ++i) m.bytes[i] = static_cast<std::uint8_t>(head >> (8 * (m.count - 1 - i)));
  const unsigned data = f.remote ? 0 : static_cast<unsigned>(size);
  std::memcpy(m.bytes + m.count, f.data.data(), 8);
  m.count += data;
  unsigned crc = 0;
  for (unsigned i = 0; i < m.count; ++i) crc ^= tables.crc[m.count - 1 - i][m.bytes[i]];
  m.crc = crc;
  return m;
}

}  // namespace

std::uint16_t crc15(const Frame& frame) noexcept { return static_cast<std::uint16_t>(message(frame).crc); }

unsigned exact_bits(const Frame& frame) noexcept {
  Bytes m = message(frame);
  // Fillers in front: 10101 and 1, so that the run before start of frame has length 1. One behind the CRC: the opposite
  // of its last bit never completes a run of five.
  m.bytes[0] |= frame.extended ? 0x80U : 0xA8U;
  const unsigned tail = m.crc << 1 | (~m.crc & 1U);
  m.bytes[m.count] = static_cast<std::uint8_t>(tail >> 8);
  m.bytes[m.count + 1] = static_cast<std::uint8_t>(tail);
  unsigned state = 0;
  unsigned stuffed = 0;
  for (unsigned i = 0; i < m.count + 2; ++i) {
    const unsigned entry = tables.run[state][m.bytes[i]];
    state = entry & 7U;
    stuffed += entry >> 4;
  }
  const unsigned filled = frame.extended ? 5 * 8 - extended_head : 3 * 8 - base_head;
  return 8 * m.count - filled + 15 + stuffed + 13;  // CRC delimiter, ACK slot and delimiter, EOF 7, intermission 3
}

unsigned worst_case_bits(bool extended, unsigned data_bytes) noexcept {
  return (extended ? 80U : 55U) + 10U * data_bytes;
}

unsigned reachable_most_bits(bool extended, unsigned data_bytes) noexcept {
  // Facts page G.4: over all identifiers and payloads.
  constexpr unsigned base[] = {53, 62, 72, 83, 93, 102, 113, 124, 133};
  constexpr unsigned ext[] = {78, 88, 98, 108, 118, 128, 138, 148, 158};
  const unsigned n = data_bytes < 8 ? data_bytes : 8;
  return extended ? ext[n] : base[n];
}

}  // namespace berth::can

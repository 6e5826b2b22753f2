#include "berth/can/length.hpp"

namespace berth::can {
namespace {

// The stuffed part of a frame as up to 118 bits (54 + 64), first bit first, in 64-bit words from the top.
struct Bits {
  std::uint64_t words[3]{};
  unsigned count = 0;
  void put(std::uint64_t value, unsigned n) noexcept {
    // Left-aligned append, at most 64 bits at a time.
    if (n == 0) return;
    value &= n == 64 ? ~0ULL : (1ULL << n) - 1;
    const unsigned word = count / 64;
    const unsigned used = count % 64;
    const unsigned room = 64 - used;
    if (n <= room) {
      words[word] |= value << (room - n);
    } else {
      words[word] |= value >> (n - room);
      words[word + 1] |= value << (64 - (n - room));
    }
    count += n;
  }
  [[nodiscard]] unsigned byte(unsigned i) const noexcept { return (words[i / 8] >> (56 - 8 * (i % 8))) & 0xFFU; }
  [[nodiscard]] unsigned bit(unsigned i) const noexcept { return (words[i / 64] >> (63 - i % 64)) & 1U; }
};

struct Tables {
  std::uint16_t crc[256];
  // For each run state (value of the last bit, run length 1..4; 0 = nothing yet) and byte: stuff bits and next state.
  std::uint8_t stuffed[10][256];
  std::uint8_t next[10][256];
};

struct Run {
  unsigned state;    // 2 * (length - 1) + value, length 1..5; 5 never rests (a stuff bit follows)
  unsigned stuffed;
};

constexpr Run step(unsigned state, unsigned bit, bool empty) noexcept {
  const unsigned value = state & 1U;
  const unsigned length = state / 2 + 1;
  if (empty || bit != value) return {bit, 0};
  if (length + 1 < 5) return {2 * length + bit, 0};
  return {bit ^ 1U, 1};  // the stuff bit starts the next run
}

constexpr Tables make_tables() noexcept {
  Tables t{};
  for (unsigned byte = 0; byte < 256; ++byte) {
    unsigned crc = byte << 7;
    for (int i = 0; i < 8; ++i) crc = (crc & 0x4000U) != 0 ? ((crc << 1) ^ 0x4599U) & 0x7FFFU : (crc << 1) & 0x7FFFU;
    t.crc[byte] = static_cast<std::uint16_t>(crc);
    for (unsigned state = 0; state < 8; ++state) {
      Run run{state, 0};
      for (int i = 7; i >= 0; --i) {
        const Run one = step(run.state, (byte >> i) & 1U, false);
        run = {one.state, run.stuffed + one.stuffed};
      }
      t.stuffed[state][byte] = static_cast<std::uint8_t>(run.stuffed);
      t.next[state][byte] = static_cast<std::uint8_t>(run.state);
    }
  }
  return t;
}

constexpr Tables tables = make_tables();

Bits stuffed_part(const Frame& f) noexcept {
  Bits b;
  const unsigned rtr = f.remote ? 1U : 0U;
  if (f.extended) {
    // SOF, 11 bits, SRR, IDE, 18 bits, RTR, r1, r0, DLC
    b.put(f.id >> 18, 12);
    b.put(3, 2);
    b.put(f.id & 0x3FFFFU, 18);
    b.put(rtr, 1);
    b.put(0, 2);
  } else {
    b.put(f.id, 12);
    b.put(rtr, 1);
    b.put(0, 2);
  }
  b.put(f.size < 8 ? f.size : 8, 4);
  for (const auto byte : f.bytes()) b.put(byte, 8);
  return b;
}

std::uint16_t crc_of(const Bits& b) noexcept {
  unsigned crc = 0;
  const unsigned whole = b.count / 8;
  for (unsigned i = 0; i < whole; ++i) crc = ((crc << 8) ^ tables.crc[((crc >> 7) ^ b.byte(i)) & 0xFFU]) & 0x7FFFU;
  for (unsigned i = whole * 8; i < b.count; ++i) {
    const unsigned top = ((crc >> 14) ^ b.bit(i)) & 1U;
    crc = (crc << 1) & 0x7FFFU;
    if (top != 0) crc ^= 0x4599U;
  }
  return static_cast<std::uint16_t>(crc);
}

}  // namespace

std::uint16_t crc15(const Frame& frame) noexcept { return crc_of(stuffed_part(frame)); }

unsigned exact_bits(const Frame& frame) noexcept {
  Bits b = stuffed_part(frame);
  b.put(crc_of(b), 15);
  // The first byte begins with SOF (dominant); a recessive run of one before it adds nothing to any run.
  unsigned state = 1;
  unsigned stuffed = 0;
  const unsigned whole = b.count / 8;
  for (unsigned i = 0; i < whole; ++i) {
    const unsigned byte = b.byte(i);
    stuffed += tables.stuffed[state][byte];
    state = tables.next[state][byte];
  }
  for (unsigned i = whole * 8; i < b.count; ++i) {
    const Run one = step(state, b.bit(i), false);
    state = one.state;
    stuffed += one.stuffed;
  }
  return b.count + stuffed + 13;  // CRC delimiter, ACK slot and delimiter, EOF 7, intermission 3
}

unsigned worst_case_bits(bool extended, unsigned data_bytes) noexcept { return (extended ? 80U : 55U) + 10U * data_bytes; }

unsigned reachable_most_bits(bool extended, unsigned data_bytes) noexcept {
  // Facts page G.4: over all identifiers and payloads.
  constexpr unsigned base[] = {53, 62, 72, 83, 93, 102, 113, 124, 133};
  constexpr unsigned ext[] = {78, 88, 98, 108, 118, 128, 138, 148, 158};
  const unsigned n = data_bytes < 8 ? data_bytes : 8;
  return extended ? ext[n] : base[n];
}

}  // namespace berth::can

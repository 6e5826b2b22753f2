#include "berth/can/length.hpp"

#include <utility>

namespace berth::can {
namespace {

// The stuffed part of a frame is processed byte by byte. The head (start of frame to DLC) is aligned to the end of
// whole bytes, so that the data bytes after it are whole. Alternating bits fill the unused bits in front.
constexpr unsigned base_head = 19;      // SOF, 11, RTR, IDE, r0, DLC: in 3 bytes
constexpr unsigned extended_head = 39;  // SOF, 11, SRR, IDE, 18, RTR, r1, r0, DLC: in 5 bytes
constexpr unsigned longest = 5 + 8;     // bytes of head and data

struct Tables {
  // The CRC is linear: the CRC of a message is the sum of the CRCs of its bytes, each followed by as many zero bytes as
  // bytes follow it.
  std::uint16_t crc[longest][256];
  // For each run state (value of the last bit, run length 1..4) and byte: next state << 8 | stuff bits.
  std::uint16_t run[8 * 256];
};

constexpr unsigned shift_crc(unsigned crc, unsigned bits) noexcept {
  while (bits-- > 0) crc = (crc & 0x4000U) != 0 ? ((crc << 1) ^ 0x4599U) & 0x7FFFU : (crc << 1) & 0x7FFFU;
  return crc;
}

// Run state 2 * (length - 1) + value. Five equal bits are followed by a stuff bit, which begins the next run.
constexpr std::uint16_t run_over(unsigned state, unsigned byte) noexcept {
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
  return static_cast<std::uint16_t>(state << 8 | stuffed);
}

constexpr Tables make_tables() noexcept {
  Tables t{};
  for (unsigned byte = 0; byte < 256; ++byte) {
    unsigned crc = shift_crc(byte << 7, 8);
    for (auto& column : t.crc) {
      column[byte] = static_cast<std::uint16_t>(crc);
      crc = shift_crc(crc, 8);
    }
    for (unsigned state = 0; state < 8; ++state) t.run[state << 8 | byte] = run_over(state, byte);
  }
  return t;
}

constexpr Tables tables = make_tables();

struct Head {
  std::uint64_t bits;
  unsigned bytes;
};

// Start of frame to DLC, in the last bits of that many bytes.
inline Head head_of(const Frame& f) noexcept {
  const std::uint64_t rtr = f.remote ? 1U : 0U;
  const std::uint64_t size = f.size < 8 ? f.size : 8U;
  const std::uint64_t id = f.id;
  if (!f.extended) return {(id & base_mask) << 7 | rtr << 6 | size, 3};
  return {(id >> 18 & base_mask) << 27 | 3ULL << 25 | (id & 0x3FFFFU) << 7 | rtr << 6 | size, 5};
}

unsigned data_bytes(const Frame& f) noexcept { return f.remote ? 0U : f.size < 8U ? f.size : 8U; }

}  // namespace

std::uint16_t crc15(const Frame& frame) noexcept {
  const Head head = head_of(frame);
  const unsigned data = data_bytes(frame);
  unsigned crc = 0;
  for (unsigned i = 0; i < head.bytes; ++i) crc ^= tables.crc[data + i][head.bits >> (8 * i) & 0xFFU];
  for (unsigned i = 0; i < data; ++i) crc ^= tables.crc[data - 1 - i][frame.data[i]];
  return static_cast<std::uint16_t>(crc);
}

namespace {

// The CRC, and the number of stuff bits up to the byte that was taken last.
struct Counter {
  unsigned crc = 0;
  unsigned state = 0;  // shifted left by 8
  unsigned sum = 0;    // of entries: the low byte counts the stuff bits, at most 2 in each of 15 entries
  void stuff(unsigned byte) noexcept {
    const unsigned entry = tables.run[state | byte];
    state = entry & 0x700U;
    sum += entry;
  }
  // `column`: the table for the number of zero bytes that follow.
  void take(unsigned byte, const std::uint16_t (*column)[256]) noexcept {
    crc ^= (*column)[byte];
    stuff(byte);
  }
  // These have no loop: it would cost a third more.
  template <std::size_t... i>
  void take_head(const Head& head, std::uint64_t fillers, unsigned data, std::index_sequence<i...>) noexcept {
    const auto place = [](std::size_t nth) { return 8 * (sizeof...(i) - 1 - nth); };
    ((crc ^= tables.crc[data + sizeof...(i) - 1 - i][head.bits >> place(i) & 0xFFU],
      stuff((head.bits | fillers) >> place(i) & 0xFFU)),
     ...);
  }
  template <std::size_t... i>
  void take_data(const Frame& frame, std::index_sequence<i...>) noexcept {
    (take(frame.data[i], tables.crc + (sizeof...(i) - 1 - i)), ...);
  }
};

}  // namespace

unsigned exact_bits(const Frame& frame) noexcept {
  const Head head = head_of(frame);
  const unsigned data = data_bytes(frame);
  Counter counter;
  // Fill bits in front, which are not part of the CRC: 10101 or 1, so that the run before start of frame has length 1.
  if (frame.extended) {
    counter.take_head(head, 1ULL << 39, data, std::make_index_sequence<5>());
  } else {
    counter.take_head(head, 0x15ULL << 19, data, std::make_index_sequence<3>());
  }
  if (data == 8) {
    counter.take_data(frame, std::make_index_sequence<8>());
  } else {
    for (unsigned i = 0; i < data; ++i) counter.take(frame.data[i], tables.crc + (data - 1 - i));
  }
  // One fill bit after the CRC: the opposite of the last CRC bit never completes a run of five.
  const unsigned crc = counter.crc;
  counter.stuff(crc >> 7);
  counter.stuff((crc << 1 | (~crc & 1U)) & 0xFFU);
  const unsigned plain = (frame.extended ? extended_head : base_head) + 8 * data + 15;
  return plain + (counter.sum & 0xFFU) + 13;  // CRC delimiter, ACK slot and delimiter, EOF 7, intermission 3
}

unsigned worst_case_bits(bool extended, unsigned data_bytes) noexcept {
  return (extended ? 80U : 55U) + 10U * data_bytes;
}

unsigned reachable_most_bits(bool extended, unsigned data_bytes) noexcept {
  // docs/protocols/can-frames.md §Lengths: over all identifiers and payloads.
  constexpr unsigned base[] = {53, 62, 72, 83, 93, 102, 113, 124, 133};
  constexpr unsigned ext[] = {78, 88, 98, 108, 118, 128, 138, 148, 158};
  const unsigned n = data_bytes < 8 ? data_bytes : 8;
  return extended ? ext[n] : base[n];
}

namespace {

// Counts bits and their stuff bits, up to the end of the data field.
struct FdCounter {
  unsigned count = 0;
  unsigned run = 0;
  unsigned last = 2;
  void put(std::uint32_t value, unsigned bits) noexcept {
    while (bits-- > 0) {
      const unsigned bit = value >> bits & 1U;
      if (run == 5) {  // not sooner: after the last data bit, the fixed stuff bit comes instead
        ++count;
        last ^= 1U;
        run = 1;
      }
      run = bit == last ? run + 1 : 1;
      last = bit;
      ++count;
    }
  }
};

}  // namespace

FdBits exact_fd_bits(const Frame& frame) noexcept {
  FdCounter counter;
  counter.put(0, 1);
  if (frame.extended) {
    counter.put(frame.id >> 18, 11);
    counter.put(3, 2);  // SRR, IDE
    counter.put(frame.id & 0x3FFFFU, 18);
    counter.put(0b010, 3);  // RRS, FDF, res
  } else {
    counter.put(frame.id, 11);
    counter.put(0b0010, 4);  // RRS, IDE, FDF, res
  }
  counter.put(frame.brs ? 1 : 0, 1);
  const unsigned head = counter.count;
  counter.put(frame.esi ? 1 : 0, 1);
  counter.put(fd_dlc(frame.size).value_or(15), 4);
  for (unsigned i = 0; i < frame.size; ++i) counter.put(frame.data[i], 8);
  const bool long_crc = frame.size > 16;
  const unsigned check = 4 + (long_crc ? 21 + 7 : 17 + 6);  // stuff count, CRC, fixed stuff bits
  return {head, counter.count - head + check + 1, 12};
}

std::optional<unsigned> fd_dlc(unsigned bytes) noexcept {
  if (bytes <= 8) return bytes;
  constexpr unsigned long_sizes[] = {12, 16, 20, 24, 32, 48, 64};
  for (unsigned i = 0; i < 7; ++i) {
    if (long_sizes[i] == bytes) return 9 + i;
  }
  return std::nullopt;
}

}  // namespace berth::can

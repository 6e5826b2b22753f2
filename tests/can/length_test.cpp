// Lengths against the vectors of Bosch's rules (docs/protocols/can-frames.md §Frame layout, §Lengths), worked out by
// hand-checkable bit strings elsewhere.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/can/length.hpp"

#include "berth/base/random.hpp"

using namespace berth;
using can::exact_bits;

namespace {

unsigned bits(const char* text) { return exact_bits(*can::parse_frame(text)); }

// The slow and obvious way: lay out every bit, append the CRC, stuff.
unsigned slow_bits(const can::Frame& f) {
  std::vector<int> v;
  const auto put = [&](std::uint32_t value, int n) {
    for (int i = n - 1; i >= 0; --i) v.push_back(static_cast<int>((value >> i) & 1U));
  };
  put(0, 1);
  if (f.extended) {
    put(f.id >> 18, 11);
    put(3, 2);
    put(f.id & 0x3FFFF, 18);
    put(f.remote, 1);
    put(0, 2);
  } else {
    put(f.id, 11);
    put(f.remote, 1);
    put(0, 2);
  }
  put(f.size, 4);
  if (!f.remote) {
    for (unsigned i = 0; i < f.size; ++i) put(f.data[i], 8);
  }
  std::uint32_t crc = 0;
  for (const int bit : v) {
    const bool top = (((crc >> 14) & 1U) ^ static_cast<unsigned>(bit)) != 0;
    crc = (crc << 1) & 0x7FFF;
    if (top) crc ^= 0x4599;
  }
  put(crc, 15);
  unsigned stuffed = 0;
  int last = -1;
  int run = 0;
  for (const int bit : v) {
    run = bit == last ? run + 1 : 1;
    last = bit;
    if (run == 5) {
      ++stuffed;
      last = 1 - bit;
      run = 1;
    }
  }
  return static_cast<unsigned>(v.size()) + stuffed + 13;
}

can::Frame random_frame(Random& random) {
  can::Frame f;
  f.extended = random.below(2) != 0;
  f.id = static_cast<std::uint32_t>(random.below(f.extended ? 1U << 29 : 1U << 11));
  f.remote = random.below(8) == 0;
  f.size = static_cast<std::uint8_t>(random.below(9));
  const auto kind = random.below(3);
  for (unsigned i = 0; i < 8; ++i) {
    f.data[i] = kind == 0 ? 0 : kind == 1 ? 0xFF : static_cast<std::uint8_t>(random.next());
  }
  return f;
}

}  // namespace

TEST(Length, VectorsOfTheFactsPage) {
  // docs/protocols/can-frames.md §Lengths
  EXPECT_EQ(bits("080#"), 51U);
  EXPECT_EQ(bits("000#0100"), 68U);
  EXPECT_EQ(bits("701#05"), 58U);
  EXPECT_EQ(bits("77F#7F"), 59U);
  EXPECT_EQ(bits("081#0000000000000000"), 126U);
  EXPECT_EQ(bits("181#0000000000000000"), 126U);
  EXPECT_EQ(bits("181#FFFFFFFFFFFFFFFF"), 124U);
  EXPECT_EQ(bits("601#4000100000000000"), 124U);
  EXPECT_EQ(bits("181#5555555555555555"), 112U);
  // docs/protocols/can-frames.md §Lengths: the usual bounds
  EXPECT_EQ(bits("000#8200"), 69U);
  EXPECT_EQ(bits("701#00"), 59U);
  EXPECT_EQ(bits("701#R"), 49U);
  EXPECT_EQ(bits("7E5#5100000000800000"), 123U);
  EXPECT_EQ(bits("7E4#4F00000000000000"), 126U);
  EXPECT_EQ(bits("1F900135#"), 70U);
  EXPECT_EQ(bits("00000100#"), 74U);
  EXPECT_EQ(bits("00001019#"), 72U);
  EXPECT_EQ(bits("1F940000#80000000"), 110U);
  EXPECT_EQ(bits("1F940000#8000000000000000"), 148U);
  EXPECT_EQ(bits("1F500000#"), 74U);
  EXPECT_EQ(bits("1F940000#80080005"), 109U);
  EXPECT_EQ(bits("1F900014#"), 72U);
}

TEST(Length, EqualsTheSlowCount) {
  Random random(7);
  for (int i = 0; i < 20000; ++i) {
    const auto f = random_frame(random);
    ASSERT_EQ(exact_bits(f), slow_bits(f)) << can::to_string(f);
  }
}

TEST(Length, NeverAboveTheReachableMost) {
  Random random(8);
  for (int i = 0; i < 200000; ++i) {
    const auto f = random_frame(random);
    const unsigned bytes = f.remote ? 0 : f.size;
    ASSERT_LE(exact_bits(f), can::reachable_most_bits(f.extended, bytes)) << can::to_string(f);
  }
  EXPECT_EQ(can::worst_case_bits(false, 8), 135U);
  EXPECT_EQ(can::worst_case_bits(true, 8), 160U);
}

// The table of §Lengths, over ALL frames of a kind: a walk over (bits so far, run of equal bits, CRC so far) that keeps
// the most and the least stuff bits with which a state can be reached. No frame is left out and none is guessed.
#pragma GCC optimize("O2")
namespace {

struct Extremes {
  unsigned least;
  unsigned most;
};

constexpr unsigned crc_states = 1U << 15;
constexpr unsigned run_states = 8;  // (length 1..4) x (value of the last bit)

struct Layer {
  std::vector<std::uint8_t> least = std::vector<std::uint8_t>(crc_states * run_states, 0xFF);
  std::vector<std::uint8_t> most = std::vector<std::uint8_t>(crc_states * run_states, 0);
};

struct Next {
  unsigned run;
  unsigned stuffed;
};

Next after(unsigned run, unsigned bit) {
  if ((run & 1U) != bit) return {bit, 0};
  if (run / 2 + 1 < 4) return {run + 2, 0};
  return {bit ^ 1U, 1};
}

void walk(const Layer& from, Layer& to, unsigned bit) {
  for (unsigned crc = 0; crc < crc_states; ++crc) {
    const unsigned shifted = (crc << 1) & (crc_states - 1);
    const unsigned next_crc = ((crc >> 14) ^ bit) != 0 ? shifted ^ 0x4599U : shifted;
    for (unsigned run = 0; run < run_states; ++run) {
      const unsigned here = crc * run_states + run;
      if (from.least[here] == 0xFF) continue;
      const Next next = after(run, bit);
      const unsigned there = next_crc * run_states + next.run;
      to.least[there] = static_cast<std::uint8_t>(std::min<unsigned>(to.least[there], from.least[here] + next.stuffed));
      to.most[there] = static_cast<std::uint8_t>(std::max<unsigned>(to.most[there], from.most[here] + next.stuffed));
    }
  }
}

Extremes extremes(bool extended, unsigned size) {
  // '0', '1' fixed, 'x' free: SOF, identifier and control field as §Frame layout lays them out, then the data.
  std::string bits = extended ? "0xxxxxxxxxxx11xxxxxxxxxxxxxxxxxx000" : "0xxxxxxxxxxx000";
  for (int i = 3; i >= 0; --i) bits += ((size >> i) & 1U) != 0 ? '1' : '0';
  bits += std::string(8UL * size, 'x');
  Layer layer;
  layer.least[1] = layer.most[1] = 0;  // before SOF: one recessive bit, which SOF ends
  for (const char kind : bits) {
    Layer next;
    if (kind != '1') walk(layer, next, 0);
    if (kind != '0') walk(layer, next, 1);
    layer = std::move(next);
  }
  Extremes result{1000, 0};
  for (unsigned crc = 0; crc < crc_states; ++crc) {
    for (unsigned run = 0; run < run_states; ++run) {
      const unsigned here = crc * run_states + run;
      if (layer.least[here] == 0xFF) continue;
      Next last{run, 0};
      unsigned stuffed = 0;
      for (int i = 14; i >= 0; --i) {
        last = after(last.run, (crc >> i) & 1U);
        stuffed += last.stuffed;
      }
      const auto fixed = static_cast<unsigned>(bits.size()) + 15 + 13;
      result.least = std::min(result.least, fixed + layer.least[here] + stuffed);
      result.most = std::max(result.most, fixed + layer.most[here] + stuffed);
    }
  }
  return result;
}

}  // namespace

TEST(Length, G4_ReachableMaximaOverAllFrames) {
  constexpr unsigned base_least[] = {48, 56, 64, 72, 79, 87, 95, 103, 111};
  constexpr unsigned base_most[] = {53, 62, 72, 83, 93, 102, 113, 124, 133};
  constexpr unsigned extended_most[] = {78, 88, 98, 108, 118, 128, 138, 148, 158};
  for (unsigned size = 0; size <= 8; ++size) {
    const auto base = extremes(false, size);
    EXPECT_EQ(base.least, base_least[size]) << size;
    EXPECT_EQ(base.most, base_most[size]) << size;
    EXPECT_EQ(can::reachable_most_bits(false, size), base_most[size]);
    EXPECT_EQ(extremes(true, size).most, extended_most[size]) << size;
    EXPECT_EQ(can::reachable_most_bits(true, size), extended_most[size]);
  }
}

// --- FD: ISO 11898-1:2015; docs/protocols/can-frames.md §Frame layout. Worked out by hand: head 17 (base) or 36
// (extended), data phase ESI 1, DLC 4, 8 for each byte, then stuff count 4, CRC 17 with 6 fixed stuff bits or CRC 21
// with 7, CRC delimiter 1.
namespace {

can::FdBits fd(const char* text) { return can::exact_fd_bits(*can::parse_frame(text)); }

can::Frame fd_frame(std::uint32_t id, unsigned size, unsigned value, bool brs = true) {
  can::Frame f;
  f.id = id;
  f.fd = true;
  f.brs = brs;
  f.size = static_cast<std::uint8_t>(size);
  for (unsigned i = 0; i < size; ++i) f.data[i] = static_cast<std::uint8_t>(value);
  return f;
}

}  // namespace

TEST(FdLength, EmptyBaseFrame) {
  // 0 10101010101 0 0 1 0 1 | 0 0000: five dominant bits end the data field: the fixed stuff bit stands there.
  EXPECT_EQ(fd("555##1"), (can::FdBits{17, 1 + 4 + 4 + 17 + 6 + 1, 12}));
  // Without BRS: res, BRS, ESI and two of DLC are five dominant bits: one stuff bit before the other two.
  EXPECT_EQ(fd("555##0"), (can::FdBits{17, 34, 12}));
  // ESI recessive breaks that run.
  EXPECT_EQ(fd("555##2"), (can::FdBits{17, 33, 12}));
  // SOF, 11 of the identifier, RRS and IDE: 14 dominant bits, two stuff bits.
  EXPECT_EQ(fd("000##1"), (can::FdBits{19, 33, 12}));
  // 0 11111 [0] 11111 [0] 1 00 1 0 1
  EXPECT_EQ(fd("7FF##1"), (can::FdBits{19, 33, 12}));
}

TEST(FdLength, ExtendedFrame) {
  // 0 01010101010 11 010101010101010101 0 1 0 1 | 0 0000
  EXPECT_EQ(fd("0AA95555##1"), (can::FdBits{36, 33, 12}));
  // Identifier 0: SOF and 11 dominant: two stuff bits; SRR and IDE; 18 of the identifier and RRS: three stuff bits.
  EXPECT_EQ(fd("00000000##1"), (can::FdBits{41, 33, 12}));
}

TEST(FdLength, EightBytes) {
  EXPECT_EQ(can::exact_fd_bits(fd_frame(0x555, 8, 0x55)), (can::FdBits{17, 33 + 64, 12}));
  // DLC 1000 and 64 dominant bits: a run of 67, 13 stuff bits.
  EXPECT_EQ(can::exact_fd_bits(fd_frame(0x555, 8, 0x00)), (can::FdBits{17, 33 + 64 + 13, 12}));
  // DLC 1000, then 64 recessive: 12 stuff bits.
  EXPECT_EQ(can::exact_fd_bits(fd_frame(0x555, 8, 0xFF)), (can::FdBits{17, 33 + 64 + 12, 12}));
  // DLC 0101 and 40 dominant bits: eight runs of five, of which the last is at the end: seven stuff bits.
  EXPECT_EQ(can::exact_fd_bits(fd_frame(0x555, 5, 0x00)), (can::FdBits{17, 33 + 40 + 7, 12}));
}

TEST(FdLength, TheLongerCrcBeyondSixteenBytes) {
  // DLC of 16 is 1010: no run of five with 0x55 behind it (…10 01…).
  EXPECT_EQ(can::exact_fd_bits(fd_frame(0x555, 16, 0x55)), (can::FdBits{17, 33 + 128, 12}));
  EXPECT_EQ(can::exact_fd_bits(fd_frame(0x555, 20, 0x55)), (can::FdBits{17, 38 + 160, 12}));
  EXPECT_EQ(can::exact_fd_bits(fd_frame(0x555, 64, 0x55)), (can::FdBits{17, 38 + 512, 12}));
  // DLC 1111: 512 dominant bits, 102 stuff bits; 516 recessive ones, 103.
  EXPECT_EQ(can::exact_fd_bits(fd_frame(0x555, 64, 0x00)), (can::FdBits{17, 38 + 512 + 102, 12}));
  EXPECT_EQ(can::exact_fd_bits(fd_frame(0x555, 64, 0xFF)), (can::FdBits{17, 38 + 512 + 103, 12}));
}

TEST(FdLength, BetweenItsBounds) {
  Random random(11);
  constexpr unsigned sizes[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
  for (int i = 0; i < 20000; ++i) {
    can::Frame f = fd_frame(0, sizes[random.below(16)], 0, random.below(2) != 0);
    f.extended = random.below(2) != 0;
    f.esi = random.below(2) != 0;
    f.id = static_cast<std::uint32_t>(random.below(f.extended ? 1U << 29 : 1U << 11));
    const auto kind = random.below(3);
    for (unsigned k = 0; k < f.size; ++k) {
      f.data[k] = static_cast<std::uint8_t>(kind == 0 ? 0 : kind == 1 ? 0xFF : random.next());
    }
    const auto bits = can::exact_fd_bits(f);
    const unsigned head = f.extended ? 36 : 17;
    const unsigned stuffed = 5 + 8U * f.size;
    const unsigned data = stuffed + (f.size > 16 ? 33 : 28);
    ASSERT_GE(bits.head, head);
    ASSERT_GE(bits.data, data);
    ASSERT_LE(bits.head, head + (head - 1) / 4);
    ASSERT_LE(bits.all(), head + data + 12 + (head + stuffed - 1) / 4) << can::to_string(f);
    ASSERT_EQ(bits.tail, 12U);
  }
}

TEST(FdLength, Dlc) {
  EXPECT_EQ(can::fd_dlc(8), 8U);
  EXPECT_EQ(can::fd_dlc(12), 9U);
  EXPECT_EQ(can::fd_dlc(64), 15U);
  EXPECT_FALSE(can::fd_dlc(9));
  EXPECT_FALSE(can::fd_dlc(63));
  EXPECT_FALSE(can::fd_dlc(65));
}

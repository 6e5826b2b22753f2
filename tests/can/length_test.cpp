// Lengths against the vectors of Bosch's rules (facts page G.1, G.4), worked out by hand-checkable bit strings elsewhere.
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
  // G.4
  EXPECT_EQ(bits("080#"), 51U);
  EXPECT_EQ(bits("000#0100"), 68U);
  EXPECT_EQ(bits("701#05"), 58U);
  EXPECT_EQ(bits("77F#7F"), 59U);
  EXPECT_EQ(bits("081#0000000000000000"), 126U);
  EXPECT_EQ(bits("181#0000000000000000"), 126U);
  EXPECT_EQ(bits("181#FFFFFFFFFFFFFFFF"), 124U);
  EXPECT_EQ(bits("601#4000100000000000"), 124U);
  EXPECT_EQ(bits("181#5555555555555555"), 112U);
  // G.1
  EXPECT_EQ(bits("000#8200"), 69U);
  EXPECT_EQ(bits("701#00"), 59U);
  EXPECT_EQ(bits("701#R1"), 49U);
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

// G.4's table: for every data length the least and the most are reached by some frame. The extremes were searched for
// over structured payloads: runs that stuff most need patterns 11111 00001 1110 ...
TEST(Length, ReachableMaximaAreReached) {
  for (const bool extended : {false, true}) {
    for (unsigned size = 0; size <= 8; ++size) {
      unsigned most = 0;
      Random random(size + (extended ? 100U : 0U));
      // Hill climbing over the frame's bits, many starts.
      for (int start = 0; start < 400 && most < can::reachable_most_bits(extended, size); ++start) {
        can::Frame f;
        f.extended = extended;
        f.id = static_cast<std::uint32_t>(random.below(extended ? 1U << 29 : 1U << 11));
        f.size = static_cast<std::uint8_t>(size);
        for (unsigned i = 0; i < size; ++i) f.data[i] = (i % 2 != 0 ? 0x87 : 0x78);
        unsigned here = exact_bits(f);
        for (int tries = 0; tries < 4000; ++tries) {
          can::Frame g = f;
          const auto flips = 1 + random.below(3);
          for (std::uint64_t k = 0; k < flips; ++k) {
            const auto bit = random.below((extended ? 29U : 11U) + 8U * size);
            if (bit < (extended ? 29U : 11U)) {
              g.id ^= 1U << bit;
            } else {
              const auto at = bit - (extended ? 29U : 11U);
              g.data[at / 8] = static_cast<std::uint8_t>(g.data[at / 8] ^ (1U << (at % 8)));
            }
          }
          const unsigned there = exact_bits(g);
          if (there >= here) {
            f = g;
            here = there;
          }
        }
        most = std::max(most, here);
      }
      EXPECT_EQ(most, can::reachable_most_bits(extended, size)) << (extended ? "extended " : "base ") << size;
    }
  }
}

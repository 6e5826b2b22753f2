// Lengths against the vectors of Bosch's rules (facts page G.1, G.4), worked out by hand-checkable bit strings
// elsewhere.
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

// G.4's table, over ALL frames of a kind: a walk over (bits so far, run of equal bits, CRC so far) that keeps the most
// and the least stuff bits with which a state can be reached. No frame is left out and none is guessed.
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
  // '0', '1' fixed, 'x' free: SOF, identifier and control field as section G.1 lays them out, then the data.
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

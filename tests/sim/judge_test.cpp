// The bus against the judge (bit_model.hpp): random frames, disturbances and things that happen to nodes, among up
// to 8.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <vector>

#include "judge_plan.hpp"

namespace judge {
namespace {

using berth::Random;
using Kind = Act::Kind;

Plan draw(std::uint64_t seed, bool disturbed) {
  Random dice(seed);
  Plan plan = draw_traffic(dice, seed % 3 == 0 ? 8 : 4);
  if (disturbed) draw_disturbances(dice, plan, 4);
  return plan;
}

// The results of a bit-by-bit model, collisions, merging and fault confinement included.
TEST(Judge, RandomFramesWithoutDisturbance) {
  std::uint64_t collisions = 0;
  for (std::uint64_t seed = 1; seed <= 1500; ++seed) {
    Result r;
    ASSERT_TRUE(agree(draw(seed, false), &r)) << "seed " << seed;
    collisions += r.collisions;
  }
  EXPECT_GT(collisions, 100U);
}

TEST(Judge, RandomFramesAndDisturbedBits) {
  for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
    ASSERT_TRUE(agree(draw(seed, true))) << "seed " << seed;
  }
}

TEST(Judge, OrderWithinAnInstantDoesNotMatter) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    ASSERT_TRUE(agree(draw(seed, seed % 2 == 0), nullptr, seed)) << "seed " << seed;
  }
}

// Power, restarts and cables at any bit of a run, among nodes of which many are near bus-off.
Plan draw_changes(std::uint64_t seed) {
  Random dice(seed);
  Plan plan = draw_traffic(dice, 8);
  for (auto& node : plan.nodes) {
    if (!node.listen_only && dice.below(3) == 0) node.tec = 255 - static_cast<unsigned>(dice.below(9));
  }
  draw_disturbances(dice, plan, 6);
  const auto any = [&] { return static_cast<int>(dice.below(plan.nodes.size())); };
  const auto some_time = [&](std::uint64_t most) { return 1000 * static_cast<Time>(dice.below(most)); };
  for (auto left = 1 + dice.below(5); left > 0; --left) {
    const int node = any();
    const Time when = some_time(900);
    switch (dice.below(5)) {
      case 0:
        plan.acts.push_back({when, Kind::power_off, node});
        plan.acts.push_back({when + some_time(300), Kind::power_on, node});
        break;
      case 1:
        plan.acts.push_back({when, Kind::unplug, node});
        plan.acts.push_back({when + some_time(300), Kind::plug, node});
        break;
      case 2: {
        Act apart{when, Kind::apart};
        for (int i = 0; i < static_cast<int>(plan.nodes.size()); ++i) {
          if (dice.below(2) == 0) apart.others.push_back(i);
        }
        plan.acts.push_back(apart);
        plan.acts.push_back({when + some_time(300), Kind::join});
        break;
      }
      default: plan.acts.push_back({when, Kind::restart, node}); break;
    }
  }
  // Whoever is bus-off by then is told to come back, amid traffic.
  for (int i = 0; i < static_cast<int>(plan.nodes.size()); ++i)
    plan.acts.push_back({1'000'000 + some_time(100), Kind::restart, i});
  for (auto left = dice.below(20); left > 0; --left)
    plan.acts.push_back({1'200'000 + some_time(2000), Kind::send, any(), draw_frame(dice)});
  plan.until = 4'000'000;
  std::ranges::stable_sort(plan.acts, {}, &Act::when);
  return plan;
}

// HU.34: docs/protocols/can-frames.md §Fault confinement rule 12 among them.
TEST(Judge, G3_PowerCablesAndRecoveryFromBusOff) {
  std::uint64_t recovered = 0;
  for (std::uint64_t seed = 1; seed <= 800; ++seed) {
    Result r;
    ASSERT_TRUE(agree(draw_changes(seed), &r)) << "seed " << seed;
    recovered += r.recovered;
  }
  EXPECT_GT(recovered, 100U);
}

// One or two nodes of another bit rate than the others' 1 Mbit/s.
Plan draw_rates(std::uint64_t seed, bool listening) {
  Random dice(seed);
  Plan plan = draw_traffic(dice, 7);
  const auto strangers = 1 + dice.below(2);
  for (std::uint64_t i = 0; i < strangers; ++i) {
    NodePlan stranger{draw_counter(dice, false), draw_counter(dice, true), dice.below(2) == 0};
    if (listening) stranger = {.listen_only = true};
    stranger.bit = dice.below(2) == 0 ? 2000 : 4000;
    const auto node = static_cast<int>(plan.nodes.size());
    plan.nodes.push_back(stranger);
    if (!listening && dice.below(2) == 0)
      plan.acts.push_back({1000 * static_cast<Time>(dice.below(600)), Kind::send, node, draw_frame(dice)});
  }
  return plan;
}

// docs/protocols/can-frames.md §Fault confinement: a node of another bit rate takes frames for errors and destroys
// them, as others destroy its own.
TEST(Judge, G3_NodesOfOtherBitRates) {
  std::uint64_t struck = 0;
  std::uint64_t off = 0;
  std::vector<std::uint64_t> seeds{1869};  // two begin at one edge, and a disturbance parts their group in between
  for (std::uint64_t seed = 1; seed <= 600; ++seed) seeds.push_back(seed);
  for (const auto seed : seeds) {
    Plan plan = draw_rates(seed, false);
    if (seed % 3 == 0) {
      Random dice(seed);
      draw_disturbances(dice, plan, 3);
    }
    Result r;
    ASSERT_TRUE(agree(plan, &r, seed % 2)) << "seed " << seed;
    struck += r.errors > 0 ? 1U : 0U;
    for (const auto& [tec, rec, is_off] : r.counters) off += is_off ? 1U : 0U;
  }
  EXPECT_GT(struck, 450U);
  EXPECT_GT(off, 100U);
}

// Listening only it sends neither flags nor acknowledgements: the others are as if it were not there.
TEST(Judge, G3_WhoOnlyListensAtAnotherBitRateHarmsNobody) {
  std::uint64_t frames = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    Plan plan = draw_rates(seed, true);
    Result with;
    ASSERT_TRUE(agree(plan, &with)) << "seed " << seed;
    std::size_t others = plan.nodes.size();
    while (plan.nodes[others - 1].bit != 1000) --others;
    plan.nodes.resize(others);
    Result without;
    ASSERT_TRUE(agree(plan, &without)) << "seed " << seed;
    std::erase_if(with.events, [&](const Event& e) { return e.node >= static_cast<int>(others); });
    with.counters.resize(others);
    ASSERT_EQ(with.events, without.events) << "seed " << seed;
    ASSERT_EQ(with.counters, without.counters) << "seed " << seed;
    frames += with.events.size();
  }
  EXPECT_GT(frames, 1000U);
}

// FD frames beside classic ones.
Plan draw_fd(std::uint64_t seed) {
  Random dice(seed);
  Plan plan = draw_traffic(dice, 8);
  const Time fast[] = {125, 200, 250, 500};
  plan.fast_bit = fast[dice.below(4)];
  const std::uint8_t sizes[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
  for (auto& act : plan.acts) {
    if (dice.below(3) == 0) continue;
    Frame& f = act.frame;
    f.fd = true;
    f.remote = false;
    f.brs = dice.below(3) != 0;
    f.size = sizes[dice.below(16)];
    const auto kind = dice.below(3);
    for (unsigned i = 0; i < f.size; ++i)
      f.data[i] = static_cast<std::uint8_t>(kind == 0 ? 0 : kind == 1 ? 0xFF : dice.next());
  }
  if (seed % 2 == 0) draw_disturbances(dice, plan, 2);
  return plan;
}

TEST(Judge, FdFramesBesideClassicOnes) {
  std::uint64_t whole = 0;
  std::uint64_t destroyed = 0;
  for (std::uint64_t seed = 1; seed <= 500; ++seed) {
    Result r;
    ASSERT_TRUE(agree(draw_fd(seed), &r)) << "seed " << seed;
    whole += r.whole_fd;
    destroyed += r.destroyed_fd;
  }
  EXPECT_GT(whole, 500U);
  EXPECT_GT(destroyed, 50U);
}

// ---- the judge itself ----

// docs/protocols/can-frames.md §Frame layout, §Lengths, interframe space included: figures that neither this judge nor
// the product computed.
TEST(Judge, G4_LengthsOfTheTable) {
  const std::pair<const char*, unsigned> table[] = {
      {"080#", 51},
      {"000#0100", 68},
      {"701#05", 58},
      {"77F#7F", 59},
      {"000#8200", 69},
      {"701#00", 59},
      {"701#R", 49},
      {"1F900135#", 70},
      {"00000100#", 74},
      {"00001019#", 72},
      {"1F500000#", 74},
      {"1F900014#", 72},
      {"081#0000000000000000", 126},
      {"181#0000000000000000", 126},
      {"181#FFFFFFFFFFFFFFFF", 124},
      {"601#4000100000000000", 124},
      {"181#5555555555555555", 112},
      {"7E5#5100000000800000", 123},
      {"7E4#4F00000000000000", 126},
      {"1F940000#80000000", 110},
      {"1F940000#8000000000000000", 148},
      {"1F940000#80080005", 109},
  };
  for (const auto& [text, bits] : table) {
    EXPECT_EQ(encode(*berth::can::parse_frame(text)).dominant.size() + 3, bits) << text;
  }
  constexpr unsigned base_least[] = {48, 56, 64, 72, 79, 87, 95, 103, 111};
  constexpr unsigned base_most[] = {53, 62, 72, 83, 93, 102, 113, 124, 133};
  constexpr unsigned extended_most[] = {78, 88, 98, 108, 118, 128, 138, 148, 158};
  Random dice(9);
  for (int i = 0; i < 20'000; ++i) {
    Frame f = draw_frame(dice);
    if (f.remote) continue;
    if (dice.below(2) == 0) f.id = static_cast<std::uint32_t>(dice.below(f.extended ? 1U << 29 : 1U << 11));
    const auto bits = encode(f).dominant.size() + 3;
    ASSERT_LE(bits, f.extended ? extended_most[f.size] : base_most[f.size]) << berth::can::to_string(f);
    if (f.extended) continue;
    ASSERT_GE(bits, base_least[f.size]) << berth::can::to_string(f);
  }
}

// docs/protocols/can-frames.md §Frame layout (FD), worked out by hand: 17 bits of head, 12 of tail; ESI, DLC, data,
// stuff count 4 and CRC 17 with 6 fixed stuff bits or 21 with 7, CRC delimiter; stuff bits where five are equal.
TEST(Judge, LengthsOfFdFrames) {
  const auto frame = [](unsigned size, unsigned value) {
    Frame f;
    f.id = 0x555;
    f.fd = f.brs = true;
    f.size = static_cast<std::uint8_t>(size);
    for (unsigned i = 0; i < size; ++i) f.data[i] = static_cast<std::uint8_t>(value);
    return f;
  };
  const auto fast = [&](unsigned size, unsigned value) { return fd_length(frame(size, value)).fast; };
  EXPECT_EQ(fd_length(frame(0, 0)).nominal, 17U + 12);
  EXPECT_EQ(fast(0, 0), 33U);
  EXPECT_EQ(fast(8, 0x55), 33U + 64);
  EXPECT_EQ(fast(8, 0x00), 33U + 64 + 13);  // 1000 and 64 dominant bits: a run of 67
  EXPECT_EQ(fast(8, 0xFF), 33U + 64 + 12);
  EXPECT_EQ(fast(16, 0x55), 33U + 128);
  EXPECT_EQ(fast(20, 0x55), 38U + 160);
  EXPECT_EQ(fast(64, 0x00), 38U + 512 + 102);
  EXPECT_EQ(fast(64, 0xFF), 38U + 512 + 103);
  Frame slow = frame(0, 0);
  slow.brs = false;  // res, BRS, ESI and two of DLC: one stuff bit more
  EXPECT_EQ(fd_length(slow).nominal, 17U + 12 + 34);
  EXPECT_EQ(fd_length(slow).fast, 0U);
}

TEST(Judge, ReadsEveryKindOfFrame) {
  Random dice(5);
  for (int i = 0; i < 5000; ++i) {
    const Frame f = draw_frame(dice);
    Reading reading;
    for (const char dominant : encode(f).dominant) reading.push(dominant != 0);
    ASSERT_TRUE(reading.delimiter && reading.crc_right);
    ASSERT_EQ(reading.frame, f) << berth::can::to_string(f);
  }
}

}  // namespace
}  // namespace judge

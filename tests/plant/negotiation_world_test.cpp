// S2.1, S2.12 to S2.30: worlds of devices that agree on their node-IDs without a master.
#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <set>

#include "tests/harness/negotiation_world.hpp"

namespace berth::harness {
namespace {

using namespace std::chrono_literals;

struct Built {
  explicit Built(const PlantFile& file) : world(plant::World::make(file, {}, findings)) { world->start(); }
  [[nodiscard]] std::string fault() const { return negotiation_fault(*world); }
  /// Runs until every device has its own node-ID; when that was.
  std::optional<rt::Duration> settled(rt::Duration limit) {
    const auto begin = world->sim().now();
    while (world->sim().now() - begin < limit) {
      world->sim().run_for(10ms);
      if (fault().empty()) return world->sim().now() - begin;
    }
    return std::nullopt;
  }
  void run(rt::Duration time) { world->sim().run_for(time); }
  [[nodiscard]] plant::SimDevice& device(std::size_t i) { return *world->devices()[i]; }
  Findings findings;
  std::unique_ptr<plant::World> world;
};

PlantFile several(unsigned count, std::uint32_t bit_rate = 125'000) {
  auto file = negotiation_plant(bit_rate);
  for (unsigned i = 0; i < count; ++i) {
    file.devices.push_back(negotiating_device(fmt::format("d{}", i + 1), {0x319, 2, 0x10000, 0x1000 + i}));
    file.devices.back().heartbeat = 1s;
  }
  return file;
}

// S2.1, S2.30: N devices take about N cycles of 280 ms: ten about 2.8 s.
TEST(NegotiationWorld, TenDevicesTakeTenCycles) {
  Built w(several(10));
  const auto time = w.settled(10s);
  ASSERT_TRUE(time) << w.fault();
  EXPECT_GT(*time, 2500ms);
  EXPECT_LT(*time, 3400ms);
}

// S2.30, S2.29: 127 at once, and one too many, which says so and stays where it is.
TEST(NegotiationWorld, AllNodeIdsAndOneDeviceMore) {
  auto file = several(127);
  file.devices.push_back(negotiating_device("late", {1, 1, 1, 1}));
  file.devices.back().plugged = false;
  Built w(file);
  const auto time = w.settled(60s);
  ASSERT_TRUE(time) << w.fault();
  EXPECT_LT(*time, 50s) << "127 cycles of 280 ms are 36 s";
  EXPECT_TRUE(w.world->duplicates().empty());
  w.device(127).plug();
  w.run(5s);
  EXPECT_EQ(w.device(127).device().schemes().negotiator()->state(), research::Negotiating::exhausted);
  EXPECT_EQ(w.device(127).device().state(), NmtState::initialising);
  EXPECT_TRUE(w.fault().empty()) << w.fault();
  w.device(3).unplug();  // a place is free: it is taken
  w.run(12s);
  EXPECT_TRUE(w.device(127).truth().active.configured());
  EXPECT_TRUE(w.fault().empty()) << w.fault();
}

// After a power failure each gets what it had; one that was exchanged takes another.
TEST(NegotiationWorld, EverybodyRestarts) {
  Built w(several(6));
  ASSERT_TRUE(w.settled(10s));
  const auto before = held(*w.world);
  for (std::size_t i = 0; i < 6; ++i) w.device(i).power(false);
  w.run(1s);
  for (std::size_t i = 0; i < 6; ++i) w.device(i).power(true);
  ASSERT_TRUE(w.settled(10s)) << w.fault();
  EXPECT_EQ(held(*w.world), before);
}

// A joiner takes nothing from who is there.
TEST(NegotiationWorld, JoinersDisturbNobody) {
  auto file = several(8);
  for (std::size_t i = 4; i < 8; ++i) file.devices[i].plugged = false;
  Built w(file);
  ASSERT_TRUE(w.settled(10s));
  const auto before = held(*w.world);
  for (std::size_t i = 4; i < 8; ++i) {
    w.device(i).plug();
    w.run(1500ms);
    ASSERT_TRUE(w.fault().empty()) << w.fault();
  }
  const auto after = held(*w.world);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(after[i], before[i]);
}

// S2.24: two of one identity that get power at one instant: the announcement of the one tells the other.
TEST(NegotiationWorld, ClonesPart) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    auto file = negotiation_plant(125'000, seed);
    file.devices.push_back(negotiating_device("a", {0x319, 2, 3, 4}));
    file.devices.push_back(negotiating_device("b", {0x319, 2, 3, 4}));
    Built w(file);
    w.run(40s);
    ASSERT_TRUE(w.fault().empty()) << seed << ": " << w.fault();
  }
}

// Two segments that have settled by themselves, all with the same node-IDs, become one. With a heartbeat it is told
// within a second or two; without any traffic the checks tell it.
TEST(NegotiationWorld, TwoSettledSegmentsAreJoined) {
  for (const auto heartbeat : {1000ms, 0ms}) {
    auto file = several(8);
    for (std::size_t i = 0; i < 8; ++i) {
      file.devices[i].heartbeat = heartbeat;
      file.devices[i].address.serial = 0x1000 + static_cast<std::uint32_t>(i % 4);  // four pairs of clones
    }
    Built w(file);
    std::vector<sim::Controller*> right;
    for (std::size_t i = 4; i < 8; ++i) right.push_back(&w.device(i).controller());
    w.device(0).bus().split(right);
    w.run(10s);
    EXPECT_EQ(w.world->duplicates().size(), 4U) << "each segment by itself took the same";
    w.device(0).bus().join();
    const auto time = w.settled(negotiation_bound(8));
    ASSERT_TRUE(time) << w.fault();
    if (heartbeat > 0ms) {
      EXPECT_LT(*time, 15s);
    }
    w.run(60s);
    EXPECT_TRUE(w.fault().empty()) << w.fault();
  }
}

// S2.25: bytes that one of two does not hear: two winners are harmless, two equal node-IDs are told apart.
TEST(NegotiationWorld, LostFrames) {
  for (std::uint32_t skip = 0; skip < 40; ++skip) {
    auto file = negotiation_plant(125'000, skip + 1);
    file.devices.push_back(negotiating_device("a", {0x319, 2, 3, 4}));
    file.devices.push_back(negotiating_device("b", {0x319, 2, 3, 5}));
    file.devices.push_back(negotiating_device("c", {0x319, 2, 3, 6}));
    PlantEvent lost;
    lost.action = Action::overrun;
    lost.bus = "line";
    lost.nodes = {"b"};
    lost.strike.skip = skip;
    lost.strike.times = 3;
    file.events.push_back(lost);
    EXPECT_EQ(run_negotiation(file), "") << skip;
  }
}

// The issue: within a bounded time after the last disturbance every device holds its own node-ID or says why not.
TEST(NegotiationWorld, RandomMixes) {
  for (std::uint64_t seed = 1; seed <= 150; ++seed) {
    const auto wrong = try_negotiation(seed);
    EXPECT_EQ(wrong, "") << "seed " << seed;
  }
}

}  // namespace
}  // namespace berth::harness

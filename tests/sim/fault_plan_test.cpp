// Which frames a bus's faults strike, and what they do to one frame: without a bus.
#include <gtest/gtest.h>
#include <cstdint>
#include <vector>

#include "berth/sim/fault_plan.hpp"
#include "berth/sim/frame_faults.hpp"
#include "berth/sim/world.hpp"

namespace {

using namespace berth;
using Kind = sim::Fault::Kind;

struct Plan {
  sim::FaultPlan plan{Random(1)};
  const can::Frame frame = can::Frame::base(0x181, {1});

  // The numbers of the frames struck among the next `count`.
  std::vector<std::uint64_t> struck(int count) {
    std::vector<std::uint64_t> numbers;
    for (int i = 0; i < count; ++i) {
      const std::uint64_t number = plan.started();
      plan.strike({frame, number, rt::Time{}, 0}, [&](const sim::Fault&) { numbers.push_back(number); });
      plan.count_start();
    }
    return numbers;
  }
};

TEST(SimFaultPlan, SkipsThenStrikesAsOftenAsAsked) {
  Plan p;
  p.plan.add({.trigger = {.skip = 2, .times = 3}});
  EXPECT_TRUE(p.plan.any());
  EXPECT_EQ(p.struck(10), (std::vector<std::uint64_t>{2, 3, 4}));
  EXPECT_FALSE(p.plan.any());
}

TEST(SimFaultPlan, FramesThatDoNotFitAreNotSkippedOnes) {
  Plan p;
  p.plan.add({.trigger = {.when = [](const sim::FrameStart& start) { return start.number % 2 == 1; }, .skip = 1}});
  EXPECT_EQ(p.struck(8), (std::vector<std::uint64_t>{3}));
}

TEST(SimFaultPlan, ForEverUntilCancelled) {
  Plan p;
  const unsigned number = p.plan.add({.trigger = {.times = 0}});
  EXPECT_EQ(p.struck(3).size(), 3U);
  EXPECT_FALSE(p.plan.cancel(number + 1));
  EXPECT_TRUE(p.plan.cancel(number));
  EXPECT_FALSE(p.plan.cancel(number));
  EXPECT_TRUE(p.struck(3).empty());
}

TEST(SimFaultPlan, EachFaultHasItsOwnNumber) {
  Plan p;
  const unsigned first = p.plan.add({.trigger = {.frame = 1}});
  p.plan.add({.trigger = {.frame = 2}});
  ASSERT_TRUE(p.plan.cancel(first));
  EXPECT_EQ(p.struck(4), (std::vector<std::uint64_t>{2}));
}

struct Nodes {
  sim::World world;
  sim::Bus& bus = world.add_bus("bus", 500'000);
  std::unique_ptr<sim::Controller> a = bus.attach();
  std::unique_ptr<sim::Controller> b = bus.attach();
  const std::vector<const sim::Controller*> both{a.get(), b.get()};
};

TEST(SimFaultPlan, DrawsStayWithinTheFrameAndTheNodes) {
  Nodes n;
  sim::FaultPlan plan{Random(7)};
  EXPECT_FALSE(plan.draw_flip(n.both, 100).has_value());
  EXPECT_EQ(plan.draw_overrun(n.both), nullptr);
  plan.draw_from({.disturbed_per_million = 1'000'000, .overrun_per_million = 1'000'000});
  EXPECT_TRUE(plan.any());
  bool one = false;
  bool two = false;
  for (int i = 0; i < 200; ++i) {
    const auto flip = plan.draw_flip(n.both, 100);
    ASSERT_TRUE(flip.has_value());
    EXPECT_GE(flip->bit, 0);
    EXPECT_LT(flip->bit, 100);
    one = one || flip->victims.size() == 1;
    two = two || flip->victims.size() == 2;
    ASSERT_FALSE(flip->victims.empty());
    EXPECT_NE(plan.draw_overrun(n.both), nullptr);
  }
  EXPECT_TRUE(one && two);
}

TEST(SimFaultPlan, NodeThatGoesIsNoVictimAnyMore) {
  Nodes n;
  sim::FaultPlan plan{Random(1)};
  plan.add({.victims = {n.a.get(), n.b.get()}});
  plan.forget(*n.a);
  const can::Frame frame = can::Frame::base(0x181, {1});
  std::vector<const sim::Controller*> victims;
  plan.strike({frame, 0, rt::Time{}, 0}, [&](const sim::Fault& fault) { victims = fault.victims; });
  EXPECT_EQ(victims, (std::vector<const sim::Controller*>{n.b.get()}));
}

TEST(SimFrameFaults, AVictimSeesItsBitsOnly) {
  Nodes n;
  sim::FrameFaults faults;
  faults.disturb({Kind::flip, 3, 4, {n.a.get()}, false});
  EXPECT_TRUE(faults.disturbed());
  EXPECT_TRUE(faults.victim(*n.a));
  EXPECT_FALSE(faults.victim(*n.b));
  for (int bit = 0; bit < 8; ++bit) {
    const bool struck = bit == 3 || bit == 4;
    EXPECT_EQ(faults.seen(*n.a, false, bit, true), !struck) << bit;
    EXPECT_EQ(faults.seen(*n.a, false, bit, false), struck) << bit;
    EXPECT_TRUE(faults.seen(*n.b, false, bit, true)) << bit;
  }
}

TEST(SimFrameFaults, WithoutVictimsAllSeeItAndSendersMayBeSpared) {
  Nodes n;
  sim::FrameFaults faults;
  faults.disturb({Kind::dominant, 1, 1, {}, true});
  EXPECT_FALSE(faults.victim(*n.a));
  EXPECT_TRUE(faults.seen(*n.a, false, 1, false));
  EXPECT_FALSE(faults.seen(*n.a, true, 1, false));
  faults.clear();
  faults.disturb({Kind::recessive, 1, 1, {}, false});
  EXPECT_FALSE(faults.seen(*n.a, true, 1, true));
}

TEST(SimFrameFaults, TheNextFrameIsSound) {
  Nodes n;
  sim::FrameFaults faults;
  faults.disturb({Kind::flip, 0, 0, {}, false});
  faults.lose(*n.a);
  faults.doom();
  EXPECT_TRUE(faults.loses(*n.a));
  EXPECT_FALSE(faults.loses(*n.b));
  faults.end_flaws();
  EXPECT_FALSE(faults.disturbed());
  EXPECT_TRUE(faults.loses(*n.a) && faults.doomed());
  faults.clear();
  EXPECT_FALSE(faults.loses(*n.a) || faults.doomed());
}

}  // namespace

// Who sends its sub-block: one at a time, in the order of asking, and between two the bus is free.
#include "berth/co/block_pace.hpp"

#include <gtest/gtest.h>
#include <array>
#include <chrono>
#include <vector>

#include "berth/sim/world.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

struct Paced {
  struct One final : co::BlockPace::Member {
    void turn() noexcept override {
      turns.push_back(at->now());
      if (take_also != nullptr) static_cast<void>(pace->take(*take_also));
    }
    rt::Executor* at = nullptr;
    co::BlockPace* pace = nullptr;
    One* take_also = nullptr;
    std::vector<rt::Time> turns;
  };
  Paced() {
    for (auto& each : members) {
      each.at = &world.executor();
      each.pace = &pace;
    }
  }
  sim::World world;
  sim::Bus& wire = world.add_bus("bus", 500'000);
  std::unique_ptr<sim::Controller> port = wire.attach({.queue_depth = 16, .rx_depth = 64});
  std::unique_ptr<sim::Controller> other = wire.attach({.queue_depth = 16, .rx_depth = 64});
  can::Dispatcher dispatcher{world.executor(), *port};
  co::BlockPace pace{dispatcher};
  std::array<One, 4> members;
};

}  // namespace

TEST(BlockPace, OneAtATimeInTheOrderOfAsking) {
  Paced p;
  EXPECT_TRUE(p.pace.take(p.members[0]));
  EXPECT_FALSE(p.pace.take(p.members[1]));
  EXPECT_FALSE(p.pace.take(p.members[2]));
  p.world.run_for(16ms);
  EXPECT_TRUE(p.members[1].turns.empty());
  const auto given = p.world.now();
  p.pace.give(p.members[0]);
  EXPECT_FALSE(p.pace.take(p.members[0])) << "behind those that wait";
  p.world.run_for(16ms);
  ASSERT_EQ(p.members[1].turns.size(), 1U);
  EXPECT_EQ(p.members[1].turns[0], given + 1ms) << "a sixteenth of its 16 ms is free";
  EXPECT_TRUE(p.members[2].turns.empty());
  p.pace.give(p.members[1]);
  p.world.run_for(16ms);
  EXPECT_EQ(p.members[2].turns.size(), 1U);
  p.pace.give(p.members[2]);
  p.world.run_for(16ms);
  EXPECT_EQ(p.members[0].turns.size(), 1U);
}

// The free time is for whoever comes behind, also when it was nobody.
TEST(BlockPace, TheBusIsFreeForTheNextOneToo) {
  Paced p;
  ASSERT_TRUE(p.pace.take(p.members[0]));
  p.world.run_for(32ms);
  p.pace.give(p.members[0]);
  EXPECT_FALSE(p.pace.take(p.members[0])) << "it may not go on at once";
  p.world.run_for(3ms);
  EXPECT_EQ(p.members[0].turns.size(), 1U);
  p.pace.give(p.members[0]);
  p.world.run_for(1s);
  EXPECT_TRUE(p.pace.take(p.members[1]));
}

TEST(BlockPace, OneThatLeavesHoldsNobodyUp) {
  Paced p;
  ASSERT_TRUE(p.pace.take(p.members[0]));
  EXPECT_FALSE(p.pace.take(p.members[1]));
  EXPECT_FALSE(p.pace.take(p.members[2]));
  p.pace.leave(p.members[1]);
  p.pace.leave(p.members[3]);  // it never asked
  p.pace.leave(p.members[0]);  // in the middle of its sub-block
  p.world.run_for(1ms);
  EXPECT_TRUE(p.members[1].turns.empty());
  EXPECT_EQ(p.members[2].turns.size(), 1U);
  p.pace.leave(p.members[2]);
  p.world.run_for(1ms);
  EXPECT_TRUE(p.pace.take(p.members[3]));
}

// Frames that a segment outranks lengthen the free time, up to that of the sub-block; PDOs do not.
TEST(BlockPace, HeartbeatsAreLetThrough) {
  for (const std::uint32_t id : {0x705U, 0x185U}) {
    Paced p;
    ASSERT_TRUE(p.pace.take(p.members[0]));
    EXPECT_FALSE(p.pace.take(p.members[1]));
    p.world.run_for(16ms);
    const auto given = p.world.now();
    for (int i = 0; i < 16; ++i) {
      ASSERT_EQ(p.other->send(can::Frame::base(id, std::array<std::uint8_t, 1>{5}), 0), can::Queued::yes);
    }
    p.pace.give(p.members[0]);
    p.world.run_for(50ms);
    ASSERT_EQ(p.members[1].turns.size(), 1U);
    const auto free = p.members[1].turns[0] - given;
    const bool outranked = id > 0x67FU;
    EXPECT_EQ(free > rt::Duration(1700us), outranked) << "sixteen frames of 55 bits at least";
    EXPECT_TRUE(outranked || free == rt::Duration(1ms));
    EXPECT_LE(free, rt::Duration(16ms));
  }
}

TEST(BlockPace, HeartbeatsWithoutEndDoNotStopIt) {
  Paced p;
  ASSERT_TRUE(p.pace.take(p.members[0]));
  EXPECT_FALSE(p.pace.take(p.members[1]));
  p.world.run_for(16ms);
  const auto given = p.world.now();
  p.pace.give(p.members[0]);
  while (p.members[1].turns.empty() && p.world.now() < given + 1s) {
    static_cast<void>(p.other->send(can::Frame::base(0x705, std::array<std::uint8_t, 1>{5}), 0));
    p.world.run_for(100us);
  }
  ASSERT_EQ(p.members[1].turns.size(), 1U);
  EXPECT_EQ(p.members[1].turns[0], given + 16ms);
}

// What `withdraw` means for a frame that is on the wire: it is sent all the same, and not repeated when it fails.
#include <gtest/gtest.h>
#include <chrono>

#include "berth/sim/world.hpp"

namespace berth::sim {
namespace {

using namespace std::chrono_literals;

const can::Frame frame = can::Frame::base(0x123, {1, 2, 3, 4, 5, 6, 7, 8});

TEST(Withdraw, OnTheWireIsSentAllTheSame) {
  World world;
  auto& bus = world.add_bus("bus", 125'000);
  auto sender = bus.attach();
  auto other = bus.attach();
  sender->send(frame, 7);
  world.run_for(200us);
  sender->withdraw(7);
  world.run_for(10ms);
  EXPECT_EQ(sender->statistics().sent, 1U);
  EXPECT_EQ(sender->status().queued, 0U);
}

// Nobody acknowledges: without the withdrawal it would be repeated for ever.
TEST(Withdraw, IsNotRepeated) {
  for (const auto when : {200us, 900us, 3000us, 40'000us}) {
    World world;
    auto& bus = world.add_bus("bus", 125'000);
    auto sender = bus.attach();
    sender->send(frame, 7);
    world.run_for(when);
    ASSERT_EQ(sender->status().queued, 1U);
    sender->withdraw(7);
    world.run_for(5ms);
    EXPECT_EQ(sender->status().queued, 0U) << when.count();
    const auto attempts = sender->statistics().attempts;
    world.run_for(50ms);
    EXPECT_EQ(sender->statistics().attempts, attempts);
    auto other = bus.attach();  // what is queued afterwards goes out
    sender->send(can::Frame::base(0x55, {}), 8);
    world.run_for(20ms);
    EXPECT_EQ(sender->statistics().sent, 1U);
  }
}

// The one behind it in the queue is next.
TEST(Withdraw, TheNextOneFollows) {
  World world;
  auto& bus = world.add_bus("bus", 125'000);
  auto sender = bus.attach();
  sender->send(frame, 7);
  sender->send(can::Frame::base(0x55, {}), 8);
  world.run_for(200us);
  sender->withdraw(7);
  world.run_for(3ms);
  auto other = bus.attach();
  world.run_for(20ms);
  EXPECT_EQ(sender->statistics().sent, 1U);
  EXPECT_EQ(bus.statistics().frames, 1U);
}

}  // namespace
}  // namespace berth::sim

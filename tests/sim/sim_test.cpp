#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <vector>

#include "berth/can/length.hpp"
#include "berth/sim/world.hpp"
#include "berth/sim/world_driver.hpp"

namespace sim_tests {
namespace {

using namespace berth;
using namespace std::chrono_literals;
using can::Frame;

/// Writes down what a port hears.
struct Ear : can::Listener {
  struct Heard {
    Frame frame;
    rt::Time at;
  };
  std::vector<Heard> frames;
  std::vector<std::pair<std::uint32_t, rt::Time>> confirmed;
  std::vector<can::Status> changes;
  void received(const Frame& frame, rt::Time at) noexcept override { frames.push_back({frame, at}); }
  void sent(std::uint32_t tag, rt::Time at) noexcept override { confirmed.emplace_back(tag, at); }
  void changed(const can::Status& status, rt::Time) noexcept override { changes.push_back(status); }
};

const std::vector<can::IdRange> everything{can::all_base, can::all_extended};
rt::Time at_bit(std::int64_t bit, rt::Duration length) { return rt::Time(bit * length); }

/// A node with its ear.
struct Node {
  Node(sim::Bus& bus, const sim::ControllerOptions& options = {}) : port(bus.attach(options)) {
    port->listen(&ear, everything);
  }
  Ear ear;
  std::unique_ptr<sim::Controller> port;
};

TEST(SimBus, FrameArrivesAtTheEndOfItsLastBit) {
  sim::World world;
  sim::Bus& bus = world.add_bus("a", 1'000'000);
  Node a(bus);
  Node b(bus);
  Node c(bus);
  ASSERT_EQ(a.port->send(Frame::base(0x701, {0x05}), 7), can::Queued::yes);
  world.run_for(1ms);
  // docs/protocols/can-frames.md §Lengths: 701#05 has 58 bits with three of intermission.
  ASSERT_EQ(b.ear.frames.size(), 1U);
  ASSERT_EQ(c.ear.frames.size(), 1U);
  EXPECT_EQ(b.ear.frames[0].at, at_bit(55, 1us));
  EXPECT_EQ(b.ear.frames[0].frame, Frame::base(0x701, {0x05}));
  EXPECT_TRUE(a.ear.frames.empty());
  ASSERT_EQ(a.ear.confirmed.size(), 1U);
  EXPECT_EQ(a.ear.confirmed[0], std::make_pair(7U, at_bit(55, 1us)));
  EXPECT_EQ(bus.statistics().frames, 1U);
  EXPECT_EQ(bus.statistics().bits, 58U);
  EXPECT_EQ(bus.statistics().busy, 58us);
}

TEST(SimBus, LowestArbitrationFieldGoesFirst) {
  sim::World world;
  sim::Bus& bus = world.add_bus("a", 1'000'000);
  Node ear(bus);
  // docs/protocols/can-frames.md §Arbitration: base data, base remote, extended data and extended remote of one prefix,
  // in this order.
  const std::vector<Frame> order{Frame::base(0x100, {1}), Frame::request(0x100, 1), Frame::ext(0x100U << 18U, {1}),
                                 [] {
                                   Frame f = Frame::ext(0x100U << 18U, {});
                                   f.remote = true;
                                   return f;
                                 }(),
                                 Frame::base(0x101, {})};
  std::vector<std::unique_ptr<sim::Controller>> nodes;
  for (auto it = order.rbegin(); it != order.rend(); ++it) {
    nodes.push_back(bus.attach());
    nodes.back()->send(*it, 0);
  }
  world.run_for(10ms);
  ASSERT_EQ(ear.ear.frames.size(), order.size());
  unsigned bits = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    EXPECT_EQ(ear.ear.frames[i].frame, order[i]) << i;
    bits += can::exact_bits(order[i]);
    EXPECT_EQ(ear.ear.frames[i].at, at_bit(bits - 3, 1us)) << i;
  }
  EXPECT_EQ(nodes[0]->statistics().arbitration_losses, 4U);
  EXPECT_EQ(nodes[4]->statistics().arbitration_losses, 0U);
}

TEST(SimBus, IdenticalFramesMerge) {
  sim::World world;
  sim::Bus& bus = world.add_bus("a", 1'000'000);
  Node a(bus);
  Node b(bus);
  Node c(bus);
  a.port->send(Frame::ext(0x1F900000, {}), 1);
  b.port->send(Frame::ext(0x1F900000, {}), 2);
  world.run_for(1ms);
  EXPECT_EQ(a.ear.confirmed.size(), 1U);
  EXPECT_EQ(b.ear.confirmed.size(), 1U);
  EXPECT_TRUE(a.ear.frames.empty());
  EXPECT_TRUE(b.ear.frames.empty());
  EXPECT_EQ(c.ear.frames.size(), 1U);
  EXPECT_EQ(bus.statistics().frames, 1U);
  EXPECT_EQ(bus.statistics().merged, 1U);
}

TEST(SimBus, LoneNodeBecomesPassiveAndStays) {
  sim::World world;
  sim::Bus& bus = world.add_bus("a", 1'000'000);
  Node a(bus);
  a.port->send(Frame::base(0x701, {0x05}), 7);
  world.run_for(1s);
  EXPECT_EQ(a.port->errors().tec(), 128);
  EXPECT_EQ(a.port->errors().state(), sim::ErrorState::passive);
  EXPECT_TRUE(a.ear.confirmed.empty());
  Node b(bus);
  world.run_for(1ms);
  EXPECT_EQ(a.ear.confirmed.size(), 1U);
  EXPECT_EQ(a.port->errors().tec(), 127);
  EXPECT_EQ(b.ear.frames.size(), 1U);
}

// docs/protocols/can-frames.md §Lengths: 701#05 ends with its 55th bit, whose sample point is at seven eighths: from
// there on its sender knows that it is out, and a new bit rate does not send it again. Before that it is not out,
// though the receivers have it.
TEST(SimBus, G4_AFrameSentWholeIsNotSentAgainAtAnotherBitRate) {
  struct Case {
    std::chrono::nanoseconds changed;
    std::size_t heard;
    rt::Time confirmed;
  };
  constexpr rt::Duration bit = 8us;
  for (const bool restarts : {false, true}) {
    for (const Case& each :
         {Case{54 * bit + 6us, restarts ? 1U : 2U, {}}, Case{54 * bit + 7500ns, 1, at_bit(55, bit)}}) {
      SCOPED_TRACE(testing::Message() << each.changed.count() << (restarts ? " restart" : " set_bit_rate"));
      sim::World world;
      sim::Bus& bus = world.add_bus("a", 125'000);
      Node a(bus);
      Node b(bus);
      a.port->send(Frame::base(0x701, {0x05}), 7);
      world.run_for(each.changed);
      if (restarts) a.port->restart(250'000);
      if (!restarts) a.port->set_bit_rate(250'000);
      a.port->silent(true);  // until b is at that rate too
      world.run_for(1ms);
      b.port->set_bit_rate(250'000);
      world.run_for(1ms);
      a.port->silent(false);
      world.run_for(10ms);
      EXPECT_EQ(b.ear.frames.size(), each.heard);
      EXPECT_EQ(a.port->statistics().sent, each.confirmed == rt::Time{} && restarts ? 0U : 1U);
      EXPECT_EQ(a.port->status().queued, 0U);
      if (each.confirmed == rt::Time{}) continue;
      ASSERT_EQ(a.ear.confirmed.size(), 1U);
      EXPECT_EQ(a.ear.confirmed[0], std::make_pair(7U, each.confirmed));
    }
  }
}

TEST(WorldDriver, ItStopsInTheInstantThatMakesItTrueElseAtTheTimeAllowed) {
  sim::World world;
  sim::WorldDriver driver(world);
  int done = 0;
  for (const auto when : {3ms, 5ms, 8ms}) world.after(when, [&] { ++done; });
  EXPECT_TRUE(driver.run_until([&] { return done == 2; }, rt::never));
  EXPECT_EQ(driver.now(), rt::Time(5ms));
  EXPECT_FALSE(driver.run_until([&] { return done == 3; }, driver.later(2ms)));
  EXPECT_EQ(driver.now(), rt::Time(7ms));
  driver.run_for(1ms);
  EXPECT_EQ(done, 3);
}

}  // namespace
}  // namespace sim_tests

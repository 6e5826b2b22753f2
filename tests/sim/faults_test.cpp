// What a wire and a node can do wrong, receive buffers, filters, determinism.
#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/can/length.hpp"
#include "berth/sim/world.hpp"
#include "bit_model.hpp"

namespace faults_tests {
namespace {

using namespace berth;
using namespace std::chrono_literals;
using can::Frame;

struct Ear : can::Listener {
  std::vector<std::pair<Frame, rt::Time>> frames;
  std::vector<std::uint32_t> sent_tags;
  std::vector<can::Status> changes;
  void received(const Frame& frame, rt::Time at) noexcept override { frames.emplace_back(frame, at); }
  void sent(std::uint32_t tag, rt::Time) noexcept override { sent_tags.push_back(tag); }
  void changed(const can::Status& status, rt::Time) noexcept override { changes.push_back(status); }
};

struct Node {
  explicit Node(sim::Bus& bus, const sim::ControllerOptions& options = {}) : port(bus.attach(options)) {
    const std::vector<can::IdRange> everything{can::all_base, can::all_extended};
    port->listen(&ear, everything);
  }
  Ear ear;
  std::unique_ptr<sim::Controller> port;
};

struct Scene {
  sim::World world;
  sim::Bus& bus = world.add_bus("bus", 1'000'000);
  Node a{bus};
  Node b{bus};
  Node c{bus};
};
const Frame eight = Frame::base(0x181, {1, 2, 3, 4, 5, 6, 7, 8});

TEST(SimFaults, SingleSlotBufferOverruns) {
  sim::World world;
  sim::Bus& bus = world.add_bus("bus", 1'000'000);
  Node a(bus);
  Node slow(bus, {.rx_depth = 1, .rx_service = 150us});
  Node deep(bus, {.rx_depth = 3, .rx_service = 150us});
  for (int i = 0; i < 3; ++i) a.port->send(eight, 0);
  world.run_for(5ms);
  // A frame each 110 to 130 us, 150 us to take one out: the second comes too early for a single slot.
  EXPECT_EQ(slow.ear.frames.size(), 2U);
  EXPECT_EQ(slow.port->statistics().overruns, 1U);
  EXPECT_EQ(deep.ear.frames.size(), 3U);
  EXPECT_EQ(bus.statistics().error_frames, 0U);
}

TEST(SimFaults, DeafAcknowledgesAndLoses) {
  sim::World world;
  sim::Bus& bus = world.add_bus("bus", 1'000'000);
  Node a(bus);
  Node b(bus);
  b.port->deaf(true);
  a.port->send(eight, 9);
  world.run_for(5ms);
  EXPECT_EQ(a.ear.sent_tags, std::vector<std::uint32_t>{9});
  EXPECT_TRUE(b.ear.frames.empty());
  EXPECT_EQ(b.port->statistics().overruns, 1U);
  b.port->deaf(false);
  a.port->send(eight, 10);
  world.run_for(5ms);
  EXPECT_EQ(b.ear.frames.size(), 1U);
}

TEST(SimFaults, SilentKeepsItsFrames) {
  Scene s;
  s.a.port->silent(true);
  EXPECT_EQ(s.a.port->send(eight, 1), can::Queued::yes);
  s.world.run_for(5ms);
  EXPECT_TRUE(s.b.ear.frames.empty());
  s.a.port->silent(false);
  s.world.run_for(5ms);
  EXPECT_EQ(s.b.ear.frames.size(), 1U);
}

TEST(SimFaults, InjectedOverrunLosesOneFrameOfOneNode) {
  Scene s;
  s.bus.inject({.kind = sim::Fault::Kind::overrun,
                .trigger = {.when = [](const sim::FrameStart& f) { return f.frame.id == 0x181; }, .skip = 1},
                .victims = {s.b.port.get()}});
  for (int i = 0; i < 3; ++i) s.a.port->send(eight, 0);
  s.world.run_for(5ms);
  EXPECT_EQ(s.b.ear.frames.size(), 2U);
  EXPECT_EQ(s.c.ear.frames.size(), 3U);
}

TEST(SimFaults, ListenOnlyHearsAndDoesNotAcknowledge) {
  sim::World world;
  sim::Bus& bus = world.add_bus("bus", 1'000'000);
  Node a(bus);
  Node spy(bus, {.listen_only = true});
  EXPECT_EQ(spy.port->send(eight, 1), can::Queued::listen_only);
  a.port->send(eight, 1);
  world.run_for(5ms);
  EXPECT_TRUE(a.ear.sent_tags.empty());
  EXPECT_EQ(spy.port->errors().rec(), 0);
  Node b(bus);
  world.run_for(5ms);
  EXPECT_EQ(a.ear.sent_tags.size(), 1U);
  // More than once: while a is passive its unacknowledged frame looks whole to who does not care for the ACK slot.
  EXPECT_GT(spy.ear.frames.size(), 1U);
  EXPECT_EQ(spy.port->errors().tec() + spy.port->errors().rec(), 0);
}

TEST(SimFaults, PowerLossMidFrameTruncatesIt) {
  for (int bit = 0; bit < static_cast<int>(judge::encode(eight).dominant.size()); ++bit) {
    Scene s;
    s.bus.inject(
        {.kind = sim::Fault::Kind::act, .where = sim::from_start(bit), .act = [&] { s.a.port->power(false); }});
    s.a.port->send(eight, 1);
    s.b.port->send(Frame::base(0x182, {}), 2);
    s.world.run_for(20ms);
    // Behind the sender's last dominant bit nobody misses it: the rest of a frame is recessive.
    const auto wire = judge::encode(eight);
    const bool whole = std::find(wire.dominant.begin() + bit, wire.dominant.end(), 1) == wire.dominant.end();
    EXPECT_EQ(s.c.ear.frames.size(), whole ? 2U : 1U) << bit;
    EXPECT_EQ(s.b.ear.sent_tags.size(), 1U) << bit;
    EXPECT_FALSE(s.a.port->status().up);
    EXPECT_EQ(s.a.port->send(eight, 1), can::Queued::closed);
    s.a.port->power(true);
    EXPECT_EQ(s.a.port->send(eight, 3), can::Queued::yes);
    s.world.run_for(20ms);
    EXPECT_EQ(s.a.ear.sent_tags.back(), 3U);
  }
}

TEST(SimFaults, PowerLossOfTheOnlyReceiverMidFrame) {
  sim::World world;
  sim::Bus& bus = world.add_bus("bus", 1'000'000);
  Node a(bus);
  Node b(bus);
  a.port->send(eight, 1);
  world.run_for(50us);
  b.port->power(false);
  world.run_for(5ms);
  EXPECT_TRUE(a.ear.sent_tags.empty());
  EXPECT_EQ(a.port->errors().tec(), 128);
  b.port->power(true);
  world.run_for(5ms);
  EXPECT_EQ(a.ear.sent_tags.size(), 1U);
  EXPECT_EQ(b.ear.frames.size(), 1U);
}

// A node that comes while a passive one calls into the void hears it after 11 recessive bits, whenever it comes.
TEST(SimFaults, ComingToALoneNodeAtAnyBit) {
  for (int bit = 0; bit < 160; bit += 2) {
    sim::World world;
    sim::Bus& bus = world.add_bus("bus", 1'000'000);
    Node a(bus);
    Node b(bus, {.powered = false});
    a.port->send(eight, 1);
    world.run_for(20ms + bit * 1us);
    ASSERT_EQ(a.port->errors().tec(), 128);
    std::unique_ptr<Node> c;
    if (bit % 4 == 0) {
      b.port->power(true);
    } else {
      c = std::make_unique<Node>(bus);
    }
    world.run_for(400us);
    EXPECT_EQ(a.ear.sent_tags.size(), 1U) << bit;
    EXPECT_EQ((c ? c->ear : b.ear).frames.size(), 1U) << bit;
    EXPECT_EQ(a.port->errors().tec(), 127) << bit;
  }
}

// A node's integration ends between a frame's start and the sample point of its first bit, or close to it: the frame
// goes on, and the node hears what comes next (seeds 1368 and 1451 of ./run faults stood still here).
TEST(SimFaults, IntegrationEndsWhileAFrameBegins) {
  for (auto later = 20'000ns; later <= 25'000ns; later += 100ns) {
    sim::World world;
    sim::Bus& bus = world.add_bus("bus", 500'000);
    Node a(bus);
    Node c(bus);
    Node b(bus, {.powered = false});
    world.run_for(1ms);
    b.port->power(true);
    world.run_for(later);
    a.port->send(eight, 1);
    world.run_for(1ms);
    EXPECT_EQ(a.ear.sent_tags.size(), 1U) << later.count();
    EXPECT_EQ(c.ear.frames.size(), 1U) << later.count();
    b.ear.frames.clear();
    a.port->send(eight, 2);
    world.run_for(1ms);
    EXPECT_EQ(b.ear.frames.size(), 1U) << later.count();
  }
}

TEST(SimFaults, CutCableLeavesTheNodeAlone) {
  for (int bit = 0; bit < 130; bit += 3) {
    Scene s;
    s.bus.inject(
        {.kind = sim::Fault::Kind::act, .where = sim::from_start(bit), .act = [&] { s.a.port->cable(false); }});
    s.a.port->send(eight, 1);
    s.b.port->send(Frame::base(0x182, {}), 2);
    s.world.run_for(50ms);
    EXPECT_EQ(s.b.ear.sent_tags.size(), 1U) << bit;
    if (s.a.ear.sent_tags.empty()) {
      EXPECT_EQ(s.a.port->errors().tec(), 128) << bit;
    }
    s.a.port->cable(true);
    s.world.run_for(50ms);
    EXPECT_EQ(s.a.ear.sent_tags.size(), 1U) << bit;
    EXPECT_GE(s.c.ear.frames.size(), 2U) << bit;
  }
}

TEST(SimFaults, SplitIsTwoBusesUntilJoined) {
  Scene s;
  Node d(s.bus);
  const std::vector<sim::Controller*> others{s.c.port.get(), d.port.get()};
  for (int run = 0; run < 40; ++run) {
    for (auto* node : {&s.a, &s.b, &s.c, &d}) node->ear.frames.clear();
    s.a.port->send(eight, 1);
    s.c.port->send(Frame::base(0x182, {1}), 1);
    s.world.run_for(run * 7us);
    s.bus.split(others);
    s.world.run_for(5ms);
    for (auto* node : {&s.a, &s.b, &s.c, &d}) node->ear.frames.clear();
    s.a.port->send(eight, 1);
    s.c.port->send(Frame::base(0x182, {1}), 1);
    s.world.run_for(1ms);
    EXPECT_EQ(s.b.ear.frames.size(), 1U) << run;
    EXPECT_EQ(d.ear.frames.size(), 1U) << run;
    s.a.port->send(eight, 1);
    s.world.run_for(3us);
    s.c.port->send(Frame::base(0x182, {1}), 1);
    s.world.run_for(run * 7us);
    s.bus.join();
    s.world.run_for(20ms);
    // Whatever became of the two frames that met, all nodes are on one bus again and nothing is left to send.
    for (auto* node : {&s.a, &s.b, &s.c, &d}) {
      EXPECT_EQ(node->port->status().queued, 0U) << run;
      EXPECT_NE(node->port->errors().state(), sim::ErrorState::bus_off) << run;
      node->ear.frames.clear();
    }
    s.a.port->send(eight, 1);
    s.world.run_for(1ms);
    EXPECT_EQ(d.ear.frames.size(), 1U) << run;
  }
}

TEST(SimBus, PriorityQueueOvertakesInOrderDoesNot) {
  for (const auto order : {sim::TxOrder::in_order, sim::TxOrder::priority}) {
    sim::World world;
    sim::Bus& bus = world.add_bus("bus", 1'000'000);
    Node a(bus, {.queue = order, .queue_depth = 3});
    Node b(bus);
    a.port->send(Frame::base(0x700, {}), 1);
    world.run_for(10us);  // on the wire: nothing overtakes it
    a.port->send(Frame::base(0x600, {}), 2);
    a.port->send(Frame::base(0x500, {}), 3);
    EXPECT_EQ(a.port->send(Frame::base(0x400, {}), 4), can::Queued::full);
    world.run_for(1ms);
    const bool priority = order == sim::TxOrder::priority;
    EXPECT_EQ(a.ear.sent_tags, (priority ? std::vector<std::uint32_t>{1, 3, 2} : std::vector<std::uint32_t>{1, 2, 3}));
  }
}

TEST(SimBus, WithdrawTakesBackWhatIsNotOnTheWire) {
  Scene s;
  s.a.port->send(eight, 1);
  s.a.port->send(eight, 2);
  s.a.port->send(eight, 3);
  s.world.run_for(10us);
  s.a.port->withdraw(1);
  s.a.port->withdraw(2);
  s.world.run_for(5ms);
  EXPECT_EQ(s.a.ear.sent_tags, (std::vector<std::uint32_t>{1, 3}));
}

TEST(SimBus, FiltersDecideWhoHears) {
  sim::World world;
  sim::Bus& bus = world.add_bus("bus", 1'000'000);
  Node a(bus);
  Random dice(3);
  std::vector<std::unique_ptr<Node>> nodes;
  std::vector<std::vector<can::IdRange>> filters(70);
  for (std::size_t i = 0; i < filters.size(); ++i) nodes.push_back(std::make_unique<Node>(bus));
  for (int round = 0; round < 30; ++round) {
    for (std::size_t i = 0; i < filters.size(); ++i) {
      if (dice.below(3) == 0) {
        filters[i].clear();
        for (auto n = dice.below(5); n > 0; --n) {
          const auto first = static_cast<std::uint32_t>(dice.below(40));
          const auto flag = dice.below(2) == 0 ? 0U : can::extended_flag;
          filters[i].push_back({flag | first, flag | (first + static_cast<std::uint32_t>(dice.below(6)))});
        }
        nodes[i]->port->listen(&nodes[i]->ear, filters[i]);
      }
      nodes[i]->ear.frames.clear();
    }
    Frame f = dice.below(2) == 0 ? Frame::base(static_cast<std::uint32_t>(dice.below(45)), {})
                                 : Frame::ext(static_cast<std::uint32_t>(dice.below(45)), {});
    a.port->send(f, 0);
    world.run_for(1ms);
    for (std::size_t i = 0; round > 12 && i < filters.size(); ++i) {
      const bool hears = std::ranges::any_of(filters[i], [&](const auto& r) { return r.contains(f.key()); });
      if (!filters[i].empty()) {
        EXPECT_EQ(nodes[i]->ear.frames.size(), hears ? 1U : 0U);
      }
    }
  }
}

/// A busy world with every kind of fault; its hash says whether two runs were the same.
std::uint64_t busy_world(std::uint64_t seed, std::uint64_t perturbation, std::uint64_t* good = nullptr) {
  sim::World world(seed);
  sim::Bus& bus = world.add_bus("one", 500'000);
  sim::Bus& other = world.add_bus("two", 125'000);
  bus.faults().draw_from({.disturbed_per_million = 30'000, .overrun_per_million = 10'000});
  if (perturbation != 0) world.executor().perturb(perturbation);
  std::vector<std::unique_ptr<Node>> nodes;
  Random dice = world.random().fork();
  for (int i = 0; i < 12; ++i) nodes.push_back(std::make_unique<Node>(i % 3 == 0 ? other : bus));
  std::uint64_t queued = 0;
  for (int i = 0; i < 400; ++i) {
    auto& node = *nodes[dice.below(nodes.size())];
    const auto id = static_cast<std::uint32_t>(0x100 + dice.below(12));
    const auto byte = static_cast<std::uint8_t>(dice.next());
    world.at(rt::Time(dice.below(200'000) * 1us), [&node, id, byte] {
      if (node.port->errors().state() == sim::ErrorState::bus_off) node.port->restart(node.port->bit_rate());
      node.port->send(Frame::base(id, {byte}), 1);
    });
    ++queued;
  }
  world.at(rt::Time(50ms), [&] { nodes[1]->port->power(false); });
  world.at(rt::Time(60ms), [&] { nodes[1]->port->power(true); });
  world.at(rt::Time(70ms), [&] { nodes[2]->port->cable(false); });
  world.at(rt::Time(90ms), [&] { nodes[2]->port->cable(true); });
  world.run_until(rt::Time(1s));
  if (good != nullptr) *good = bus.statistics().frames + other.statistics().frames;
  for (auto& node : nodes) EXPECT_TRUE(node->port->status().queued == 0 || node->port->status().bus_off);
  return world.trace_hash();
}

TEST(SimWorld, OneSeedOneHistory) {
  std::set<std::uint64_t> hashes;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const auto hash = busy_world(seed, 0);
    EXPECT_EQ(hash, busy_world(seed, 0)) << seed;
    hashes.insert(hash);
  }
  EXPECT_EQ(hashes.size(), 8U);
}

TEST(SimWorld, PerturbedOrderLosesNothing) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    std::uint64_t good = 0;
    busy_world(1, seed, &good);
    EXPECT_GT(good, 300U) << seed;
  }
}

TEST(SimWorld, ControllerMayDieAtAnyTime) {
  for (int bit = 0; bit < 140; ++bit) {
    Scene s;
    s.a.port->send(eight, 1);
    s.b.port->send(eight, 1);  // merged: the frame goes on without a
    s.world.run_for(bit * 1us);
    s.a.port.reset();
    s.world.run_for(5ms);
    EXPECT_EQ(s.b.ear.sent_tags.size(), 1U) << bit;
    EXPECT_EQ(s.c.ear.frames.size(), 1U) << bit;
  }
}

struct Count : can::Tap {
  std::vector<std::pair<int, std::uint32_t>> frames;
  void frame(const Frame& frame, rt::Time, int sender) noexcept override { frames.emplace_back(sender, frame.id); }
};

TEST(SimBus, TapSeesEveryGoodFrame) {
  Scene s;
  Count tap;
  s.bus.add_tap(tap);
  s.b.port->send(Frame::base(0x181, {}), 0);
  s.a.port->send(Frame::base(0x182, {}), 0);
  s.bus.inject({.where = sim::from_start(18)});
  s.world.run_for(5ms);
  EXPECT_EQ(tap.frames, (std::vector<std::pair<int, std::uint32_t>>{{1, 0x181}, {0, 0x182}}));
  s.bus.remove_tap(tap);
}

TEST(SimBus, DispatcherOverTheBus) {
  Scene s;
  struct Reply : can::Handler {
    std::vector<std::uint32_t> ids;
    void received(const Frame& f, rt::Time) noexcept override { ids.push_back(f.id); }
  } reply;
  can::Dispatcher dispatcher(s.world.executor(), *s.a.port);
  dispatcher.add(can::only(0x581), reply);
  s.b.port->send(Frame::base(0x581, {1}), 0);
  s.b.port->send(Frame::base(0x582, {1}), 0);
  s.world.run_for(1ms);
  EXPECT_EQ(reply.ids, std::vector<std::uint32_t>{0x581});
}

}  // namespace
}  // namespace faults_tests

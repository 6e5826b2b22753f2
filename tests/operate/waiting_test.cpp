// A device that waits, for its power cycle or for its cable, waits by itself: no other device notices, and its slot
// says what is so.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "berth/operate/erased_node_ids.hpp"
#include "tests/harness/plant_events.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using plant::Speaks;

namespace {

std::string waits_for(Rig& rig, unsigned id) {
  for (const auto& slot : rig.network().report()) {
    if (slot.id.value() == id) return slot.reason;
  }
  return {};
}

// What is heard of a node on the bus.
class Boots final : private can::Handler {
 public:
  Boots(Rig& rig, unsigned node)
      : port_(rig.world().attach_master("backbone")),
        dispatcher_(rig.world().executor(), *port_),
        node_(static_cast<std::uint8_t>(node)) {
    dispatcher_.add(can::only(0x700U + node), *this);
    dispatcher_.add(can::only(0), *this);
  }
  rt::Time booted{};
  rt::Duration slowest{};  // from a boot-up to the NMT start after it

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override {
    if (frame.id != 0 && frame.data[0] == 0) booted = at;
    const bool starts = frame.id == 0 && frame.data[0] == 1 && (frame.data[1] == node_ || frame.data[1] == 0);
    if (starts && booted != rt::Time{}) slowest = std::max(slowest, at - std::exchange(booted, rt::Time{}));
  }
  std::unique_ptr<sim::Controller> port_;
  can::Dispatcher dispatcher_;
  std::uint8_t node_;
};

}  // namespace

// Telling takes seconds, and who was switched on meanwhile waits for it.
TEST(Waiting, OneDeviceInARoundIsToldAgain) {
  unsigned first = 0;
  unsigned second = 0;
  std::vector<int> told;
  for (int round = 1; round <= 33; ++round) {
    bool told_one = false;
    if (operate::ErasedNodeIds::tells_again(first, told_one)) told.push_back(round);
    if (operate::ErasedNodeIds::tells_again(second, told_one)) told.push_back(-round);
  }
  EXPECT_EQ(told, (std::vector<int>{8, -9, 16, -17, 32, -33}));
}

// Its slot was given away while it was cut off (`replacement = "auto"`): it runs on, boots not, and is heard.
TEST(Waiting, ADeviceWhoseCableIsMendedComesBackToItsSlot) {
  using Set = plant::SpeaksSet;
  for (const Set& speaks : {Set{Speaks::lss}, Set{Speaks::lss, Speaks::rand}, Set{Speaks::lss, Speaks::fastscan}}) {
    for (const bool optional : {true, false}) {
      design::Machine m = one_bus(500'000);
      add_slot(m, 2, type_b);
      m.slots[0].spec.replacement = places::Replacement::automatic;
      m.slots[0].spec.optional = optional;
      auto p = one_bus_plant(1);
      add_device(p, "d", type_b, 5).speaks = speaks;
      add_device(p, "other", type_a, 5).node_id = NodeId(99);
      p.devices.back().source = plant::NodeIdSource::nonvolatile;
      cut(p, "d", 20s, 30s);
      Rig rig(m, p);
      rig.begin();
      ASSERT_TRUE(rig.run_until([&] { return rig.state(2) == SlotState::operational; }, 19s)) << rig.log();
      ASSERT_TRUE(rig.run_until([&] { return rig.state(2) == SlotState::empty; }, 20s)) << rig.log();
      rig.run_for(25s);
      ASSERT_TRUE(rig.run_until([&] { return rig.state(2) == SlotState::operational; }, 15s)) << rig.log();
    }
  }
}

// One or two devices wait for their power cycle, blank ones and such as come with a node-ID, the master's too. Another
// that boots again and again is started in two seconds and a half after its boot-up, a search among them, or after one
// binding of each of those that wait: two SDO requests that stay unanswered (1.6 s each, with the repetition), and LSS.
TEST(Waiting, ADeviceThatWaitsForItsPowerCycleDelaysNobody) {
  struct Waits {
    const char* why;
    std::vector<unsigned> had;  // node-IDs of those that wait; 0: blank
  };
  for (const Waits& waits : {Waits{"blank", {0}}, Waits{"another node-ID", {37}}, Waits{"the master's", {127}},
                             Waits{"two", {37, 38}}, Waits{"two under one", {37, 37}}}) {
    design::Machine m = one_bus(125'000);
    add_slot(m, 7, type_a);
    auto p = one_bus_plant(1);
    add_device(p, "pump", type_a, 1);
    for (std::size_t i = 0; i < waits.had.size(); ++i) {
      add_slot(m, static_cast<unsigned>(30 + i), type_b);
      auto& d = add_device(p, "waits " + std::to_string(i), type_b, static_cast<std::uint32_t>(10 + i));
      d.storing.power_cycle_after = true;
      if (waits.had[i] == 0) continue;
      d.source = plant::NodeIdSource::nonvolatile;
      d.node_id = NodeId(static_cast<std::uint8_t>(waits.had[i]));
    }
    for (int s = 20; s < 200; s += 7) p.events.push_back(event(plant::Action::reset, std::chrono::seconds(s), "pump"));
    Rig rig(m, p);
    Boots pump(rig, 7);
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return rig.state(7) == SlotState::operational; }, 15s)) << waits.why << rig.log();
    rig.run_for(210s);
    EXPECT_LT(pump.slowest, 2500ms + waits.had.size() * 4s) << waits.why << "\n" << rig.log();
    EXPECT_EQ(rig.state(7), SlotState::operational) << waits.why << rig.log();
    for (std::size_t i = 0; i < waits.had.size(); ++i) {
      const auto id = static_cast<unsigned>(30 + i);
      EXPECT_EQ(rig.state(id), SlotState::power_cycle) << waits.why << ": " << waits_for(rig, id) << "\n" << rig.log();
    }
  }
}

// Each SDO answer of a start in turn is sent twice, as CAN does when a sender sees the last bit of its frame wrong:
// that is no second device.
TEST(Waiting, AnAnswerThatCanRepeatsIsNoSecondDevice) {
  for (std::uint32_t strike = 0; strike < 30; ++strike) {
    design::Machine m = one_bus(125'000);
    add_slot(m, 5, type_b);
    auto p = one_bus_plant(1);
    auto& d = add_device(p, "d", type_b, 7);
    d.source = plant::NodeIdSource::nonvolatile;
    d.node_id = NodeId(5);
    auto wrong = event(plant::Action::disturb, 0s);
    wrong.nodes = {"d"};
    wrong.strike.id = 0x585;
    wrong.strike.skip = strike;
    wrong.strike.from_end = true;
    wrong.strike.kind = plant::Disturbance::dominant;
    p.events.push_back(wrong);
    Rig rig(m, p);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
    rig.run_for(5s);
    const std::string log = rig.log();
    EXPECT_EQ(log.find("two devices"), std::string::npos) << strike << "\n" << log;
    EXPECT_EQ(log.find("duplicate"), std::string::npos) << strike << "\n" << log;
  }
}

// It is slow just when it is told to give up the node-ID of another slot, so that its own waits for the next round.
TEST(Waiting, OneThatKeepsAnotherSlotsNodeIdForARoundIsNotNobody) {
  design::Machine m = one_bus(125'000);
  add_slot(m, 3, type_b);
  add_slot(m, 4, type_a);
  auto p = one_bus_plant(1);
  add_device(p, "other", type_b, 5);
  auto& d = add_device(p, "d", type_a, 7);
  d.source = plant::NodeIdSource::nonvolatile;
  d.node_id = NodeId(3);
  Rig rig(m, p);
  bool slowed = false;
  rig.on_step([&](const std::string&, const places::Binding& binding) {
    if (binding.kind() != places::Binding::Kind::blank || std::exchange(slowed, true)) return;
    auto slow = event(plant::Action::slow, 0s, "d");
    slow.duration = 2s;
    slow.latency = 300ms;
    rig.world().perform(slow);
  });
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_TRUE(slowed);
  const std::string log = rig.log();
  EXPECT_EQ(log.find("no device of its type was found"), std::string::npos) << log;
  EXPECT_NE(log.find("s4: empty: 01000001-00000001-00000000-00000007 was found"), std::string::npos) << log;
}

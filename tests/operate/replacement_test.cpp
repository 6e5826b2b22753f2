// `replacement = "auto"`: a slot's device falls silent, and the same or another one comes.
#include <gtest/gtest.h>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using plant::Habit;
using plant::Speaks;
using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

namespace replacement_tests {
namespace {

design::Machine two_slots() {
  design::Machine m = one_bus(125'000);
  add_slot(m, 1, type_a);
  add_slot(m, 5, type_b);
  m.slots.back().spec.replacement = places::Replacement::automatic;
  return m;
}

class Replacement : public testing::TestWithParam<std::optional<Habit>> {
 protected:
  // "old" runs in the slot, a neighbour beside it; "new" is on the shelf.
  void begin() {
    auto plant = one_bus_plant(1);
    add(plant, "neighbour", type_a, 1);
    add(plant, "old", type_b, 1);
    add(plant, "new", type_b, 2).plugged = false;
    rig = std::make_unique<Rig>(two_slots(), plant);
    rig->begin();
    ASSERT_TRUE(rig->until_operational(30s)) << rig->log();
    rig->run_for(3s);
  }
  static plant::PlantDevice& add(plant::PlantFile& plant, const std::string& name, TypeCode type,
                                 std::uint32_t serial) {
    auto& d = add_device(plant, name, type, serial);
    d.speaks = {Speaks::lss};
    if (GetParam()) d.speaks.add(Speaks::fastscan);
    d.lss.habit = GetParam();
    return d;
  }
  bool until(SlotState state, rt::Duration limit) {
    return rig->run_until([&] { return rig->state(5) == state; }, limit);
  }
  // Who answers Fastscan with a node-ID too is gone round by every search, and boots by NMT only.
  [[nodiscard]] static rt::Duration and_for_lely(rt::Duration time) {
    return time + (GetParam() == Habit::lely ? 2s : 0s);
  }
  std::unique_ptr<Rig> rig;
};
INSTANTIATE_TEST_SUITE_P(Habits, Replacement, testing::Values(std::nullopt, Habit::canopennode, Habit::lely));

// Nothing else was found meanwhile, and what boots under the slot's node-ID is asked at once.
TEST_P(Replacement, TheDeviceThatComesBackIsStartedAtOnce) {
  begin();
  for (const auto away : {500ms, 2000ms, 3000ms, 5000ms}) {
    rig->device("old").unplug();
    ASSERT_TRUE(until(SlotState::empty, 10s)) << rig->log();
    rig->run_for(away);
    rig->device("old").plug();
    EXPECT_TRUE(until(SlotState::operational, and_for_lely(2s))) << away.count() << "\n" << rig->log();
    ASSERT_TRUE(rig->until_operational(30s)) << rig->log();
  }
  EXPECT_EQ(rig->seats(), (Seats{{1, 1}, {5, 1}}));
}

// It is found while the slot is not known to be free, and waits no longer than that.
TEST_P(Replacement, TheOneThatComesBeforeTheOldOneIsMissedIsSeatedWithTheSilence) {
  begin();
  rig->device("old").unplug();
  rig->device("new").plug();
  ASSERT_TRUE(until(SlotState::empty, 10s)) << rig->log();
  EXPECT_TRUE(until(SlotState::operational, and_for_lely(4s))) << rig->log();
  ASSERT_TRUE(rig->until_operational(30s)) << rig->log();
  EXPECT_EQ(rig->seats(), (Seats{{1, 1}, {5, 2}}));
}

// Its cable was cut behind its boot-up, before its heartbeat was set: it is back with no word, and its slot is
// another's.
TEST_P(Replacement, WhoComesBackWithoutAWordIsTakenOff) {
  begin();
  rig->device("old").unplug();
  ASSERT_TRUE(until(SlotState::empty, 10s)) << rig->log();
  rig->device("old").plug();
  ASSERT_TRUE(until(SlotState::present, 5s)) << rig->log();
  const auto cable = [&](plant::Action action) {
    plant::PlantEvent e;
    e.action = action;
    e.bus = "backbone";
    if (action == plant::Action::cut_cable) e.nodes = {"old"};
    rig->world().perform(e);
  };
  cable(plant::Action::cut_cable);
  rig->device("new").plug();
  ASSERT_TRUE(rig->run_until([&] { return rig->seats() == Seats{{1, 1}, {5, 2}}; }, 60s)) << rig->log();
  ASSERT_TRUE(rig->until_operational(30s)) << rig->log();
  rig->run_for(20s);
  cable(plant::Action::join);
  rig->run_for(120s);
  EXPECT_NE(rig->device("old").truth().active, NodeId(5)) << rig->log();
  EXPECT_NE(rig->device("old").truth().persistent, NodeId(5)) << rig->log();
  EXPECT_EQ(rig->state(5), SlotState::operational) << rig->log();
}

}  // namespace
}  // namespace replacement_tests

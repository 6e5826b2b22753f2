// What goes wrong in the main job, one thing at a time: each ends in a clear state, and in the right one.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

namespace troubles_tests {
namespace {

design::Machine slots_of(std::initializer_list<std::pair<unsigned, TypeCode>> slots) {
  design::Machine m = one_bus(125'000);
  for (const auto& [id, type] : slots) add_slot(m, id, type);
  return m;
}

bool heard(const Rig& rig, const std::string& kind) {
  return std::ranges::any_of(rig.events(), [&](const auto& e) { return name(e.kind) == kind; });
}

// Questions to the device with node-ID 60, and those sent again before the answer to the one before.
struct Questions final : can::Tap {
  bool answered = false;  // ever
  bool open = false;
  int again = 0;
  void frame(const can::Frame& f, rt::Time, int) noexcept override {
    if (f.id == 0x600 + 60) again += answered && std::exchange(open, true) ? 1 : 0;
    if (f.id != 0x580 + 60) return;
    answered = true;
    open = false;
  }
};

struct Frames final : can::Tap {
  std::vector<std::string> sent;
  int master = 0;
  void frame(const can::Frame& f, rt::Time, int sender) noexcept override {
    if (sender == master) sent.push_back(can::to_string(f));
  }
};

}  // namespace

// S1.34
TEST(Troubles, S1_34_MoreDevicesThanSlotsEndsInAQuestion) {
  auto plant = one_bus_plant(1);
  add_device(plant, "a", type_b, 1);
  add_device(plant, "b", type_b, 2);
  Rig rig(slots_of({{5, type_b}}), plant);
  rig.begin();
  rig.run_for(10s);
  EXPECT_EQ(rig.state(5), SlotState::question) << rig.log();
  EXPECT_TRUE(heard(rig, "question"));
  EXPECT_TRUE(rig.seats().empty());
  // The person answers.
  ASSERT_TRUE(rig.network().replace("s5", LssAddress{type_b.vendor, type_b.product, 0, 2}));
  ASSERT_TRUE(rig.until_operational(10s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 2}}));
}

TEST(Troubles, S1_34_FewerDevicesThanSlotsWaitsForTheRest) {
  auto plant = one_bus_plant(1);
  add_device(plant, "a", type_b, 7);
  add_device(plant, "b", type_b, 3).plugged = false;
  Rig rig(slots_of({{5, type_b}, {6, type_b}}), plant);
  rig.begin();
  rig.run_for(5s);
  EXPECT_EQ(rig.state(5), SlotState::question);
  rig.device("b").plug();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 3}, {6, 7}}));
}

TEST(Troubles, ForeignDeviceIsNamedAndLeftAlone) {
  auto plant = one_bus_plant(1);
  add_device(plant, "a", type_b, 7);
  add_device(plant, "alien", TypeCode{0x99, 0x99}, 1);
  Rig rig(slots_of({{5, type_b}}), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_TRUE(heard(rig, "foreign"));
  EXPECT_FALSE(rig.device("alien").truth().active.configured());
}

// S1.36: right type, node-ID of another slot; and a foreign one at a slot's node-ID.
TEST(Troubles, S1_36_StoredNodeIdsAreFoundAndSetRight) {
  auto plant = one_bus_plant(1);
  auto& a = add_device(plant, "a", type_b, 7);
  a.source = plant::NodeIdSource::nonvolatile;
  a.node_id = NodeId(6);
  auto& b = add_device(plant, "b", type_c, 3);
  b.source = plant::NodeIdSource::nonvolatile;
  b.node_id = NodeId(5);
  auto& alien = add_device(plant, "alien", TypeCode{0x99, 0x99}, 1);
  alien.source = plant::NodeIdSource::nonvolatile;
  alien.node_id = NodeId(6);
  Rig rig(slots_of({{5, type_b}, {6, type_c}}), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 7}, {6, 3}}));
  EXPECT_TRUE(rig.world().duplicates().empty());
  EXPECT_FALSE(rig.device("alien").truth().persistent.configured()) << "it would come back under a slot's node-ID";
}

// S1.22: two devices with one LSS address and different delays are told from each other by answering twice.
TEST(Troubles, S1_22_ClonesAreNamedAndNotStarted) {
  auto plant = one_bus_plant(3);
  auto& a = add_device(plant, "a", type_b, 7);
  a.response = {1ms, 4ms, 0, 0ms};
  plant::PlantDevice clone = a;
  clone.name = "clone";
  clone.response = {1ms, 5ms, 0, 0ms};
  plant.devices.push_back(clone);
  Rig rig(slots_of({{5, type_b}}), plant);
  rig.begin();
  rig.run_for(15s);
  EXPECT_NE(rig.state(5), SlotState::operational) << rig.log();
  EXPECT_TRUE(heard(rig, "clone")) << rig.log();
  for (const auto& t : rig.world().truth()) EXPECT_NE(t.state, NmtState::operational) << t.name;
}

TEST(Troubles, SerialNumberZeroIsADeviceLikeAnother) {
  auto plant = one_bus_plant(1);
  add_device(plant, "zero", type_b, 0);
  Rig rig(slots_of({{5, type_b}}), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 0}}));
}

// HU.23, S1.30: one device is lost; the others stay as they are, and it comes back without anybody's help.
TEST(Troubles, S1_30_ALostDeviceIsAbsentAndComesBack) {
  Rig rig(five_slots(), five_slaves());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s));
  rig.device("d3").power(false);
  ASSERT_TRUE(rig.run_until([&] { return rig.state(3) == SlotState::absent; }, 10s));
  for (const unsigned id : {1U, 2U, 4U, 5U}) EXPECT_EQ(rig.state(id), SlotState::operational);
  rig.device("d3").power(true);
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_EQ(rig.seats().size(), 5U);
}

TEST(Troubles, ReplacementAutomaticNeedsNoButton) {
  auto machine = slots_of({{5, type_b}});
  machine.slots[0].spec.replacement = places::Replacement::automatic;
  auto plant = one_bus_plant(1);
  add_device(plant, "old", type_b, 1);
  add_device(plant, "new", type_b, 2).plugged = false;
  Rig rig(machine, plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s));
  rig.device("old").unplug();
  rig.device("new").plug();
  ASSERT_TRUE(rig.run_until([&] { return rig.seats() == Seats{{5, 2}}; }, 20s)) << rig.log();
  ASSERT_TRUE(rig.until_operational(20s));
  // The old one comes back with the slot's node-ID in its memory: it is found, and gives the node-ID up.
  rig.device("old").plug();
  ASSERT_TRUE(rig.run_until([&] { return !rig.device("old").truth().persistent.configured(); }, 30s)) << rig.log();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_TRUE(rig.world().duplicates().empty());
  EXPECT_EQ(rig.seats(), (Seats{{5, 2}}));
}

// A second Berth finds a running machine and does not disturb it: no NMT command, no LSS write, no reset.
TEST(Troubles, S1_53_ARestartLeavesRunningDevicesAlone) {
  Rig rig(five_slots(), five_slaves());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s));
  rig.kill();
  rig.run_for(300ms);
  rig.begin();
  Frames frames;
  frames.master = rig.port().number();
  rig.world().bus("backbone")->add_tap(frames);
  ASSERT_TRUE(rig.until_operational(10s)) << rig.log();
  rig.run_for(3s);
  rig.world().bus("backbone")->remove_tap(frames);
  for (const auto& f : frames.sent) {
    EXPECT_NE(f.substr(0, 4), "000#") << f;
    EXPECT_NE(f.substr(0, 6), "7E5#11") << f;
    EXPECT_NE(f.substr(0, 6), "7E5#17") << f;
  }
  EXPECT_FALSE(frames.sent.empty());
}

TEST(Troubles, ADeviceThatNeedsAPowerCycleWaitsInThatState) {
  auto plant = one_bus_plant(1);
  add_device(plant, "a", type_b, 7).storing.power_cycle_after = true;
  Rig rig(slots_of({{5, type_b}}), plant);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::power_cycle; }, 60s)) << rig.log();
  rig.device("a").power(false);
  rig.run_for(200ms);
  rig.device("a").power(true);
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
}

TEST(Troubles, ReplaceRefusesWhatIsThereAndWhatDoesNotFit) {
  Rig rig(five_slots(), five_slaves());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s));
  EXPECT_EQ(rig.network().replace("s1", std::nullopt).error().code, Errc::invalid);
  EXPECT_EQ(rig.network().replace("nobody", std::nullopt).error().code, Errc::not_found);
  rig.device("d2").unplug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(2) == SlotState::absent; }, 10s));
  EXPECT_EQ(rig.network().replace("s2", LssAddress{9, 9, 9, 9}).error().code, Errc::invalid);
}

// Nobody else on the bus: the master's own frames are never acknowledged, and that is said.
TEST(Troubles, ALoneMasterSaysThatNobodyIsThere) {
  Rig rig(slots_of({{5, type_b}}), one_bus_plant(1));
  rig.begin();
  rig.run_for(10s);
  EXPECT_EQ(rig.state(5), SlotState::empty) << rig.log();
  EXPECT_TRUE(heard(rig, "error"));
}

// The same seed is the same world, to the bit.
TEST(Troubles, OneSeedOneHistory) {
  const auto hash = [](std::uint64_t seed) {
    Rig rig(five_slots(), five_slaves(seed));
    rig.begin();
    rig.until_operational(60s);
    return rig.world().sim().trace_hash();
  };
  EXPECT_EQ(hash(1), hash(1));
  EXPECT_NE(hash(1), hash(2));
}

// What a person commands is not undone; a device that leaves operational by itself is started again.
TEST(Troubles, NmtCommandsOfAPersonStand) {
  Rig rig(five_slots(), five_slaves());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s));
  for (const auto command : {co::NmtCommand::stop, co::NmtCommand::enter_pre_operational}) {
    rig.network().commanded(command, NodeId(3));
    rig.network().services().nmt.queue(command, NodeId(3));
    rig.run_for(10s);
    EXPECT_EQ(rig.state(3), SlotState::present) << rig.log();
    EXPECT_EQ(rig.device("d3").truth().state, co::state_after(command));
    rig.network().commanded(co::NmtCommand::start, NodeId(3));
    rig.network().services().nmt.queue(co::NmtCommand::start, NodeId(3));
    rig.run_for(2s);
    EXPECT_EQ(rig.state(3), SlotState::operational) << rig.log();
  }
  rig.device("d3").device().apply(co::NmtCommand::enter_pre_operational);
  rig.run_for(5s);
  EXPECT_EQ(rig.state(3), SlotState::operational) << rig.log();
}

// S1.36: the device has the master's own node-ID, and there is nobody else who could acknowledge: seed 6827 of ./run
// faults.
TEST(Troubles, S1_36_ADeviceWithTheMastersNodeId) {
  auto plant = one_bus_plant(1);
  auto& a = add_device(plant, "a", type_b, 7);
  a.source = plant::NodeIdSource::nonvolatile;
  a.node_id = NodeId(127);
  a.boot = 4ms;
  Rig rig(slots_of({{5, type_b}}), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 7}}));
}

// The master's port is disturbed once, and has no error left.
bool goes_bus_off(Rig& rig, sim::Controller& port) {
  port.preset_counters(255, 0);
  plant::PlantEvent e;
  e.action = plant::Action::disturb;
  e.bus = "backbone";
  e.nodes = {std::string(plant::master_name)};
  e.strike.id = can::extended_flag | 0x1F940000U;  // its own question, in the data field
  e.strike.bit = 60;
  e.strike.times = 1;
  return rig.world().perform(e) && rig.run_until([&] { return port.status().bus_off; }, 10s);
}

// The way out of bus-off: said, and taken.
TEST(Troubles, TheMastersPortComesBackFromBusOff) {
  Rig rig(five_slots(), five_slaves());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s));
  ASSERT_TRUE(goes_bus_off(rig, rig.port())) << rig.log();
  rig.run_for(2s);
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_FALSE(rig.port().status().bus_off);
  EXPECT_TRUE(heard(rig, "error"));
  EXPECT_EQ(statistics_of(rig.network()).bus_offs, 1U);
}

// Berth ended while its port was bus-off: the next one begins there, and no change of the port tells it so.
TEST(Troubles, ABerthThatBeginsAtBusOffComesOutOfIt) {
  Rig rig(five_slots(), five_slaves());
  const auto controller = rig.world().attach_master("backbone");
  rig.put_between([&](can::Port&, const std::string&) { return controller.get(); });
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s));
  ASSERT_TRUE(goes_bus_off(rig, *controller)) << rig.log();
  rig.kill();
  ASSERT_TRUE(controller->status().bus_off);
  rig.begin();
  EXPECT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_FALSE(controller->status().bus_off);
  rig.kill();
}

// S1.22: a blank clone of a device that runs is plugged in.
TEST(Troubles, S1_22_ABlankCloneOfARunningDeviceIsNamed) {
  auto plant = one_bus_plant(3);
  auto& a = add_device(plant, "a", type_b, 7);
  a.response = {200us, 3ms, 0, 0ms};
  plant::PlantDevice clone = a;
  clone.name = "clone";
  clone.plugged = false;
  plant.devices.push_back(clone);
  Rig rig(slots_of({{5, type_b}}), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  rig.device("clone").plug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::duplicate; }, 20s)) << rig.log();
  EXPECT_TRUE(heard(rig, "clone")) << rig.log();
  rig.run_for(10s);
  EXPECT_EQ(rig.state(5), SlotState::duplicate) << rig.log();
  rig.device("clone").unplug();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
}

// S1.36: node-IDs that came swapped are set right in one go, not after a pause.
TEST(Troubles, S1_36_SwappedNodeIdsAreSetRightAtOnce) {
  auto plant = one_bus_plant(1);
  for (const unsigned id : {6U, 5U}) {
    auto& d = add_device(plant, "d" + std::to_string(id), id == 6 ? type_b : type_c, 11 - id);
    d.source = plant::NodeIdSource::nonvolatile;
    d.node_id = NodeId(static_cast<std::uint8_t>(id));
  }
  Rig rig(slots_of({{5, type_b}, {6, type_c}}), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(8s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 5}, {6, 6}}));
}

// A machine that another tool commissioned: both drives have node-IDs of slots of their type, against the order of
// their serial numbers. Rule 2 would swap left and right.
TEST(Troubles, NodeIdsOfSlotsOfTheirTypeAreKept) {
  auto plant = one_bus_plant(1);
  for (const unsigned id : {6U, 5U}) {
    auto& d = add_device(plant, "d" + std::to_string(id), type_b, 11 - id);  // serial 5 came as 6, serial 6 as 5
    d.source = plant::NodeIdSource::nonvolatile;
    d.node_id = NodeId(static_cast<std::uint8_t>(id));
  }
  Rig rig(slots_of({{5, type_b}, {6, type_b}}), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(8s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 6}, {6, 5}}));
}

// One of three is switched off: the others start, and no question is asked about what everybody sees.
TEST(Troubles, ACommissionedMachineStartsWithoutItsMissingDevice) {
  auto plant = one_bus_plant(1);
  for (const unsigned id : {5U, 6U, 7U}) {
    auto& d = add_device(plant, "d" + std::to_string(id), type_b, 20 - id);
    d.source = plant::NodeIdSource::nonvolatile;
    d.node_id = NodeId(static_cast<std::uint8_t>(id));
    d.plugged = id != 6;
  }
  Rig rig(slots_of({{5, type_b}, {6, type_b}, {7, type_b}}), plant);
  rig.begin();
  rig.run_for(12s);
  EXPECT_EQ(rig.state(5), SlotState::operational) << rig.log();
  EXPECT_EQ(rig.state(7), SlotState::operational) << rig.log();
  EXPECT_EQ(rig.state(6), SlotState::empty) << rig.log();
  EXPECT_FALSE(heard(rig, "question")) << rig.log();
  rig.device("d6").plug();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 15}, {6, 14}, {7, 13}}));
}

// The same device of the right type at exactly its slot's node-ID, booted before Berth, without heartbeat, LSS or RAND.
TEST(Troubles, ADeviceThatSitsWhereItBelongsIsFoundAtOnce) {
  for (const bool lss : {false, true}) {
    auto plant = one_bus_plant(1);
    auto& d = add_device(plant, "d", type_b, 1);
    d.source = lss ? plant::NodeIdSource::nonvolatile : plant::NodeIdSource::hard_coded;
    d.node_id = NodeId(5);
    d.speaks = {};
    if (lss) d.speaks = {plant::Speaks::lss};
    Rig rig(slots_of({{5, type_b}}), plant);
    rig.run_for(5s);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(3s)) << rig.log();
    EXPECT_EQ(rig.seats(), (Seats{{5, 1}}));
  }
}

// A device whose node-ID comes from switches is taken where it is and never written to.
TEST(Troubles, FixedNodeIdsAreTakenAsTheyAre) {
  auto machine = slots_of({{5, type_b}, {6, type_b}});
  for (auto& slot : machine.slots) slot.spec.assign = places::Assign::fixed;
  auto plant = one_bus_plant(1);
  auto& right = add_device(plant, "right", type_b, 1);
  right.source = plant::NodeIdSource::switches;
  right.node_id = NodeId(5);
  auto& wrong = add_device(plant, "wrong", type_b, 2);
  wrong.source = plant::NodeIdSource::hard_coded;
  wrong.node_id = NodeId(9);
  Rig rig(machine, plant);
  rig.begin();
  rig.run_for(10s);
  EXPECT_EQ(rig.state(5), SlotState::operational) << rig.log();
  EXPECT_EQ(rig.state(6), SlotState::empty) << rig.log();
  EXPECT_TRUE(heard(rig, "fixed mismatch")) << rig.log();
  EXPECT_EQ(rig.device("wrong").truth().active, NodeId(9));
  EXPECT_EQ(rig.device("right").truth().memory_writes + rig.device("wrong").truth().memory_writes, 0U);
}

// Each question whether it is there is over (guard_timeout) when it answers, and no question to what it answers
// (sdo_timeout) is.
TEST(Troubles, AFixedDeviceThatAnswersLateIsTaken) {
  for (const rt::Duration late : {150ms, 300ms, 450ms}) {
    for (const bool comes : {false, true}) {
      SCOPED_TRACE(testing::Message() << late.count() << (comes ? " comes later" : " is there"));
      auto machine = slots_of({{5, type_b}});
      machine.slots[0].spec.assign = places::Assign::fixed;
      machine.buses[0].timing.sdo_timeout = 500ms;
      auto plant = one_bus_plant(1);
      auto& device = add_device(plant, "slow", type_b, 1);
      device.source = plant::NodeIdSource::switches;
      device.node_id = NodeId(5);
      device.response = {.min = late, .max = late};
      device.plugged = !comes;
      Rig rig(machine, plant);
      rig.begin();
      rig.run_for(5s);
      if (comes) rig.device("slow").plug();
      rig.run_for(30s);
      EXPECT_EQ(rig.state(5), SlotState::operational) << rig.log();
    }
  }
}

// Nobody hears of it: it booted long ago, under a node-ID of no slot, and answers no identify. The question to each
// node-ID has less patience than it needs.
TEST(Troubles, ASilentDeviceThatAnswersLateIsFound) {
  auto machine = slots_of({{5, type_b}, {6, type_c}});
  machine.buses[0].timing.sdo_timeout = 500ms;
  auto plant = one_bus_plant(1);
  auto& device = add_device(plant, "slow", type_b, 1);
  device.source = plant::NodeIdSource::nonvolatile;
  device.node_id = NodeId(60);
  device.speaks = {plant::Speaks::lss, plant::Speaks::fastscan};
  device.lss.habit = plant::Habit::canopennode;
  device.response = {.min = 450ms, .max = 450ms};
  add_device(plant, "other", type_c, 2);  // acknowledges its boot-up message
  Rig rig(machine, plant);
  Questions questions;
  rig.world().bus("backbone")->add_tap(questions);
  rig.run_for(5s);
  rig.begin();
  EXPECT_TRUE(rig.run_until([&] { return rig.log().find("with node-ID 60") != std::string::npos; }, 600s)) << rig.log();
  EXPECT_EQ(questions.again, 0) << "once it is known to be slow, it is given the time of `sdo_timeout`";
  rig.world().bus("backbone")->remove_tap(questions);
}

// More than there are slots, by plain LSS alone: a search takes several of its slices, the last ones for the gaps
// between their serial numbers. Each is told once, and none is called one that cannot be identified.
TEST(Troubles, ManyWithoutASlotAreToldOnce) {
  for (const unsigned devices : {60U, 120U}) {
    SCOPED_TRACE(devices);
    auto machine = slots_of({{5, type_b}, {6, type_c}});
    machine.buses[0].bitrate = 20'000;
    auto plant = one_bus_plant(1);
    for (unsigned i = 0; i < devices; ++i) {
      add_device(plant, "d" + std::to_string(i), type_b, 0x10005 + 777 * i).speaks = {plant::Speaks::lss};
    }
    auto& late = add_device(plant, "late", type_c, 1);
    late.speaks = {plant::Speaks::lss};
    late.plugged = false;
    Rig rig(machine, plant);
    rig.begin();
    rig.run_for(250s);
    unsigned told = 0;
    for (const auto& event : rig.events()) told += event.kind == operate::EventKind::found ? 1U : 0U;
    EXPECT_EQ(told, devices) << rig.log();
    EXPECT_EQ(rig.log().find("cannot be identified"), std::string::npos) << rig.log();
    rig.device("late").plug();
    EXPECT_TRUE(rig.run_until([&] { return rig.state(6) == SlotState::operational; }, 300s)) << rig.log();
  }
}

// The device left while no Berth was watching.
TEST(Troubles, ReplacementAutomaticAfterARestart) {
  auto machine = slots_of({{5, type_b}});
  machine.slots[0].spec.replacement = places::Replacement::automatic;
  auto plant = one_bus_plant(1);
  add_device(plant, "old", type_b, 1);
  add_device(plant, "new", type_b, 2).plugged = false;
  Rig rig(machine, plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s));
  rig.kill();
  rig.device("old").unplug();
  rig.run_for(1s);
  rig.begin();
  rig.run_for(10s);
  EXPECT_EQ(rig.state(5), SlotState::absent) << "nothing has come yet: the binding stays\n" << rig.log();
  rig.device("new").plug();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 2}}));
}

}  // namespace troubles_tests

// A Berth with a fresh store on a network that another master runs: it learns once who is there, shows it, and leaves
// the bus at rest.
#include <gtest/gtest.h>

#include "tests/harness/berths.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace {

constexpr double most_frames_per_second = 5;  // of a bus at rest, with Berth's own heartbeat
constexpr NodeId plc_id(100);

struct Setting {
  unsigned devices = 1;
  bool configured = false;
  plant::SpeaksSet speaks{plant::Speaks::lss, plant::Speaks::rand};
  bool plc = true;
  design::Role role = design::Role::commissioner;
};

std::string words_of(const Setting& setting) {
  using plant::Speaks;
  return fmt::format("{} devices{}, {}{}", setting.devices, setting.configured ? " with config =" : "",
                     setting.speaks.has(Speaks::rand)  ? "RAND"
                     : setting.speaks.has(Speaks::lss) ? "LSS"
                                                       : "SDO only",
                     setting.plc ? ", and a PLC with an LSS slave" : "");
}

design::Machine machine_of(const Setting& setting) {
  design::Machine m = one_bus(125'000);
  for (unsigned id = 1; id <= setting.devices; ++id) {
    add_slot(m, id, setting.configured ? type_pump : type_b);
    m.slots.back().spec.when_ambiguous = places::WhenAmbiguous::ascending;
    if (setting.configured) m.slots.back().spec.config = example_eds("pump.dcf");
  }
  return m;
}

plant::PlantFile plant_of(const Setting& setting) {
  plant::PlantFile p = one_bus_plant(1);
  for (unsigned i = 1; i <= setting.devices; ++i) {
    auto& device = add_device(p, "d" + std::to_string(i), setting.configured ? type_pump : type_b, i);
    device.speaks = setting.speaks;
    if (setting.speaks.has(plant::Speaks::lss)) continue;
    device.source = plant::NodeIdSource::hard_coded;
    device.node_id = NodeId(static_cast<std::uint8_t>(i));
  }
  if (!setting.plc) return p;
  auto& plc = add_device(p, "plc", {7, 7}, 1);
  plc.node_id = plc_id;
  plc.source = plant::NodeIdSource::nonvolatile;
  plc.speaks = {plant::Speaks::lss};
  plc.heartbeat = 500ms;
  return p;
}

// What the second Berth sends, and what the PLC's LSS slave answers to it.
class Ear final : private can::Tap {
 public:
  explicit Ear(Berths& berths) : berths_(berths) { berths.world().bus("backbone")->add_tap(*this); }
  ~Ear() { berths_.world().bus("backbone")->remove_tap(*this); }
  void forget() { frames = questions = 0; }
  unsigned frames = 0;
  unsigned questions = 0;     // by SDO, to the devices
  unsigned writes = 0;        // the same that write
  unsigned plc_selected = 0;  // into LSS configuration
  unsigned commands = 0;

 private:
  void frame(const can::Frame& f, rt::Time, int sender) noexcept override {
    auto* const plc = berths_.world().find("plc");
    const bool of_plc = plc != nullptr && sender == plc->controller().number();
    if (of_plc && f.id == 0x7E4 && f.size == 8 && f.data[0] == 0x44) ++plc_selected;
    if (!berths_.runs(1) || sender != berths_.controller(1).number()) return;
    ++frames;
    const bool sdo = !f.extended && f.id > 0x600 && f.id <= 0x67F;
    if (sdo) ++questions;
    if (sdo && (f.data[0] & 0xE0U) == 0x20) ++writes;
    if (f.key() == 0) ++commands;
  }
  Berths& berths_;
};

bool all_operational(Berths& berths) { return berths.network(1).operational(); }

void settles(const Setting& setting) {
  SCOPED_TRACE(words_of(setting));
  const bool flying = false;
  Berths berths(machine_of(setting), plant_of(setting), {0, 0}, flying);
  Ear ear(berths);
  berths.machine(1).buses[0].role = setting.role;
  berths.begin(0);
  ASSERT_TRUE(berths.run_until([&] { return berths.operational(0); }, 300s)) << berths.log();
  berths.run_for(2s);
  ear.forget();
  ear.writes = ear.plc_selected = 0;
  berths.begin(1);
  EXPECT_TRUE(berths.run_until([&] { return all_operational(berths); }, 60s)) << berths.log();
  berths.run_for(20s);  // the first searches for devices without RAND come later
  ear.forget();
  berths.run_for(60s);
  EXPECT_TRUE(all_operational(berths)) << berths.log();
  EXPECT_LT(ear.frames / 60.0, most_frames_per_second) << berths.log();
  EXPECT_EQ(ear.questions, 0U) << "SDO to devices that run";
  EXPECT_EQ(ear.writes, 0U) << "a running device is left as it is";
  EXPECT_EQ(ear.plc_selected, 0U) << "no slot waits for the PLC";
  EXPECT_EQ(berths.left_operational, 0U);
  EXPECT_EQ(berths.second_starts, 0U) << berths.log();
  const bool commands = setting.role == design::Role::master;
  EXPECT_TRUE(commands || ear.commands == 0);
  EXPECT_TRUE(!setting.plc || berths.world().find("plc")->device().node_id() == plc_id);
}

const std::array<plant::SpeaksSet, 3> ways{plant::SpeaksSet{plant::Speaks::lss, plant::Speaks::rand},
                                           plant::SpeaksSet{plant::Speaks::lss}, plant::SpeaksSet{}};

}  // namespace

TEST(Beside, ACommissionersFirstStartSettles) {
  for (const unsigned devices : {1U, 3U, 12U, 60U}) {
    for (const bool configured : {false, true}) {
      for (const auto& speaks : ways) {
        const bool one_way = devices == 60 && (speaks == ways[0]) == configured;
        if (one_way) continue;
        settles({.devices = devices, .configured = configured, .speaks = speaks});
      }
    }
  }
}

// An observer knows the devices by its slot table, and what they do by their heartbeats.
TEST(Beside, AnObserverShowsWhatRunsAndSendsNothing) {
  const bool flying = false;
  const Setting setting{.devices = 3, .configured = true};
  Berths berths(machine_of(setting), plant_of(setting), {0, 0}, flying);
  Ear ear(berths);
  berths.machine(1).buses[0].role = design::Role::commissioner;
  berths.begin(0);
  ASSERT_TRUE(berths.run_until([&] { return berths.operational(0); })) << berths.log();
  berths.begin(1);
  ASSERT_TRUE(berths.run_until([&] { return all_operational(berths); })) << berths.log();
  berths.kill(1);
  berths.machine(1).buses[0].role = design::Role::observer;
  ear.forget();
  berths.begin(1);
  EXPECT_TRUE(berths.run_until([&] { return all_operational(berths); }, 5s)) << berths.log();
  // It follows a device that boots, and one that is away.
  berths.world().find("d1")->reset();
  berths.world().find("d2")->power(false);
  berths.run_for(2s);
  EXPECT_EQ(berths.network(1).report()[1].state, SlotState::absent) << berths.log();
  EXPECT_TRUE(berths.run_until([&] { return berths.network(1).report()[0].state == SlotState::operational; }, 30s))
      << berths.log();
  EXPECT_EQ(ear.frames, 0U);
}

// Without a slot table of its own: the devices are there, and which they are nobody told.
TEST(Beside, AnObserverWithoutASlotTableShowsWhoIsHeard) {
  const bool flying = false;
  const Setting setting{.devices = 3, .configured = true};
  Berths berths(machine_of(setting), plant_of(setting), {0, 0}, flying);
  Ear ear(berths);
  berths.machine(1).buses[0].role = design::Role::observer;
  berths.begin(0);
  ASSERT_TRUE(berths.run_until([&] { return berths.operational(0); })) << berths.log();
  berths.world().find("d3")->power(false);
  berths.run_for(5s);
  ear.forget();
  berths.begin(1);
  berths.run_for(5s);
  const auto slots = berths.network(1).report();
  ASSERT_EQ(slots.size(), 3U);
  for (const std::size_t there : {0U, 1U}) {
    EXPECT_EQ(slots[there].state, SlotState::unknown) << berths.log();
    EXPECT_EQ(slots[there].nmt, NmtState::operational);
    EXPECT_NE(slots[there].reason.find("an observer asks nobody"), std::string::npos) << slots[there].reason;
  }
  EXPECT_EQ(slots[2].state, SlotState::empty) << "nothing is heard of it";
  EXPECT_EQ(ear.frames, 0U);
}

// What its master resets and starts again, the commissioner shows, and starts nothing.
TEST(Beside, ADeviceThatItsMasterStartsAgainSettles) {
  for (const bool configured : {false, true}) {
    const bool flying = false;
    const Setting setting{.devices = 3, .configured = configured};
    Berths berths(machine_of(setting), plant_of(setting), {0, 0}, flying);
    Ear ear(berths);
    berths.machine(1).buses[0].role = design::Role::commissioner;
    berths.begin(0);
    ASSERT_TRUE(berths.run_until([&] { return berths.operational(0); })) << berths.log();
    berths.begin(1);
    ASSERT_TRUE(berths.run_until([&] { return all_operational(berths); })) << berths.log();
    berths.world().find("d2")->reset();
    ASSERT_TRUE(berths.run_until([&] { return !all_operational(berths); }, 10s)) << berths.log();
    EXPECT_TRUE(berths.run_until([&] { return all_operational(berths) && berths.operational(0); }, 60s))
        << berths.log();
    berths.run_for(5s);
    ear.forget();
    berths.run_for(60s);
    EXPECT_LT(ear.frames / 60.0, most_frames_per_second) << berths.log();
    EXPECT_EQ(ear.questions, 0U) << berths.log();
    EXPECT_EQ(ear.commands, 0U);
  }
}

// Devices that no master has started are configured once, told to wait for their master, and not asked again.
TEST(Beside, ACommissionerLeavesWhatNobodyStarts) {
  const bool flying = false;
  const Setting setting{.devices = 3, .configured = true};
  Berths berths(machine_of(setting), plant_of(setting), {0, 0}, flying);
  Ear ear(berths);
  berths.machine(1).buses[0].role = design::Role::commissioner;
  berths.begin(1);
  berths.run_for(60s);
  ear.forget();
  berths.run_for(60s);
  for (const auto& slot : berths.network(1).report()) {
    EXPECT_EQ(slot.state, SlotState::present) << berths.log();
    EXPECT_EQ(slot.reason, "ready; the master of its bus starts it, not this Berth (role)");
  }
  EXPECT_LT(ear.frames / 60.0, most_frames_per_second) << berths.log();
  EXPECT_EQ(ear.questions, 0U) << berths.log();
  EXPECT_EQ(ear.commands, 0U);
}

// Its heartbeat is all that is known of it: it may be the plant's master, even under this Berth's own node-ID.
TEST(Beside, WhatMayBeThePlantsMasterIsNotCalledForeign) {
  for (const NodeId id : {plc_id, NodeId(126)}) {
    const bool flying = false;
    const Setting setting{.devices = 3};
    auto plant = plant_of(setting);
    plant.devices.back().node_id = id;
    Berths berths(machine_of(setting), plant, {0, 0}, flying);
    Ear ear(berths);
    berths.machine(1).buses[0].role = design::Role::commissioner;
    berths.begin(0);
    ASSERT_TRUE(berths.run_until([&] { return berths.operational(0); })) << berths.log();
    berths.begin(1);
    berths.run_for(30s);
    const std::string log = berths.log();
    EXPECT_EQ(log.find("take it off the bus"), std::string::npos) << log;
    EXPECT_NE(log.find("may be the master of this plant"), std::string::npos) << log;
    EXPECT_EQ(ear.plc_selected, 0U);
    EXPECT_EQ(berths.world().find("plc")->device().node_id(), id);
  }
}

TEST(Beside, AMastersFirstStartOnARunningNetworkSettles) {
  for (const bool configured : {false, true}) {
    settles({.devices = 3, .configured = configured, .role = design::Role::master});
  }
}

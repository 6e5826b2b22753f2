// Devices as shops sell them (CiA 301 §7.5.2.18 makes the vendor-ID alone mandatory): one without a serial number is
// known by its bus and node-ID, and what a device does not say is unknown, which is not 0.
#include <gtest/gtest.h>
#include <algorithm>
#include <string>

#include "tests/harness/as_sold.hpp"
#include "tests/harness/plant_events.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace who_is_who_tests {
namespace {

NodeId id_of(unsigned id) { return NodeId(static_cast<std::uint8_t>(id)); }
Identity named(std::uint32_t serial, unsigned id) {
  return Identity(type_b.vendor, type_b.product, 0, serial).with(id_of(id));
}

// Slots 5 to `last`, for devices with node-ID switches.
design::Machine fixed_slots(unsigned last, places::Assign assign = places::Assign::fixed) {
  design::Machine m = one_bus(125'000);
  for (unsigned id = 5; id <= last; ++id) {
    add_slot(m, id, type_b);
    m.slots.back().spec.assign = assign;
  }
  return m;
}

plant::PlantDevice& add_switched(plant::PlantFile& p, unsigned id, std::uint32_t serial, bool with_lss = false) {
  auto& d = add_device(p, "v" + std::to_string(id) + "-" + std::to_string(serial), type_b, serial);
  d.source = plant::NodeIdSource::switches;
  d.node_id = id_of(id);
  d.speaks = {};
  if (with_lss) d.speaks = {plant::Speaks::lss, plant::Speaks::rand};
  return d;
}

plant::PlantFile switched(unsigned last, bool with_lss = false) {
  auto p = one_bus_plant(1);
  for (unsigned id = 5; id <= last; ++id) add_switched(p, id, 0, with_lss);
  return p;
}

operate::SlotReport slot(Rig& rig, unsigned id) {
  const auto all = rig.network(0).report();
  const auto it = std::ranges::find(all, id_of(id), &operate::SlotReport::id);
  return it == all.end() ? operate::SlotReport() : *it;
}

std::size_t lines(Rig& rig) { return rig.store().history(std::nullopt).value().size(); }

}  // namespace

TEST(WhoIsWho, EqualDevicesWithSwitchesAndWithoutSerialNumbersAllHaveTheirSlots) {
  for (const unsigned last : {5U, 7U, 40U}) {
    Rig rig(fixed_slots(last), switched(last));
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    for (unsigned id = 5; id <= last; ++id) EXPECT_EQ(slot(rig, id).device, named(0, id)) << id;
    const std::size_t before = lines(rig);
    rig.kill();
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    EXPECT_EQ(lines(rig), before) << "nothing is new to the next run";
  }
}

// `assign` is left as it is, and LSS and RAND hear all of them at once.
TEST(WhoIsWho, SwitchesAndLssBesideEachOther) {
  Rig rig(fixed_slots(7, places::Assign::lss), switched(7, true));
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  rig.run_for(30s);
  EXPECT_TRUE(rig.operational()) << rig.log();
  for (unsigned id = 5; id <= 7; ++id) EXPECT_EQ(rig.device("v" + std::to_string(id) + "-0").truth().active, id_of(id));
}

TEST(WhoIsWho, AnEqualOneInItsPlaceNeedsNobody) {
  auto p = switched(7);
  p.devices.push_back(p.devices.front());
  p.devices.back().name = "new";
  p.devices.back().plugged = false;
  Rig rig(fixed_slots(7), p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  rig.device("v5-0").unplug();
  ASSERT_TRUE(rig.run_until([&] { return slot(rig, 5).state == SlotState::absent; }, 20s)) << rig.log();
  rig.device("new").plug();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(rig.device("new").truth().state, NmtState::operational);
}

// With serial numbers the new one is another device, and `replacement` says whether that is asked about.
TEST(WhoIsWho, AnotherAtTheNodeIdOfAFixedSlotIsItsReplacement) {
  for (const bool automatic : {false, true}) {
    auto p = one_bus_plant(1);
    add_switched(p, 5, 7);
    add_switched(p, 5, 8).plugged = false;
    auto machine = fixed_slots(5);
    if (automatic) machine.slots.front().spec.replacement = places::Replacement::automatic;
    Rig rig(machine, p);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    rig.device("v5-7").unplug();
    ASSERT_TRUE(rig.run_until([&] { return slot(rig, 5).state != SlotState::operational; }, 20s)) << rig.log();
    rig.device("v5-8").plug();
    if (!automatic) {
      rig.run_for(20s);
      EXPECT_NE(rig.device("v5-8").truth().state, NmtState::operational);
      EXPECT_NE(slot(rig, 5).reason.find("`berth replace s5` takes it"), std::string::npos) << slot(rig, 5).reason;
      ASSERT_TRUE(rig.network(0).replace("s5", std::nullopt));
    }
    ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
    EXPECT_EQ(slot(rig, 5).device, named(8, 5));
  }
}

// The row of the store is of the node-ID before: it holds up no device.
TEST(WhoIsWho, ASlotWithAnotherNodeIdHasAnotherDevice) {
  places::MemoryStore store;
  const auto row = store.declare({"rig", "backbone", "s5"}).value();
  ASSERT_TRUE(store.ask(row, {named(0, 6), id_of(6)}, "x"));
  ASSERT_TRUE(store.confirm(row, {named(0, 6), id_of(6)}, "x"));
  Rig rig(fixed_slots(6), switched(6), &store);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(slot(rig, 5).device, named(0, 5));
  EXPECT_EQ(slot(rig, 6).device, named(0, 6));
}

// ---- 1018h has less than it may ----

TEST(WhoIsWho, WhatADeviceDoesNotSayIsUnknown) {
  for (const unsigned parts : {1U, 2U, 3U, 4U}) {
    auto p = switched(7);
    for (auto& d : p.devices) d.eds = d.eds_path = description_of(type_b, parts);
    Rig rig(fixed_slots(7), p);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << parts << rig.log();
    const auto device = slot(rig, 6).device;
    ASSERT_TRUE(device);
    for (unsigned part = 0; part < 4; ++part) EXPECT_EQ(device->knows(part), part < parts) << part;
    EXPECT_EQ(device->at, id_of(6));
  }
}

// LSS tells the whole address, 1018h its vendor-ID: it is one device.
TEST(WhoIsWho, LssTellsMoreThan1018h) {
  design::Machine machine = one_bus(125'000);
  add_slot(machine, 5, type_b);
  auto p = one_bus_plant(1);
  auto& d = add_device(p, "d", type_b, 77);
  d.eds = d.eds_path = description_of(type_b, 1);
  Rig rig(machine, p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(slot(rig, 5).device, named(77, 5));
  rig.device("d").power(false);
  rig.run_for(5s);
  rig.device("d").power(true);
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.run_for(20s);
  EXPECT_TRUE(rig.operational()) << rig.log();
  const auto seen = rig.log().find("DUPLICATE");
  EXPECT_EQ(seen, std::string::npos);
}

// ---- without a node-ID ----

namespace {

design::Machine two_slots(places::WhenAmbiguous when) {
  design::Machine m = one_bus(125'000);
  for (const unsigned id : {5U, 6U}) {
    add_slot(m, id, type_b);
    m.slots.back().spec.when_ambiguous = when;
  }
  return m;
}

plant::PlantFile two_blanks(plant::SpeaksSet speaks, lss::LackSet lacks = {}) {
  auto p = one_bus_plant(1);
  for (const char* name : {"a", "b"}) {
    auto& d = add_device(p, name, type_b, 0);
    d.speaks = speaks;
    d.lss.without = lacks;
  }
  p.devices.back().plugged = false;
  return p;
}

}  // namespace

TEST(WhoIsWho, BlankOnesAreSeatedOneAtATime) {
  using plant::Speaks;
  for (const plant::SpeaksSet speaks : {plant::SpeaksSet{Speaks::lss, Speaks::fastscan},
                                        plant::SpeaksSet{Speaks::lss, Speaks::rand, Speaks::fastscan}}) {
    Rig rig(two_slots(places::WhenAmbiguous::one_at_a_time), two_blanks(speaks));
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return slot(rig, 5).state == SlotState::operational; }, 60s)) << rig.log();
    rig.device("b").plug();
    ASSERT_TRUE(rig.until_operational(90s)) << rig.log();
    EXPECT_EQ(rig.device("a").truth().persistent, id_of(5));
    EXPECT_EQ(rig.device("b").truth().persistent, id_of(6));
    EXPECT_EQ(slot(rig, 5).device, named(0, 5));
    EXPECT_EQ(slot(rig, 6).device, named(0, 6));
    // Both lose their power: each comes back under what it has stored.
    for (const char* name : {"a", "b"}) rig.device(name).power(false);
    rig.run_for(5s);
    for (const char* name : {"a", "b"}) rig.device(name).power(true);
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  }
}

// It does not say who it is: selected by 40h to 43h its equal would be selected with it.
TEST(WhoIsWho, BlankOnesThatAnswerNoInquiryAreSeatedOneAtATime) {
  using lss::Lackable;
  for (const lss::LackSet lacks : {lss::LackSet{Lackable::inquire_identity},
                                   lss::LackSet{Lackable::inquire_identity, Lackable::inquire_node_id}}) {
    Rig rig(two_slots(places::WhenAmbiguous::one_at_a_time), two_blanks({plant::Speaks::fastscan}, lacks));
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return slot(rig, 5).state == SlotState::operational; }, 60s)) << rig.log();
    rig.device("b").plug();
    ASSERT_TRUE(rig.until_operational(90s)) << rig.log();
    EXPECT_EQ(rig.device("a").truth().persistent, id_of(5));
    EXPECT_EQ(rig.device("b").truth().persistent, id_of(6));
  }
}

// A search for the device of an empty slot goes on beside them. Selected by 40h to 43h they would all answer 5Eh, each
// its own node-ID, destroy each other's frames and be bus-off.
TEST(WhoIsWho, ASearchLeavesEqualOnesThatRunInPeace) {
  for (const unsigned parts : {3U, 4U}) {
    auto m = fixed_slots(16, places::Assign::lss);
    m.buses.front().bitrate = 500'000;
    add_slot(m, 20, type_c);  // its device never comes
    auto p = one_bus_plant(3);
    for (unsigned id = 5; id <= 16; ++id) {
      auto& d = add_device(p, "d" + std::to_string(id), type_b, 0);
      d.eds = d.eds_path = description_of(type_b, parts);
      d.source = plant::NodeIdSource::nonvolatile;
      d.node_id = id_of(id);
      d.response = {1ms, 1ms, 0, 0ms};  // all at once
    }
    Rig rig(m, p);
    rig.begin();
    const auto all_run = [&] {
      for (unsigned id = 5; id <= 16; ++id) {
        if (slot(rig, id).state != SlotState::operational) return false;
      }
      return true;
    };
    ASSERT_TRUE(rig.run_until(all_run, 60s)) << rig.log();
    EXPECT_FALSE(rig.run_until([&] { return !all_run(); }, 120s)) << parts << rig.log();
  }
}

TEST(WhoIsWho, OneOfSeveralSlotsIsAskedFor) {
  Rig rig(two_slots(places::WhenAmbiguous::ascending), two_blanks({plant::Speaks::lss, plant::Speaks::fastscan}));
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return slot(rig, 5).state == SlotState::question; }, 60s)) << rig.log();
  EXPECT_NE(rig.log().find("leave only the next one switched on"), std::string::npos) << rig.log();
  EXPECT_EQ(rig.log().find("lug in the others too"), std::string::npos) << rig.log();
}

// It forgets its node-ID, or is one in the place of the one that sat here: nobody can tell, and nobody is asked.
TEST(WhoIsWho, OneThatComesWithoutItsNodeIdIsTheOneThatIsMissing) {
  using plant::Speaks;
  Rig rig(two_slots(places::WhenAmbiguous::one_at_a_time), two_blanks({Speaks::lss, Speaks::fastscan}));
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return slot(rig, 5).state == SlotState::operational; }, 60s)) << rig.log();
  rig.device("a").unplug();
  ASSERT_TRUE(rig.run_until([&] { return slot(rig, 5).state == SlotState::absent; }, 20s)) << rig.log();
  rig.device("b").plug();
  ASSERT_TRUE(rig.run_until([&] { return slot(rig, 5).state == SlotState::operational; }, 60s)) << rig.log();
  EXPECT_EQ(rig.device("b").truth().persistent, id_of(5));
}

// ---- two ways to one device ----

// It says its vendor-ID alone and fits either type: its node-ID tells which slot it came for.
TEST(WhoIsWho, OneThatSaysLittleBelongsWhereItsNodeIdIs) {
  design::Machine machine = one_bus(125'000);
  add_slot(machine, 3, type_c);
  add_slot(machine, 5, type_b);
  auto p = one_bus_plant(1);
  auto& d = add_device(p, "switched", type_c, 0);
  d.eds = d.eds_path = description_of(type_b, 1);
  d.source = plant::NodeIdSource::switches;
  d.node_id = id_of(3);
  d.speaks = {};
  add_device(p, "blank", type_b, 77);
  Rig rig(machine, p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(slot(rig, 5).device, named(77, 5));
}

// The same where its slot is not the first one that it fits.
TEST(WhoIsWho, OneThatSaysLittleBelongsWhereItsNodeIdIsAndNotToTheFirstSlot) {
  design::Machine machine = one_bus(125'000);
  add_slot(machine, 3, type_c);
  add_slot(machine, 5, type_b);
  auto p = one_bus_plant(1);
  auto& d = add_device(p, "switched", type_b, 0);
  d.eds = d.eds_path = description_of(type_b, 1);
  d.source = plant::NodeIdSource::switches;
  d.node_id = id_of(5);
  d.speaks = {};
  add_device(p, "blank", type_c, 77);
  Rig rig(machine, p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  ASSERT_TRUE(slot(rig, 3).device.has_value());
  EXPECT_EQ(slot(rig, 3).device->address.serial, 77U);
}

// SDO tells its vendor-ID, LSS all: it is found twice.
TEST(WhoIsWho, OneThatWasFoundBySdoAndByLssIsOne) {
  for (const std::uint32_t serial : {0U, 9U}) {
    auto p = one_bus_plant(1);
    add_switched(p, 5, serial, true).eds_path = description_of(type_b, 1);
    p.devices.back().eds = p.devices.back().eds_path;
    Rig rig(fixed_slots(6, places::Assign::lss), p);
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return slot(rig, 5).state == SlotState::operational; }, 60s)) << rig.log();
    rig.run_for(20s);
    EXPECT_EQ(slot(rig, 5).state, SlotState::operational) << rig.log();
    EXPECT_EQ(slot(rig, 6).state, SlotState::empty) << rig.log();
  }
}

// Nobody but a hand parts them: the slot does not run on as if there were one.
TEST(WhoIsWho, TwoWithOneNodeIdOnTheirSwitchesAreToldOfTheSlot) {
  auto p = one_bus_plant(1);
  add_switched(p, 5, 7, true);
  add_switched(p, 5, 8, true).plugged = false;
  Rig rig(fixed_slots(5), p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  rig.device("v5-8").plug();
  rig.run_for(30s);
  EXPECT_EQ(slot(rig, 5).state, SlotState::duplicate) << rig.log();
  rig.device("v5-8").unplug();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
}

// Nothing boots and nothing beats: the second one's cable was cut. LSS tells the slot's device and not the other.
TEST(WhoIsWho, OneWithoutLssThatIsHeardAgainBesideTheSlotsIsToldOfTheSlot) {
  auto p = one_bus_plant(1);
  add_device(p, "own", type_b, 7);
  auto& other = add_switched(p, 5, 0);
  cut(p, other.name, 0s, 20s);
  auto m = fixed_slots(5, places::Assign::lss);
  m.slots.back().spec.watch.by = places::SlotWatch::By::none;
  Rig rig(m, p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(15s)) << rig.log();
  rig.run_for(40s);
  EXPECT_EQ(slot(rig, 5).state, SlotState::duplicate) << rig.log();
  rig.device(other.name).unplug();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
}

// The second one booted before Berth began, and beats pre-operational; the slot's own is operational.
TEST(WhoIsWho, TwoVoicesAreNotOneThatLeavesOperationalForEver) {
  auto p = one_bus_plant(1);
  add_device(p, "own", type_b, 7);
  auto& other = add_switched(p, 5, 0);
  other.heartbeat = 200ms;
  cut(p, other.name, 900ms, 19100ms);
  Rig rig(fixed_slots(5, places::Assign::lss), p);
  rig.run_for(1s);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(15s)) << rig.log();
  rig.run_for(40s);
  const std::string log = rig.log();
  std::size_t left = 0;
  for (auto at = log.find("it left operational"); at != std::string::npos; at = log.find("it left operational", at + 1))
    ++left;
  EXPECT_LT(left, 6U) << log;
  EXPECT_EQ(slot(rig, 5).state, SlotState::duplicate) << log;
}

// The one that runs speaks no LSS; its twin does, and has no node-ID.
TEST(WhoIsWho, ATwinWithLssIsNotGivenTheNodeIdOfTheOneThatRuns) {
  using plant::Speaks;
  for (const plant::SpeaksSet speaks :
       {plant::SpeaksSet{Speaks::lss, Speaks::fastscan}, plant::SpeaksSet{Speaks::lss, Speaks::rand}}) {
    auto p = one_bus_plant(1);
    add_switched(p, 5, 7);
    auto& twin = add_device(p, "twin", type_b, 7);
    twin.speaks = speaks;
    twin.plugged = false;
    Rig rig(fixed_slots(5, places::Assign::lss), p);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    rig.device("twin").plug();
    for (int second = 0; second < 40; ++second) {
      rig.run_for(1s);
      ASSERT_NE(rig.device("twin").truth().pending, id_of(5)) << rig.log();
      ASSERT_NE(rig.device("twin").truth().active, id_of(5)) << rig.log();
    }
    EXPECT_NE(rig.log().find("more than one device answers to LSS address"), std::string::npos) << rig.log();
    rig.device("twin").unplug();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  }
}

// It sits on the node-ID of a slot that waits for its own device, and LSS does not reach it: tried twice, then told.
TEST(WhoIsWho, OneWithoutLssOnAnothersNodeIdIsNotToldToGiveItUpForEver) {
  auto p = one_bus_plant(1);
  add_device(p, "own", type_b, 7);
  add_device(p, "second", type_b, 8);
  add_switched(p, 5, 9).plugged = false;
  Rig rig(fixed_slots(6, places::Assign::lss), p);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.operational(); }, 60s) || slot(rig, 5).state == SlotState::question);
  const auto at_five = rig.device("own").truth().active == id_of(5) ? "own" : "second";
  rig.device(at_five).unplug();
  rig.run_for(5s);
  rig.device("v5-9").plug();
  rig.run_for(120s);
  EXPECT_EQ(slot(rig, 5).state, SlotState::absent) << rig.log();
  EXPECT_EQ(slot(rig, 6).state, SlotState::operational) << rig.log();
  std::size_t tries = 0;
  const std::string log = rig.log();
  for (auto at = log.find("taking the node-ID"); at != std::string::npos; at = log.find("taking the node-ID", at + 1)) {
    ++tries;
  }
  EXPECT_EQ(tries, 2U) << log;
  EXPECT_NE(log.find("has node-ID 5, by its switches, plug or firmware, which belongs to slot s5"), std::string::npos)
      << log;
  rig.device("v5-9").unplug();
  rig.device(at_five).plug();
  EXPECT_TRUE(rig.until_operational(60s)) << rig.log();
}

// The Berth before ended behind the word that it would take the node-ID away, and before it asked the device.
TEST(WhoIsWho, ANextBerthDoesNotTakeItUpForEver) {
  auto p = one_bus_plant(1);
  add_device(p, "own", type_b, 7);
  add_switched(p, 5, 9).plugged = false;
  Rig rig(fixed_slots(5, places::Assign::lss), p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  rig.device("own").unplug();
  rig.run_for(5s);
  rig.device("v5-9").plug();
  ASSERT_TRUE(rig.run_until([&] { return !rig.store().unfinished_blanks()->empty(); }, 60s)) << rig.log();
  rig.kill();
  rig.begin();
  rig.run_for(120s);
  EXPECT_TRUE(rig.store().unfinished_blanks()->empty()) << rig.log();
  const std::string log = rig.log();
  std::size_t tries = 0;
  for (auto at = log.find("finishing what an earlier run began"); at != std::string::npos;
       at = log.find("finishing what an earlier run began", at + 1)) {
    ++tries;
  }
  EXPECT_LE(tries, 3U) << log;
  EXPECT_NE(log.find("has node-ID 5, by its switches, plug or firmware"), std::string::npos) << log;
}

// The slot's device says its vendor-ID alone, and so agrees with every device of that maker.
TEST(WhoIsWho, AnotherTypeOfTheSameMakerIsNotTheOneThatSaysLittle) {
  auto p = one_bus_plant(1);
  auto& own = add_switched(p, 5, 0);
  own.eds = own.eds_path = description_of(type_b, 1);
  const std::string name = own.name;
  auto& other = add_device(p, "other", type_c, 9);
  other.source = plant::NodeIdSource::switches;
  other.node_id = id_of(5);
  other.speaks = {};
  other.plugged = false;
  Rig rig(fixed_slots(5), p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  rig.device(name).unplug();
  rig.run_for(5s);
  rig.device("other").plug();
  for (int second = 0; second < 60; ++second) {
    rig.run_for(1s);
    ASSERT_NE(rig.device("other").truth().state, NmtState::operational) << rig.log();
    ASSERT_NE(slot(rig, 5).state, SlotState::operational) << rig.log();
  }
  rig.device("other").unplug();
  rig.device(name).plug();
  EXPECT_TRUE(rig.until_operational(60s)) << rig.log();
}

}  // namespace who_is_who_tests

// The objects of Berth's own master, as an SDO client on the bus sees them: views of the slot table, and what can be
// asked of the manager by writing.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

#include "tests/harness/rig.hpp"
#include "tests/operate/stranger.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace {

constexpr std::uint16_t manager_status = 0x5F00;
constexpr std::uint16_t bus_status = 0x5F01;

design::Machine three_slots() {
  design::Machine m = one_bus(250'000);
  m.buses[0].commands.verbs = {"nmt", "configure", "upload"};
  add_slot(m, 1, type_b);
  add_slot(m, 2, type_b);
  add_slot(m, 3, type_c);
  m.slots[0].spec.mandatory = true;
  m.slots[2].spec.optional = true;
  return m;
}

plant::PlantFile two_devices() {
  auto p = one_bus_plant(15);
  add_device(p, "left", type_b, 11);
  add_device(p, "right", type_b, 12);
  return p;
}

}  // namespace

// S5.23: the diagnosis interface (statuses of the package, the communication system and the nodes) of a master that is
// a slave to any tool's SDO client at the same time.
TEST(ManagerObjects, S5_23_ViewsOfTheSlotTable) {
  Rig rig(three_slots(), two_devices());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  rig.run_for(2s);
  Stranger stranger(rig);
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1F80, 0), 1U) << "NMT master; each slave is started by itself";
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1F81, 1), 0b1'1101U) << "assigned, booted, mandatory, kept alive";
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1F81, 2), 0b1'0101U);
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1F81, 4), 0U) << "no slot";
  EXPECT_EQ(stranger.read<std::uint8_t>(0x1F82, 1), 5);
  EXPECT_EQ(stranger.read<std::uint8_t>(0x1F82, 3), 1) << "missing";
  EXPECT_EQ(stranger.read<std::uint8_t>(0x1F82, 9), 0) << "unknown";
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1F85, 1), type_b.vendor);
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1F86, 2), type_b.product);
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1F88, 2), 12U);
  EXPECT_EQ(stranger.read<std::uint8_t>(0x5F02, 1), static_cast<std::uint8_t>(SlotState::operational));
  EXPECT_EQ(stranger.read<std::uint8_t>(0x5F04, 1), 0) << "no configuration is wanted";
  EXPECT_EQ(stranger.read<std::uint8_t>(manager_status, 2), 3) << "slots";
  EXPECT_EQ(stranger.read<std::uint8_t>(manager_status, 3), 2) << "operational";
  EXPECT_EQ(stranger.read<std::uint8_t>(manager_status, 4), 1) << "empty";
  EXPECT_EQ(stranger.read<std::uint8_t>(manager_status, 7), 1) << "all that need be";
  EXPECT_EQ(stranger.read<std::uint32_t>(bus_status, 1), 250'000U);
  EXPECT_EQ(stranger.read<std::uint8_t>(bus_status, 2), 0) << "error-active";
  EXPECT_EQ(stranger.write(0x1F81, 1, {0, 0, 0, 0}), 0x0601'0002U) << "the machine file says it";
  const auto timeout = static_cast<std::uint32_t>(three_slots().buses[0].timing.heartbeat_timeout / 1ms);
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1016, 1), 1U << 16U | timeout);
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1016, 2), 2U << 16U | timeout);
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1016, 3), 0U) << "nothing is there to watch";
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1016, 4), 0U) << "no slot";
  EXPECT_EQ(stranger.text(0x1F22, 1), "nothing");
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1F26, 1), 0U);
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1F55, 1), 0U);
  EXPECT_EQ(stranger.text(0x1F58, 1), "nothing");
}

// S5.23: the error interface (emergency messages, error statistics).
TEST(ManagerObjects, S5_23_WhatHappensIsCounted) {
  Rig rig(three_slots(), two_devices());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  Stranger stranger(rig);
  const auto boots = stranger.read<std::uint16_t>(0x5F08, 2);
  const std::array<std::uint8_t, 5> info{1, 2, 3, 4, 5};
  ASSERT_TRUE(rig.device("right").device().errors().raise(0x2310, 0x03, info));
  rig.run_for(100ms);
  EXPECT_EQ(stranger.read<std::uint32_t>(0x5F05, 2), 0x03'2310U);
  EXPECT_EQ(stranger.read<std::uint16_t>(0x5F06, 2), 1);
  const auto newest = stranger.read<std::uint64_t>(0x5F09, 1);
  ASSERT_TRUE(newest);
  EXPECT_EQ(*newest & 0xFFFF'FFFF, 0x0323'1002U) << "node 2, 2310h, register 03h";
  const std::chrono::duration<double, std::milli> now = rig.now().time_since_epoch();
  EXPECT_NEAR(static_cast<double>(*newest >> 32U), now.count(), 400);
  EXPECT_EQ(stranger.read<std::uint64_t>(0x5F09, 2), 0U);
  ASSERT_TRUE(rig.device("left").device().errors().raise(0x4210, 0x09, info));
  rig.run_for(100ms);
  EXPECT_EQ(*stranger.read<std::uint64_t>(0x5F09, 1) & 0xFFFF'FFFF, 0x0942'1001U) << "newest first";
  EXPECT_EQ(*stranger.read<std::uint64_t>(0x5F09, 2) & 0xFFFF'FFFF, 0x0323'1002U);
  rig.device("right").power(false);
  ASSERT_TRUE(rig.run_until([&] { return rig.state(2) == SlotState::absent; }, 10s)) << rig.log();
  EXPECT_EQ(stranger.read<std::uint16_t>(0x5F07, 2), 1);
  EXPECT_EQ(stranger.read<std::uint8_t>(0x1F82, 2), 1);
  EXPECT_EQ(stranger.read<std::uint8_t>(manager_status, 7), 0);
  rig.device("right").power(true);
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_EQ(stranger.read<std::uint16_t>(0x5F08, 2), *boots + 1);
  EXPECT_EQ(stranger.read<std::uint32_t>(0x5F05, 2), 0U) << "it booted";
  EXPECT_EQ(stranger.read<std::uint16_t>(bus_status, 8), 1);
  // The objects have 16 bits, the counters more.
  auto& all = const_cast<operate::BusStatistics&>(statistics_of(rig.network()));  // NOLINT: 65,536 boot-ups take hours
  all.tallies[2].losses = 0x1'0001;
  EXPECT_EQ(stranger.read<std::uint16_t>(0x5F07, 2), 0xFFFF);
  EXPECT_EQ(stranger.read<std::uint16_t>(bus_status, 8), 0xFFFF);
}

TEST(ManagerObjects, NmtIsAskedOfTheManager) {
  Rig rig(three_slots(), two_devices());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  Stranger stranger(rig);
  EXPECT_EQ(stranger.write(0x1F82, 1, {4}), 0U);
  ASSERT_TRUE(rig.run_until([&] { return rig.device("left").device().state() == NmtState::stopped; }, 2s));
  rig.run_for(5s);
  EXPECT_EQ(rig.device("left").device().state(), NmtState::stopped) << "the main job does not work against it";
  EXPECT_EQ(stranger.write(0x1F82, 1, {5}), 0U);
  ASSERT_TRUE(rig.until_operational(5s)) << rig.log();
  EXPECT_EQ(stranger.write(0x1F82, 0x80, {127}), 0U);
  ASSERT_TRUE(rig.run_until([&] { return rig.device("right").device().state() == NmtState::pre_operational; }, 2s));
  EXPECT_EQ(stranger.write(0x1F82, 1, {9}), 0x0609'0030U) << "no state";
  EXPECT_EQ(stranger.write(0x1F82, 99, {5}), 0x0609'0030U) << "no slot";
  EXPECT_EQ(stranger.write(0x1F25, 1, {'s', 'a', 'v', 'e'}), 0x0800'0020U);
}

// CiA 302-2, 84h to 87h and 8Fh: all but the master and the requester. A panel without a slot may be the one that asks.
TEST(ManagerObjects, AllOthersAreTheSlots) {
  auto plant = two_devices();
  auto& panel = add_device(plant, "panel", {7, 7}, 1);
  panel.node_id = NodeId(50);
  panel.source = plant::NodeIdSource::hard_coded;
  Rig rig(three_slots(), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  Stranger stranger(rig);
  const auto all_are = [&](NmtState state) {
    return rig.device("left").device().state() == state && rig.device("right").device().state() == state;
  };
  ASSERT_EQ(rig.device("panel").device().state(), NmtState::pre_operational);
  EXPECT_EQ(stranger.write(0x1F82, 0x80, {0x84}), 0U);
  ASSERT_TRUE(rig.run_until([&] { return all_are(NmtState::stopped); }, 2s));
  EXPECT_EQ(rig.device("panel").device().state(), NmtState::pre_operational);
  EXPECT_EQ(stranger.write(0x1F82, 0x80, {0x8F}), 0U);
  ASSERT_TRUE(rig.run_until([&] { return all_are(NmtState::pre_operational); }, 2s));
  EXPECT_EQ(stranger.write(0x1F82, 0x80, {0x85}), 0U);
  ASSERT_TRUE(rig.run_until([&] { return all_are(NmtState::operational); }, 2s)) << rig.log();
  EXPECT_EQ(stranger.write(0x1F82, 1, {0x84}), 0x0609'0030U) << "of all only";
  EXPECT_EQ(stranger.write(0x1F82, 0x80, {0xFF}), 0x0609'0030U) << "no state";
  EXPECT_EQ(stranger.write(0x1F82, 0x80, {0x80}), 0x0609'0030U) << "no state";
  EXPECT_EQ(rig.device("panel").device().state(), NmtState::pre_operational);
}

TEST(ManagerObjects, AConfigurationIsAskedForByItsSignature) {
  auto machine = one_bus(250'000);
  machine.buses[0].commands.verbs = {"nmt", "configure"};
  add_slot(machine, 5, type_pump);
  machine.slots[0].spec.config = example_eds("pump.dcf");
  auto plant = one_bus_plant(3);
  add_device(plant, "pump", type_pump, 7);
  Rig rig(machine, plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  Stranger stranger(rig);
  EXPECT_EQ(stranger.read<std::uint8_t>(0x5F04, 5), 3) << "as it shall be";
  EXPECT_EQ(stranger.write(0x1F82, 5, {127}), 0U);
  ASSERT_TRUE(rig.run_until([&] { return rig.device("pump").device().state() == NmtState::pre_operational; }, 2s));
  rig.run_for(2s);
  const auto configured = [&] {
    return std::ranges::count(rig.events(), operate::EventKind::configured, &operate::Event::kind);
  };
  const auto before = configured();
  EXPECT_EQ(stranger.write(0x1F25, 5, {'c', 'o', 'n', 'f'}), 0U);
  EXPECT_TRUE(rig.run_until([&] { return configured() > before; }, 5s)) << rig.log();
}

// A node of the bus is nobody's: what it may command, the machine file says. Reading is free.
TEST(ManagerObjects, ANodeCommandsNothingUnlessTheMachineFileSaysSo) {
  auto machine = three_slots();
  machine.buses[0].commands = {};
  Rig rig(machine, two_devices());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  Stranger stranger(rig);
  EXPECT_EQ(stranger.write(0x1F82, 1, {4}), 0x0800'0021U);
  EXPECT_EQ(stranger.write(0x1F82, 0x80, {0x84}), 0x0800'0021U);
  EXPECT_EQ(stranger.write(0x1F25, 1, {'c', 'o', 'n', 'f'}), 0x0800'0021U);
  EXPECT_EQ(stranger.write(0x5F0A, 1, {'u', 'p', 'l', 'd'}), 0x0800'0021U);
  EXPECT_EQ(stranger.write(0x1023, 1, {'{', '}'}), 0x0800'0021U);
  rig.run_for(2s);
  EXPECT_EQ(rig.device("left").device().state(), NmtState::operational);
  EXPECT_EQ(stranger.read<std::uint8_t>(0x1F82, 1), 5);
}

// S5.24: without one who carries commands out they are refused, and the buffer is as it was.
TEST(ManagerObjects, S5_24_CommandsAreRefusedWhereNoneCarriesThemOut) {
  Rig rig(three_slots(), two_devices());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  Stranger stranger(rig);
  EXPECT_EQ(stranger.write(0x1023, 1, {'{', '}'}), 0x0800'0021U);
  EXPECT_EQ(stranger.read<std::uint8_t>(0x1023, 2), 0);
}

// ---- 1F20h and 5F0Ah ------------------------------------------------------------------------------------------------

namespace {

design::Machine two_pumps() {
  design::Machine m = one_bus(250'000);
  m.buses[0].commands.verbs = {"upload"};
  add_slot(m, 1, type_pump);
  add_slot(m, 2, type_pump);
  for (auto& slot : m.slots) {
    slot.eds_path = example_eds("pump.eds");
    slot.spec.replacement = places::Replacement::automatic;
  }
  m.slots[1].spec.config = example_eds("pump.dcf");
  return m;
}

plant::PlantFile pumps() {
  auto p = one_bus_plant(3);
  for (const auto* const name : {"one", "two", "spare"}) {
    add_device(p, name, type_pump, static_cast<std::uint32_t>(p.devices.size() + 1));
  }
  p.devices.back().plugged = false;
  return p;
}

constexpr std::uint16_t upload_configuration = 0x5F0A;
const std::vector<std::uint8_t> upld{'u', 'p', 'l', 'd'};
constexpr ObjectRef upper_limit{0x2000, 1};

}  // namespace

// What was set by hand in a device that runs is what its replacement gets.
TEST(ManagerObjects, AReplacementGetsWhatWasUploaded) {
  Rig rig(two_pumps(), pumps());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  Stranger stranger(rig);
  EXPECT_EQ(stranger.text(0x1F20, 1), "nothing") << "neither config = nor an upload";
  EXPECT_EQ(stranger.read<std::uint32_t>(upload_configuration, 1), 0U);
  const auto slot_of = [&](unsigned id) {
    const auto seats = rig.seats();
    return std::ranges::find(seats, id, &std::pair<unsigned, std::uint32_t>::first)->second;
  };
  const std::string sits = slot_of(1) == 1 ? "one" : "two";
  auto& values = rig.device(sits).device().values();
  const auto by_hand = static_cast<std::uint16_t>(values.get_or<std::uint16_t>(upper_limit, 0) + 7);
  ASSERT_EQ(values.set(upper_limit, by_hand), od::AbortCode::none);
  ASSERT_EQ(stranger.write(upload_configuration, 1, upld), 0U);
  ASSERT_TRUE(rig.run_until([&] { return stranger.read<std::uint32_t>(upload_configuration, 1) != 1U; }, 60s));
  ASSERT_EQ(stranger.read<std::uint32_t>(upload_configuration, 1), 2U) << rig.log();
  const std::string dcf = stranger.text(0x1F20, 1);
  EXPECT_NE(dcf.find("ParameterValue=" + std::to_string(by_hand)), std::string::npos) << dcf;
  EXPECT_EQ(stranger.read<std::uint8_t>(0x1F21, 1), 0) << "plain text";
  rig.device(sits).unplug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(1) == SlotState::empty; }, 20s)) << rig.log();
  rig.device("spare").plug();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(slot_of(1), 3U);
  EXPECT_EQ(rig.device("spare").device().values().get_or<std::uint16_t>(upper_limit, 0), by_hand) << rig.log();
}

namespace {

/// 1F22h of slot 2 says what its device has, in the form of CiA 302-3; 1F26h and 1F27h are its 1020h.
void expect_concise(Stranger& stranger, plant::SimDevice& sits) {
  const std::string stream = stranger.text(0x1F22, 2);
  const auto byte = [&](std::size_t at) { return static_cast<std::uint8_t>(stream.at(at)); };
  const auto number = [&](std::size_t at) {
    return byte(at) | byte(at + 1) << 8U | byte(at + 2) << 16U | static_cast<std::uint32_t>(byte(at + 3)) << 24U;
  };
  auto& values = sits.device().values();
  std::size_t at = 4;
  unsigned same = 0;
  for (std::uint32_t left = number(0); left > 0; --left) {
    const auto index = static_cast<std::uint16_t>(byte(at) | byte(at + 1) << 8U);
    const std::string value = stream.substr(at + 7, number(at + 3));
    const auto has = values.bytes({index, byte(at + 2)});
    if (index >= 0x2000)
      same += std::equal(has.begin(), has.end(), value.begin(), value.end(),
                         [](auto a, char b) { return a == static_cast<std::uint8_t>(b); });
    at += 7 + value.size();
  }
  EXPECT_EQ(at, stream.size());
  EXPECT_GE(same, 1U) << "at least one value of the application";
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1F26, 2), values.get_or<std::uint32_t>({0x1020, 1}, 0));
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1F27, 2), values.get_or<std::uint32_t>({0x1020, 2}, 0));
  EXPECT_NE(stranger.read<std::uint32_t>(0x1F27, 2), 0U);
}

}  // namespace

// Whatever its date is, it is compared: CiA 302-2 has no expected date for that.
TEST(ManagerObjects, EachBootHasNoExpectedDate) {
  auto machine = two_pumps();
  machine.slots[1].spec.configuring.when = places::Configure::each_boot;
  Rig rig(machine, pumps());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  Stranger stranger(rig);
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1F26, 2), 0U);
  EXPECT_EQ(stranger.read<std::uint32_t>(0x1F27, 2), 0U);
  EXPECT_NE(stranger.text(0x1F22, 2), "nothing");
}

TEST(ManagerObjects, TheDcfOfASlotAndUploadsThatAreRefused) {
  Rig rig(two_pumps(), pumps());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  Stranger stranger(rig);
  std::ifstream file(example_eds("pump.dcf"), std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  ASSERT_FALSE(text.empty());
  EXPECT_EQ(stranger.text(0x1F20, 2), text) << "that of config =";
  expect_concise(stranger, rig.device(rig.seats()[1].second == 1 ? "one" : "two"));
  EXPECT_EQ(stranger.write(0x1F20, 2, {1, 2, 3, 4}), 0x0800'0021U) << "the machine file does not list \"configure\"";
  EXPECT_EQ(stranger.write(upload_configuration, 1, {'c', 'o', 'n', 'f'}), 0x0800'0020U);
  EXPECT_EQ(stranger.write(upload_configuration, 3, upld), 0x0609'0030U) << "no slot";
  // Nothing is read of a device that is not there, and what the slot wants stays.
  rig.device(rig.seats()[1].second == 1 ? "one" : "two").unplug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(2) == SlotState::empty; }, 20s)) << rig.log();
  EXPECT_EQ(stranger.write(upload_configuration, 2, upld), 0U);
  ASSERT_TRUE(rig.run_until([&] { return stranger.read<std::uint32_t>(upload_configuration, 2) != 1U; }, 60s));
  EXPECT_EQ(stranger.read<std::uint32_t>(upload_configuration, 2), 3U);
  EXPECT_EQ(stranger.text(0x1F20, 2), text);
}

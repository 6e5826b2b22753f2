// A whole device on the simulated bus: start, node-ID, resets, objects that act, errors.
#include <gtest/gtest.h>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "rig.hpp"

namespace berth::device::test {
namespace {

Options blank(std::uint32_t serial) { return {.address = address_of(serial), .bit_rate = 500'000}; }
Options stored(std::uint32_t serial, std::uint8_t id) {
  return {.address = address_of(serial), .node_id = NodeId(id), .bit_rate = 500'000};
}

// docs/protocols/cia305.md §Node-ID and bit rate: without a node-ID a device stops in initialising: LSS (and RAND)
// only, no boot-up. HU.5.
TEST(Device, A3_6_HU_5_UnconfiguredStartsWithLssAndRandOnly) {
  Rig rig;
  Node node(rig.world, rig.bus, blank(5));
  node.on();
  rig.run(milliseconds(10));
  EXPECT_EQ(rig.record.text.size(), 0U);
  EXPECT_EQ(node.device.state(), NmtState::initialising);
  rig.ask("000#8200");  // an NMT command is not heard
  rig.ask("67F#4000100000000000");
  rig.ask("600#4000100000000000");
  EXPECT_EQ(rig.record.text.size(), 3U);
  rig.ask("7E5#4C00000000000000");
  EXPECT_EQ(rig.record.text.back(), "7E4#5000000000000000");
  rig.ask("1F940000#80000000");
  EXPECT_EQ(rig.record.text.back(), "1F500400#") << "chunk(0) = 0100h, shifted by two";
}

// docs/protocols/cia305.md §Node-ID and bit rate: a pending 1..127 in that state, then switch global waiting: boot-up
// with the new node-ID.
TEST(Device, HU_4_HU_5_LssGivesAnUnconfiguredDeviceItsNodeIdAndItBoots) {
  Rig rig;
  Node node(rig.world, rig.bus, blank(5));
  node.on();
  rig.run(milliseconds(1));
  rig.give_id(address_of(5), 3);
  EXPECT_EQ(rig.record.text.back(), "7E4#1100000000000000");
  EXPECT_EQ(rig.record.count("703#00"), 0U);
  EXPECT_EQ(node.device.lss().pending().node_id, NodeId(3));
  EXPECT_FALSE(node.device.node_id().configured());
  EXPECT_FALSE(node.device.lss().persistent().node_id.configured());
  rig.ask("7E5#0400000000000000");
  EXPECT_EQ(rig.record.text.back(), "703#00");
  EXPECT_EQ(node.device.state(), NmtState::pre_operational);
  EXPECT_EQ(node.device.node_id(), NodeId(3));
  rig.ask("603#4018100400000000");
  EXPECT_EQ(rig.record.text.back(), "583#4318100405000000");
  EXPECT_FALSE(node.device.lss().persistent().node_id.configured()) << "not stored";
  node.off();
  node.on();
  rig.run(milliseconds(5));
  EXPECT_EQ(rig.record.count("703#00"), 1U) << "not stored: forgotten at power-off";
}

TEST(Device, StoredNodeIdOutlivesPowerAndIsReadWhole) {
  Rig rig;
  Node node(rig.world, rig.bus, blank(5), {}, milliseconds(7));
  node.on();
  rig.run(milliseconds(1));
  rig.give_id(address_of(5), 3);
  rig.send("7E5#1700000000000000");
  rig.run(milliseconds(6));
  EXPECT_TRUE(node.device.stored().storing());
  EXPECT_EQ(rig.record.count("7E4#1700000000000000"), 0U) << "answered when it is done";
  rig.run(milliseconds(4));
  EXPECT_EQ(rig.record.count("7E4#1700000000000000"), 1U);
  EXPECT_EQ(node.device.lss().persistent().node_id, NodeId(3));
  EXPECT_FALSE(node.device.node_id().configured()) << "stored is not active";
  node.off();
  rig.run(milliseconds(5));
  EXPECT_EQ(rig.record.count("703#00"), 0U);
  node.on();
  rig.run(milliseconds(5));
  EXPECT_EQ(rig.record.count("703#00"), 1U);
}

// S1.53: power lost between 11h and the end of 17h, at every hundredth of the write: the old node-ID or the new one.
TEST(Device, S1_53_PowerLossDuringStoreLeavesOldOrNew) {
  std::map<int, int> seen;
  for (int i = 0; i <= 100; ++i) {
    Rig rig;
    Node node(rig.world, rig.bus, stored(5, 9), {}, milliseconds(10));
    node.on();
    rig.run(milliseconds(1));
    rig.give_id(address_of(5), 3);
    rig.send("7E5#1700000000000000");
    rig.run(microseconds(230) + microseconds(101) * i);
    node.off();
    node.on();
    rig.run(milliseconds(1));
    ++seen[node.device.node_id().value()];
  }
  EXPECT_EQ(seen[9] + seen[3], 101);
  EXPECT_GT(seen[9], 50);
  EXPECT_GT(seen[3], 0);
}

TEST(Device, BrokenMemoryAnswersStorageError) {
  Rig rig;
  Node node(rig.world, rig.bus, blank(5));
  node.flash.broken(true);
  node.on();
  rig.run(milliseconds(1));
  rig.give_id(address_of(5), 3);
  rig.ask("7E5#1700000000000000");
  EXPECT_EQ(rig.record.text.back(), "7E4#1702000000000000");
}

// docs/protocols/cia305.md §Node-ID and bit rate: of a configured device the pending node-ID becomes active with the
// next NMT reset communication; reset node loads what is stored. HC3.10.
TEST(Device, HU_4_PendingBecomesActiveAtResetCommunicationNotAtResetNode) {
  Rig rig;
  Node node(rig.world, rig.bus, stored(5, 9));
  node.on();
  rig.run(milliseconds(1));
  EXPECT_EQ(rig.record.count("709#00"), 1U);
  rig.give_id(address_of(5), 3);
  rig.ask("7E5#0400000000000000");
  EXPECT_EQ(node.device.node_id(), NodeId(9)) << "a configured device does not change at 04 00";
  rig.ask("000#8109");
  EXPECT_EQ(rig.record.count("709#00"), 2U) << "reset node: not stored, so the old one";
  rig.give_id(address_of(5), 3);
  rig.ask("000#8209");
  EXPECT_EQ(rig.record.text.back(), "703#00");
  rig.ask("609#4000100000000000");
  EXPECT_EQ(rig.record.text.back(), "609#4000100000000000") << "does not hear its old identifiers";
  rig.ask("603#4000140000000000");
  EXPECT_EQ(rig.record.text.back(), "583#8000140000000206");
  rig.ask("603#4014100000000000");
  EXPECT_EQ(rig.record.text.back(), "583#4314100083000000") << "1014h follows the node-ID";
}

TEST(Device, DeviceThatChangesAtWaiting) {
  Rig rig;
  auto options = stored(5, 9);
  options.lss.changes_at_waiting = true;
  Node node(rig.world, rig.bus, options);
  node.on();
  rig.run(milliseconds(1));
  rig.give_id(address_of(5), 3);
  rig.ask("7E5#0400000000000000");
  EXPECT_EQ(rig.record.text.back(), "703#00");
}

// S1.36: a new device arrives with a node-ID that belongs to another. It is found by RAND although it is running, and
// made unconfigured by LSS.
TEST(Device, S1_36_StoredForeignNodeIdIsFoundAndTakenAway) {
  Rig rig;
  Node node(rig.world, rig.bus, stored(5, 2));
  node.on();
  rig.run(milliseconds(1));
  for (unsigned phase = 0; phase < 8; ++phase) {
    const auto mask = phase == 0 ? 0U : address_of(5).chunk(phase - 1);
    rig.ask("1F940000#80" + Rig::hex8(phase) + Rig::hex8(mask >> 8) + Rig::hex8(mask & 255));
  }
  rig.ask("1F940000#80080005");
  EXPECT_EQ(rig.record.text.back(), "1F900014#");
  rig.give_id(address_of(5), 0xFF);
  rig.ask("7E5#1700000000000000");
  EXPECT_EQ(rig.record.text.back(), "7E4#1700000000000000");
  rig.ask("000#8202");
  EXPECT_FALSE(node.device.node_id().configured());
  EXPECT_EQ(rig.record.count("702#00"), 1U);
  rig.ask("7E5#0400000000000000");
  rig.ask("7E5#4C00000000000000");
  EXPECT_EQ(rig.record.text.back(), "7E4#5000000000000000");
}

// S4.2: a node-ID from firmware or switches cannot be configured: LSS answers "out of range" and goes on.
TEST(Device, FixedNodeIdRefusesConfiguration) {
  Rig rig;
  auto options = stored(5, 9);
  options.source = NodeIdSource::fixed;
  Node node(rig.world, rig.bus, options);
  node.on();
  rig.run(milliseconds(1));
  rig.give_id(address_of(5), 3);
  EXPECT_EQ(rig.record.text.back(), "7E4#1101000000000000");
  rig.ask("7E5#5E00000000000000");
  EXPECT_EQ(rig.record.text.back(), "7E4#5E09000000000000");
  rig.ask("7E5#1700000000000000");
  rig.ask("000#8109");
  EXPECT_EQ(rig.record.text.back(), "709#00");
  EXPECT_EQ(node.device.lss().persistent().node_id, NodeId(9));
}

TEST(Device, WithoutLssOrRandNothingIsAnswered) {
  Rig rig;
  auto options = stored(5, 9);
  options.lss.on = false;
  options.rand = RandMode::off;
  Node node(rig.world, rig.bus, options);
  node.on();
  rig.run(milliseconds(1));
  rig.record.clear();
  rig.give_id(address_of(5), 3);
  rig.ask("1F940000#80000000");
  EXPECT_EQ(rig.record.count("7E4#4400000000000000"), 0U);
  EXPECT_EQ(rig.record.text.size(), 7U) << "only what the master sent";
}

// S1.31: the paper has RAND in configuration mode only; `literal` does as it says.
TEST(Device, S1_31_LiteralRandAnswersInConfigurationOnly) {
  Rig rig;
  auto options = stored(5, 9);
  options.rand = RandMode::literal;
  Node node(rig.world, rig.bus, options);
  node.on();
  rig.run(milliseconds(1));
  rig.ask("1F940000#80000000");
  EXPECT_EQ(rig.record.count("1F500400#"), 0U);
  rig.ask("7E5#0401000000000000");
  rig.ask("1F940000#80000000");
  EXPECT_EQ(rig.record.count("1F500400#"), 1U);
}

/// A device with objects in both areas.
std::shared_ptr<const od::Description> with_application() {
  od::DescriptionBuilder b;
  b.variable(0x1000, {.access = od::Access::ro, .initial = od::Literal::number(0x00020191)});
  b.variable(0x1001, {.type = od::DataType::unsigned8, .access = od::Access::ro});
  b.variable(0x1017, {.type = od::DataType::unsigned16, .initial = od::Literal::number(200)});
  b.variable(0x2000, {.type = od::DataType::unsigned8, .initial = od::Literal::number(7)});
  b.variable(0x6000, {.type = od::DataType::unsigned8, .initial = od::Literal::number(8)});
  b.variable(0xA000, {.type = od::DataType::unsigned8, .initial = od::Literal::number(9)});
  b.object(0x1018, od::ObjectCode::record, "Identity");
  b.sub(0x1018, {.sub = 1, .access = od::Access::ro});
  return b.build();
}

// HC2.8: reset communication concerns 1000h..1FFFh only, reset node also 2000h..9FFFh (and the rest).
TEST(Device, HC2_8_ResetsConcernTheirObjectRanges) {
  Rig rig;
  Node node(rig.world, rig.bus, stored(5, 9), {}, {}, with_application());
  node.on();
  rig.run(milliseconds(1));
  auto& values = node.device.values();
  const auto read = [&](std::uint16_t index) { return values.get_or<std::uint32_t>({index, 0}, 0xFFFF'FFFF); };
  rig.ask("609#2B171000F4010000");
  for (const char* index : {"0020", "0060", "00A0"}) rig.ask("609#2F" + std::string(index) + "0063000000");
  EXPECT_EQ(read(0x1017), 500U);
  EXPECT_EQ(read(0x2000), 0x63U);
  rig.ask("000#8209");
  EXPECT_EQ(read(0x1017), 200U);
  EXPECT_EQ(read(0x2000), 0x63U);
  EXPECT_EQ(read(0x6000), 0x63U);
  EXPECT_EQ(read(0xA000), 0x63U);
  rig.ask("000#8109");
  EXPECT_EQ(read(0x2000), 7U);
  EXPECT_EQ(read(0x6000), 8U);
  EXPECT_EQ(read(0xA000), 9U);
  EXPECT_EQ(values.get_or<std::uint32_t>({0x1018, 1}, 0), address_of(5).vendor) << "the identity is the device's own";
  EXPECT_EQ(rig.record.count("709#00"), 3U);
}

// docs/protocols/cia301.md §NMT: services by state.
TEST(Device, A3_2_A3_3_ServicesFollowTheNmtState) {
  Rig rig;
  Node node(rig.world, rig.bus, stored(5, 9));
  node.on();
  rig.run(milliseconds(1));
  rig.ask("000#0109");
  EXPECT_EQ(node.device.state(), NmtState::operational);
  rig.ask("000#0200");
  EXPECT_EQ(node.device.state(), NmtState::stopped);
  rig.record.clear();
  rig.ask("609#4000100000000000");
  EXPECT_EQ(rig.record.text.size(), 1U) << "no SDO in stopped";
  rig.ask("709#R1");
  EXPECT_EQ(rig.record.text.back(), "709#04");
  rig.ask("7E5#4C00000000000000");
  rig.ask("1F940000#80000000");
  EXPECT_EQ(rig.record.text.back(), "1F500400#");
  rig.ask("000#8009");
  rig.ask("609#4000100000000000");
  EXPECT_EQ(rig.record.text.back(), "589#4300100000000000");
  rig.ask("000#01");  // not two bytes: no command
  EXPECT_EQ(node.device.state(), NmtState::pre_operational);
}

// docs/protocols/cia301.md §Error control: the first heartbeat follows one period after boot-up; a write of 1017h
// counts at once.
TEST(Device, A4_2_OD_1017_HeartbeatPeriodIsTakenAtOnce) {
  Rig rig;
  auto options = stored(5, 9);
  options.presets.push_back({{0x1017, 0}, 100});
  Node node(rig.world, rig.bus, options);
  node.on();
  rig.run(milliseconds(99));
  EXPECT_EQ(rig.record.text, std::vector<std::string>{"709#00"});
  rig.run(milliseconds(902));
  EXPECT_EQ(rig.record.count("709#7F"), 10U);
  rig.record.clear();
  rig.ask("609#2B171000E8030000", milliseconds(999));
  EXPECT_EQ(rig.record.count("709#7F"), 0U);
  rig.run(milliseconds(3));
  EXPECT_EQ(rig.record.count("709#7F"), 1U);
  rig.ask("000#0109");
  rig.record.clear();
  rig.run(seconds(2));
  EXPECT_EQ(rig.record.count("709#05"), 2U);
  rig.ask("609#2B17100000000000");
  rig.record.clear();
  rig.run(seconds(5));
  EXPECT_EQ(rig.record.text.size(), 0U);
}

// docs/protocols/cia301.md §Error control: toggle 0 in the first answer, then alternating; heartbeat wins. HC2.7.
TEST(Device, A4_4_A4_5_GuardingTogglesAndHeartbeatWins) {
  Rig rig;
  Node node(rig.world, rig.bus, stored(5, 9));
  node.on();
  rig.run(milliseconds(1));
  for (const char* expected : {"709#7F", "709#FF", "709#7F"}) {
    rig.ask("709#R1");
    EXPECT_EQ(rig.record.text.back(), expected);
  }
  rig.ask("709#R0");
  EXPECT_EQ(rig.record.text.back(), "709#FF");
  rig.ask("000#8209");
  rig.ask("709#R1");
  EXPECT_EQ(rig.record.text.back(), "709#7F") << "reset communication: toggle 0 again";
  rig.ask("609#2B17100010270000");
  rig.record.clear();
  rig.ask("709#R1");
  EXPECT_EQ(rig.record.text.size(), 1U);
}

// docs/protocols/cia301.md §Error control, §Emergencies: life guarding and heartbeat lost: EMCY 8130h with register
// bits 4 and 0; pre-operational when operational (1029h:01 = 0); 1001h and 1003h show it.
TEST(Device, A4_6_OD_100C_OD_100D_LifeGuardingLostIsReported) {
  Rig rig;
  Node node(rig.world, rig.bus, stored(5, 9));
  node.on();
  rig.run(milliseconds(1));
  rig.ask("609#2B0C100064000000");  // 100Ch = 100 ms
  rig.ask("609#2F0D100002000000");  // 100Dh = 2
  rig.ask("000#0109");
  rig.run(milliseconds(500));
  EXPECT_EQ(rig.record.count("089#3081110000000000"), 0U) << "begins with the first remote frame";
  rig.ask("709#R1");
  rig.run(milliseconds(190));
  EXPECT_EQ(rig.record.count("089#3081110000000000"), 0U);
  rig.run(milliseconds(10));
  EXPECT_EQ(rig.record.count("089#3081110000000000"), 1U);
  EXPECT_EQ(node.device.state(), NmtState::pre_operational);
  rig.ask("609#4001100000000000");
  EXPECT_EQ(rig.record.text.back(), "589#4F01100011000000");
  rig.ask("609#4003100100000000");
  EXPECT_EQ(rig.record.text.back(), "589#4303100130810000");
  rig.ask("709#R1");
  EXPECT_EQ(rig.record.count("089#0000000000000000"), 1U) << "error reset";
  rig.ask("609#4001100000000000");
  EXPECT_EQ(rig.record.text.back(), "589#4F01100000000000");
}

// docs/protocols/cia301.md §Error control: supervision starts with the first heartbeat; two entries for one node: 0604
// 0043.
TEST(Device, A4_3_OD_1016_HeartbeatConsumerActsAtOnce) {
  Rig rig;
  Node node(rig.world, rig.bus, stored(5, 9));
  node.on();
  rig.run(milliseconds(1));
  rig.ask("609#2316100164000100");  // node 1, 100 ms
  EXPECT_EQ(rig.record.text.back(), "589#6016100100000000");
  rig.ask("609#2316100264000100");
  EXPECT_EQ(rig.record.text.back(), "589#8016100243000406");
  rig.ask("000#0109", milliseconds(300));
  EXPECT_EQ(node.device.state(), NmtState::operational);
  rig.ask("701#05", milliseconds(95));
  EXPECT_EQ(rig.record.count("089#3081110100000000"), 0U);
  rig.run(milliseconds(10));
  EXPECT_EQ(rig.record.count("089#3081110100000000"), 1U);
  EXPECT_EQ(node.device.state(), NmtState::pre_operational);
  rig.ask("701#05");
  EXPECT_EQ(rig.record.count("089#0000000100000000"), 1U);
}

// docs/protocols/cia301.md §Emergencies: 1003h: 0 clears, other values 0609 0030, beyond the count 0800 0024; 1014h:
// the identifier changes only while it is invalid, restricted ones never.
TEST(Device, EmergencyObjectsKeepTheirRules) {
  Rig rig;
  Node node(rig.world, rig.bus, stored(5, 9));
  node.on();
  rig.run(milliseconds(1));
  rig.ask("609#4003100100000000");
  EXPECT_EQ(rig.record.text.back(), "589#8003100124000008");
  node.device.errors().raise(0xFF01, co::error_register::manufacturer);
  rig.run(milliseconds(1));
  EXPECT_EQ(rig.record.text.back(), "089#01FF810000000000");
  rig.ask("609#4003100000000000");
  EXPECT_EQ(rig.record.text.back(), "589#4F03100001000000");
  rig.ask("609#2F03100001000000");
  EXPECT_EQ(rig.record.text.back(), "589#8003100030000906");
  rig.ask("609#2F03100000000000");
  EXPECT_EQ(rig.record.text.back(), "589#6003100000000000");
  rig.ask("609#4003100000000000");
  EXPECT_EQ(rig.record.text.back(), "589#4F03100000000000");

  rig.ask("609#231410008A000000");
  EXPECT_EQ(rig.record.text.back(), "589#8014100030000906");
  rig.ask("609#2314100089000080");
  EXPECT_EQ(rig.record.text.back(), "589#6014100000000000");
  rig.ask("609#2314100001060000");  // 601h
  EXPECT_EQ(rig.record.text.back(), "589#8014100030000906");
  rig.ask("609#231410008A000000");
  EXPECT_EQ(rig.record.text.back(), "589#6014100000000000");
  node.device.errors().raise(0xFF02, co::error_register::manufacturer);
  rig.run(milliseconds(1));
  EXPECT_EQ(rig.record.text.back(), "08A#02FF810000000000");
}

// docs/protocols/can-frames.md §Arbitration, S4.1, SX.7: two devices with one node-ID. Equal frames merge, and each
// hears the other's.
TEST(Device, SX_7_TwoDevicesWithOneNodeIdAreReported) {
  Rig rig;
  auto first = stored(5, 9);
  auto second = stored(6, 9);
  first.presets.push_back({{0x1017, 0}, 100});
  Node a(rig.world, rig.bus, first);
  Node b(rig.world, rig.bus, second);
  a.on();
  b.on();
  rig.run(milliseconds(1));
  EXPECT_EQ(rig.record.count("709#00"), 1U) << "two equal boot-ups at one instant are one frame";
  EXPECT_EQ(rig.record.count("089#5081110000000000"), 0U);
  rig.run(milliseconds(150));
  EXPECT_GE(rig.record.count("089#5081110000000000"), 1U);
  EXPECT_TRUE(b.device.errors().active(co::emcy_code::id_collision));
}

// CiA 305: activate bit timing: D, switch, D of silence, then the new rate.
TEST(Device, BitTimingIsActivatedAfterTwiceTheDelay) {
  Rig rig;
  auto options = stored(5, 9);
  options.presets.push_back({{0x1017, 0}, 10});
  Node node(rig.world, rig.bus, options);
  node.on();
  rig.run(milliseconds(1));
  rig.select(address_of(5));
  rig.ask("7E5#1300030000000000");  // 250 kbit/s
  EXPECT_EQ(rig.record.count("7E4#1300000000000000"), 1U);
  rig.send("7E5#1564000000000000");  // 100 ms
  rig.run(milliseconds(99));
  EXPECT_EQ(node.controller->bit_rate(), 500'000U);
  rig.run(milliseconds(2));
  EXPECT_EQ(node.controller->bit_rate(), 250'000U);
  rig.me->restart(250'000);
  rig.record.clear();
  rig.run(milliseconds(95));
  EXPECT_EQ(rig.record.text.size(), 0U) << "silent for the second delay";
  rig.run(milliseconds(30));
  EXPECT_GE(rig.record.count("709#7F"), 1U);
  rig.ask("7E5#1700000000000000");
  node.off();
  node.on();
  rig.run(milliseconds(5));
  EXPECT_EQ(node.device.lss().persistent().bit_rate, lss::BitRateIndex::kbit_250);
  rig.ask("609#4000100000000000", milliseconds(10));
  EXPECT_EQ(rig.record.count("589#4300100000000000"), 1U) << "starts at the stored rate";
}

TEST(Device, WithoutPowerNothingHappens) {
  Rig rig;
  auto options = stored(5, 9);
  options.presets.push_back({{0x1017, 0}, 10});
  Node node(rig.world, rig.bus, options);
  Node other(rig.world, rig.bus, stored(6, 10));  // acknowledges
  other.on();
  node.on();
  rig.run(milliseconds(50));
  node.off();
  rig.record.clear();
  rig.ask("609#4000100000000000");
  rig.ask("000#0100");
  rig.run(seconds(1));
  EXPECT_EQ(rig.record.text.size(), 2U);
  EXPECT_FALSE(node.device.powered());
}

// HC2.10: what a device may do by itself. 1F80h bit 3 set and bit 2 clear: operational on its own.
TEST(Device, A3_5_SelfStart) {
  for (const unsigned value : {0U, 4U, 8U, 12U}) {
    Rig rig;
    od::DescriptionBuilder b;
    b.variable(0x1F80, {.initial = od::Literal::number(value)});
    Node node(rig.world, rig.bus, stored(5, 9), {}, {}, b.build());
    node.on();
    rig.run(milliseconds(1));
    EXPECT_EQ(node.device.state(), value == 8 ? NmtState::operational : NmtState::pre_operational) << value;
  }
}

// The master is a device: on a dispatcher of the owner's, without memory and host.
TEST(Device, MastersOwnDevice) {
  Rig rig;
  auto controller = rig.bus.attach();
  can::Dispatcher dispatcher(rig.world.executor(), *controller);
  Device master(dispatcher, minimal_description(), nullptr,
                {.address = address_of(99),
                 .source = NodeIdSource::fixed,
                 .node_id = NodeId(127),
                 .lss = {.on = false},
                 .rand = RandMode::off,
                 .presets = {{{0x1017, 0}, 50}}});
  master.power_on();
  rig.run(milliseconds(60));
  EXPECT_EQ(rig.record.text, (std::vector<std::string>{"77F#00", "77F#7F"}));
  master.apply(co::NmtCommand::start);
  rig.run(milliseconds(50));
  EXPECT_EQ(rig.record.text.back(), "77F#05");
  rig.ask("67F#4018100400000000");
  EXPECT_EQ(rig.record.text.back(), "5FF#4318100463000000");
}

TEST(Device, ObserverHearsOfEveryChange) {
  struct Watch final : Device::Observer {
    void device_changed(const Device& d) noexcept override {
      seen.push_back({d.powered(), d.node_id().value(), d.lss().pending().node_id.value(), d.state()});
    }
    struct Seen {
      bool on;
      unsigned id;
      unsigned pending;
      NmtState state;
    };
    std::vector<Seen> seen;
  };
  Rig rig;
  Watch watch;
  Node node(rig.world, rig.bus, blank(5));
  node.device.observe(&watch);
  node.on();
  rig.run(milliseconds(1));
  EXPECT_TRUE(watch.seen.back().on);
  rig.give_id(address_of(5), 3);
  EXPECT_EQ(watch.seen.back().pending, 3U);
  EXPECT_EQ(watch.seen.back().id, 255U);
  rig.ask("7E5#0400000000000000");
  EXPECT_EQ(watch.seen.back().id, 3U);
  EXPECT_EQ(watch.seen.back().state, NmtState::pre_operational);
  node.off();
  EXPECT_FALSE(watch.seen.back().on);
  node.device.observe(nullptr);
}

}  // namespace
}  // namespace berth::device::test

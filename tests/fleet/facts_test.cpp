// When a device is there, and what hosts get of it.
#include "berth/fleet/facts.hpp"

#include <gtest/gtest.h>

#include "berth/fleet/told.hpp"

namespace berth::fleet {
namespace {

using manager::BootStatus;
using places::SlotState;
using sparkplug::Value;

operate::SlotReport slot_in(SlotState state, BootStatus boot = BootStatus::booted) {
  operate::SlotReport slot;
  slot.bus = "field";
  slot.name = "left";
  slot.id = NodeId(5);
  slot.state = state;
  slot.boot = boot;
  return slot;
}

Value value_of(const Facts& facts, const std::string& name) {
  for (const auto& fact : facts) {
    if (fact.name == name) return fact.value;
  }
  return sparkplug::Unsupported{"there is no such fact"};
}

}  // namespace

TEST(FleetFacts, ADeviceIsThereWhenItsIdentityWasChecked) {
  for (const auto state : {SlotState::present, SlotState::configuring, SlotState::power_cycle, SlotState::operational})
    EXPECT_TRUE(is_there(slot_in(state), false)) << places::name(state);
  for (const auto state : {SlotState::unknown, SlotState::empty, SlotState::binding, SlotState::question,
                           SlotState::absent, SlotState::duplicate, SlotState::wrong_type})
    EXPECT_FALSE(is_there(slot_in(state), true)) << places::name(state);
}

// CiA 302-2, boot-up of a slave: the identity is checked before the software and the configuration.
TEST(FleetFacts, AFailedDeviceIsThereIfItFailedAfterTheCheck) {
  for (const auto letter : {BootStatus::b, BootStatus::c, BootStatus::d, BootStatus::m, BootStatus::n, BootStatus::o}) {
    EXPECT_FALSE(is_there(slot_in(SlotState::failed, letter), false)) << manager::letter(letter);
    EXPECT_FALSE(is_there(slot_in(SlotState::failed, letter), true)) << manager::letter(letter);
  }
  for (const auto letter : {BootStatus::g, BootStatus::h, BootStatus::i, BootStatus::j})
    EXPECT_TRUE(is_there(slot_in(SlotState::failed, letter), false)) << manager::letter(letter);
  EXPECT_TRUE(is_there(slot_in(SlotState::failed), true)) << "for another reason: it stays as it was";
  EXPECT_FALSE(is_there(slot_in(SlotState::failed), false));
}

TEST(FleetFacts, ConfigurationAndProgramsInWords) {
  EXPECT_STREQ(configuration_word(slot_in(SlotState::operational), false), "none");
  EXPECT_STREQ(configuration_word(slot_in(SlotState::operational), true), "as wanted");
  EXPECT_STREQ(configuration_word(slot_in(SlotState::configuring), true), "configuring");
  EXPECT_STREQ(configuration_word(slot_in(SlotState::power_cycle), true), "power cycle needed");
  EXPECT_STREQ(configuration_word(slot_in(SlotState::failed, BootStatus::j), true), "failed");
  EXPECT_STREQ(configuration_word(slot_in(SlotState::failed, BootStatus::k), true), "unknown");
  EXPECT_STREQ(program_word(slot_in(SlotState::failed, BootStatus::g), true), "different");
  EXPECT_STREQ(program_word(slot_in(SlotState::failed, BootStatus::h), true), "different");
  EXPECT_STREQ(program_word(slot_in(SlotState::failed, BootStatus::i), true), "update failed");
  EXPECT_STREQ(program_word(slot_in(SlotState::operational), true), "as wanted");
  EXPECT_STREQ(program_word(slot_in(SlotState::operational), false), "none");
}

TEST(FleetFacts, UnknownPartsOfTheIdentityAreNull) {
  auto slot = slot_in(SlotState::operational);
  EXPECT_EQ(value_of(facts_of_device(slot, {}), "Device/Serial number"), Value(sparkplug::Null{}));
  slot.device = Identity(LssAddress{1, 2, 3, 4});
  const auto facts = facts_of_device(slot, {});
  EXPECT_EQ(value_of(facts, "Device/Vendor ID"), Value(std::uint64_t{1}));
  EXPECT_EQ(value_of(facts, "Device/Product code"), Value(std::uint64_t{2}));
  EXPECT_EQ(value_of(facts, "Device/Revision number"), Value(std::uint64_t{3}));
  EXPECT_EQ(value_of(facts, "Device/Serial number"), Value(std::uint64_t{4}));
}

TEST(FleetFacts, AnEmergencyInWords) {
  auto slot = slot_in(SlotState::operational);
  EXPECT_EQ(value_of(facts_of_device(slot, {}), "EMCY/Code"), Value(std::uint64_t{0}));
  slot.emcy = operate::EmcyReport{.code = 0x2310, .error_register = 3, .text = "overcurrent"};
  const auto facts = facts_of_device(slot, {});
  EXPECT_EQ(value_of(facts, "EMCY/Code"), Value(std::uint64_t{0x2310}));
  EXPECT_EQ(value_of(facts, "EMCY/Register"), Value(std::uint64_t{3}));
  EXPECT_EQ(value_of(facts, "EMCY/Text"), Value(std::string("overcurrent")));
}

TEST(FleetFacts, HeartbeatsAreNoNews) {
  auto slot = slot_in(SlotState::operational);
  auto later = slot;
  later.heard = rt::Time(std::chrono::seconds(7));
  later.since = rt::Time(std::chrono::seconds(5));
  EXPECT_TRUE(same(slot, later));
  later.nmt = NmtState::stopped;
  EXPECT_FALSE(same(slot, later));
  later = slot;
  later.reason = "why";
  EXPECT_FALSE(same(slot, later));
}

TEST(FleetFacts, APortInOneWord) {
  EXPECT_STREQ(port_word({.bus_off = true, .up = true}), "bus-off");
  EXPECT_STREQ(port_word({.up = false}), "down");
  EXPECT_STREQ(port_word({.tec = 128, .up = true, .knows_counters = true}), "error passive");
  EXPECT_STREQ(port_word({.tec = 128, .up = true}), "up") << "the counter is not real";
  const auto facts = facts_of_bus({.name = "field", .port = {.tec = 3, .up = true}});
  EXPECT_EQ(value_of(facts, "Buses/field/TEC"), Value(sparkplug::Null{}));
}

}  // namespace berth::fleet

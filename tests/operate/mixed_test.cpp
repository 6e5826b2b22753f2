// Networks where not every device speaks RAND (S1.54): whatever they speak, they are found and get their places.
#include <gtest/gtest.h>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using plant::Speaks;
using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

namespace {

const Seats table_2{{1, 0x0A}, {2, 5}, {3, 8}, {4, 6}, {5, 7}};

// The only device of its type does not speak RAND: LSS identify finds it.
TEST(MixedNetwork, S1_54_ASlaveWithoutRandIsFoundByLss) {
  auto plant = five_slaves();
  plant.devices[2].speaks.remove(Speaks::rand);
  Rig rig(five_slots(), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), table_2) << rig.log();
}

// One of three of a type does not speak RAND, and is the middle one: rule 2 holds over all three.
TEST(MixedNetwork, S1_54_OneOfThreeWithoutRandTakesItsPlaceInTheOrder) {
  auto plant = five_slaves();
  plant.devices[3].speaks.remove(Speaks::rand);
  Rig rig(five_slots(), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), table_2) << rig.log();
}

// S4.2, S4.13: each device speaks something else.
TEST(MixedNetwork, S4_13_FiveDevicesFiveSchemes) {
  auto plant = five_slaves();
  plant.devices[0].speaks = {Speaks::lss};
  plant.devices[1].speaks = {Speaks::fastscan};
  plant.devices[2].speaks = {Speaks::rand, Speaks::lss};
  plant.devices[3].speaks = {Speaks::feedback_29};
  plant.devices[4].speaks = {Speaks::feedback_11};
  Rig rig(five_slots(), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), table_2) << rig.log();
}

class OneScheme : public testing::TestWithParam<std::pair<const char*, Speaks>> {};

// `discovery = METHOD` finds and binds what `auto` does with RAND, with devices that speak only what it asks.
TEST_P(OneScheme, FindsAndBindsTheFive) {
  auto machine = five_slots();
  machine.buses.front().discovery = GetParam().first;
  auto plant = five_slaves();
  for (auto& device : plant.devices) {
    device.speaks = {Speaks::lss};
    device.speaks.add(GetParam().second);
  }
  Rig rig(machine, plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(120s)) << rig.log();
  EXPECT_EQ(rig.seats(), table_2) << rig.log();
  for (const auto& t : rig.world().truth()) {
    EXPECT_EQ(t.persistent, t.active) << t.name << ": nobody keeps a node-ID that was lent";
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, OneScheme,
                         testing::Values(std::pair{"auto", Speaks::lss}, std::pair{"auto", Speaks::fastscan},
                                         std::pair{"auto", Speaks::feedback_29}, std::pair{"rand", Speaks::rand},
                                         std::pair{"planner-rand", Speaks::rand}, std::pair{"identify", Speaks::lss},
                                         std::pair{"and", Speaks::and_protocol},
                                         std::pair{"fastscan", Speaks::fastscan},
                                         std::pair{"fastscan-feedback-29", Speaks::feedback_29},
                                         std::pair{"fastscan-feedback-11", Speaks::feedback_11},
                                         std::pair{"planner-fastscan", Speaks::fastscan},
                                         std::pair{"planner-feedback", Speaks::feedback_29}));

// The machine file's words are the methods' names, and there is no other.
TEST(DiscoveryWords, AreTheNamesOfTheMethods) {
  for (std::size_t i = 0; i < discovery::methods; ++i) {
    const std::string word(discovery::name(static_cast<discovery::Method>(i)));
    const auto result = design::read_machine(
        "[machine]\nname = \"m\"\n[bus.b]\nport = \"sim\"\nbitrate = 125_000\ndiscovery = \"" + word + "\"\n", "m.toml",
        {});
    ASSERT_TRUE(result.machine) << word;
    EXPECT_EQ(result.machine->buses.front().discovery, word);
  }
}

// S1.36: a device without RAND that comes with a node-ID of another slot.
TEST(MixedNetwork, S4_02_AStoredNodeIdWithoutRandIsFoundAndSetRight) {
  auto plant = five_slaves();
  auto& device = plant.devices[2];
  device.speaks = {Speaks::fastscan};
  device.source = plant::NodeIdSource::nonvolatile;
  device.node_id = NodeId(4);
  Rig rig(five_slots(), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), table_2) << rig.log();
}

}  // namespace

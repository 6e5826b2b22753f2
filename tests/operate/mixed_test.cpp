// Networks where not every device speaks RAND (S1.54).
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

namespace {

// The only device of its type does not answer: its slot stays empty and says so, and the others do not wait for it.
TEST(MixedNetwork, S1_54_ASlaveWithoutRandLeavesItsSlotEmptyAndTheOthersRun) {
  auto plant = five_slaves();
  plant.devices[2].speaks.remove(plant::Speaks::rand);
  Rig rig(five_slots(), plant);
  rig.begin();
  const auto running = [&] {
    for (const unsigned id : {1U, 2U, 4U, 5U}) {
      if (rig.state(id) != SlotState::operational) return false;
    }
    return true;
  };
  ASSERT_TRUE(rig.run_until(running, 60s)) << rig.log();
  rig.run_for(10s);
  EXPECT_EQ(rig.state(3), SlotState::empty) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{1, 0x0A}, {2, 5}, {4, 6}, {5, 7}})) << rig.log();
  EXPECT_FALSE(rig.network().operational());
  for (const auto& slot : rig.network().report()) EXPECT_EQ(slot.reason.empty(), slot.id != NodeId(3)) << slot.reason;
}

// One of three of a type does not answer: two devices for three slots are a question, never a guess.
TEST(MixedNetwork, S1_54_OneOfThreeWithoutRandIsAQuestion) {
  auto plant = five_slaves();
  plant.devices[3].speaks.remove(plant::Speaks::rand);
  Rig rig(five_slots(), plant);
  rig.begin();
  rig.run_for(30s);
  for (const unsigned id : {2U, 4U, 5U}) EXPECT_EQ(rig.state(id), SlotState::question) << id << '\n' << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{1, 0x0A}, {3, 8}})) << rig.log();
}

}  // namespace

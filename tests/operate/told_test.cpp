// What a slot's reason says after a person's commands.
#include <gtest/gtest.h>
#include <string>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace {

design::Machine slot_three() {
  auto machine = one_bus(125'000);
  add_slot(machine, 3, type_b);
  return machine;
}

plant::PlantFile its_device() {
  auto plant = one_bus_plant(1);
  add_device(plant, "a", type_b, 7);
  return plant;
}

std::string reason_of(Rig& rig) { return rig.network().report().front().reason; }

}  // namespace

// "No heartbeat told ..." hid the EMCY 5000h that explains it.
TEST(Told, AnEmergencyExplainsWhyADeviceDoesNotBecomeOperational) {
  Rig rig(slot_three(), its_device());
  auto& device = rig.device("a").device();
  device.on().state = [&](NmtState state) {
    if (state != NmtState::operational) return;
    device.raise(0x5000, 0x01);
    device.apply(co::NmtCommand::enter_pre_operational);
  };
  rig.begin();
  rig.run_for(20s);
  EXPECT_EQ(rig.state(3), SlotState::failed) << rig.log();
  EXPECT_EQ(
      reason_of(rig),
      "it was started and no heartbeat told that it is operational; it told an error: EMCY 5000h (device hardware)");
}

// `nmt preop` after `nmt stop` left "it was made stopped" in the status.
TEST(Told, TheReasonFollowsTheNextCommand) {
  Rig rig(slot_three(), its_device());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  const auto tell = [&](co::NmtCommand command) {
    rig.network().commanded(command, NodeId(3));
    rig.network().services().nmt.queue(command, NodeId(3));
    rig.run_for(5s);
  };
  tell(co::NmtCommand::stop);
  EXPECT_EQ(rig.state(3), SlotState::present);
  EXPECT_EQ(reason_of(rig), "it was made stopped; `berth nmt start 3` starts it");
  tell(co::NmtCommand::enter_pre_operational);
  EXPECT_EQ(rig.state(3), SlotState::present);
  EXPECT_EQ(reason_of(rig), "it was made pre-operational; `berth nmt start 3` starts it");
  tell(co::NmtCommand::start);
  EXPECT_EQ(rig.state(3), SlotState::operational) << rig.log();
  EXPECT_EQ(reason_of(rig), "");
}

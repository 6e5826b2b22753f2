// Two devices under one node-ID beneath a gateway: a state of the slot, not a stream of emergencies. (That a gateway's
// master gives no node-ID twice is tests/network's; here somebody brings a second device along.)
#include <algorithm>
#include <chrono>
#include <string>

#include "../pch.hpp"
#include "rig.hpp"

namespace berth::tree_tests {
namespace {

using namespace std::chrono_literals;
using places::SlotState;

constexpr const char* twin = R"(
[[device]]
bus = "bus1"
name = "twin"
type = { vendor = 1, product = 7 }
serial = 999
node_id = 5
plugged = false
speaks = [SPEAKS]
)";

std::string twin_that_speaks(const std::string& words) {
  std::string text = twin;
  return text.replace(text.find("SPEAKS"), 6, words);
}

}  // namespace

TEST(TwoDevices, UnderOneNodeIdAreAStateOfTheSlot) {
  const auto made = chain(1);
  Rig rig(made.machine, made.plant + twin_that_speaks(""));  // no LSS: its node-ID cannot be taken away
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(5s);
  rig.forget_events();
  rig.device("twin").plug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state("valve 1") == SlotState::duplicate; }, 30s)) << rig.log();
  EXPECT_NE(rig.slot("valve 1").reason.find("two devices"), std::string::npos) << rig.slot("valve 1").reason;
  const auto before = rig.told("valve 1").size();
  rig.run_for(60s);
  EXPECT_EQ(rig.state("valve 1"), SlotState::duplicate);
  EXPECT_EQ(rig.told("valve 1").size(), before) << rig.log();
  EXPECT_FALSE(rig.session().operational());
  // The other one is still in doubt: nobody can tell from here which of the two went.
  rig.device("twin").unplug();
  rig.device("valve 1").reset();
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(10s);
  EXPECT_EQ(rig.state("valve 1"), SlotState::operational);
}

// By LSS the gateway's master tells them apart: the second one gives the node-ID up, and has no place.
TEST(TwoDevices, OfWhichOneSpeaksLssAreToldApart) {
  const auto made = chain(1);
  Rig rig(made.machine, made.plant + twin_that_speaks("\"lss\""));
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(5s);
  rig.forget_events();
  rig.device("twin").plug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state("valve 1") == SlotState::duplicate; }, 30s)) << rig.log();
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(60s);
  EXPECT_EQ(rig.state("valve 1"), SlotState::operational);
  EXPECT_FALSE(rig.device("twin").truth().active.configured());
  EXPECT_NE(rig.log().find("1 device has no place here, the first with serial number 000003E7h"), std::string::npos)
      << rig.log();
}

// A single 8150h is an event, as any other.
TEST(TwoDevices, OneCollisionIsAnEvent) {
  const auto made = chain(1);
  Rig rig(made.machine, made.plant);
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(5s);
  rig.forget_events();
  auto& errors = rig.device("valve 1").device().errors();
  errors.raise(co::emcy_code::id_collision, co::error_register::communication);
  rig.run_for(10s);
  EXPECT_EQ(rig.state("valve 1"), SlotState::operational);
  ASSERT_EQ(rig.told("valve 1").size(), 1U) << rig.log();
  EXPECT_TRUE(rig.told("valve 1").front().starts_with("EMCY 3/5: 8150h")) << rig.log();
}

}  // namespace berth::tree_tests

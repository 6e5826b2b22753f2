// A gateway beneath another one comes back without the network list that Berth brought in: it is a new one, or lost its
// power before the list was saved. Its bus runs again without anybody's doing (docs/multilevel.md).
#include <chrono>
#include <string>

#include "../pch.hpp"
#include "objects.hpp"
#include "rig.hpp"

namespace berth::tree_tests {
namespace {

using namespace std::chrono_literals;
using places::SlotState;

constexpr int levels = 3;

// With a new gateway for each, not plugged yet.
Chain with_spares() {
  auto made = chain(levels);
  for (int level = 2; level <= levels; ++level) {
    const auto n = std::to_string(level);
    const std::string above = "bus" + std::to_string(level - 1);
    made.plant += "[[device]]\nbus = \"" + above + "\"\nname = \"spare gateway " + n +
                  "\"\ntype = { vendor = 1, product = 88 }\nserial = " + std::to_string(900 + level) +
                  "\nplugged = false\n[[device]]\nbus = \"bus" + n + "\"\nname = \"spare port " + n +
                  "\"\ntype = { vendor = 1, product = 89 }\nserial = " + std::to_string(950 + level) +
                  "\nnode_id = 1\nsource = \"hard-coded\"\nmaster = { flying = false }\nplugged = false\n" +
                  "[[gateway]]\nabove = \"spare gateway " + n + "\"\nbeneath = [\"spare port " + n + "\"]\n";
  }
  return made;
}

void exchange(Rig& rig, int level, rt::Duration away) {
  for (const auto* const side : {"gateway ", "port "}) rig.device(side + std::to_string(level)).unplug();
  rig.run_for(away);
  for (const auto* const side : {"spare gateway ", "spare port "}) rig.device(side + std::to_string(level)).plug();
}

}  // namespace

TEST(GatewaysReturn, ANewOneGetsTheNetworkListOfItsBus) {
  for (int level = 2; level <= levels; ++level) {
    for (const rt::Duration away : {rt::Duration(300ms), rt::Duration(20s)}) {
      SCOPED_TRACE(std::to_string(level) + " after " + std::to_string(away / 1ms) + " ms");
      const auto made = with_spares();
      Rig rig(made.machine, made.plant);
      ASSERT_TRUE(rig.up()) << rig.log();
      rig.run_for(5s);
      rig.forget_events();
      exchange(rig, level, away);
      rig.run_for(20s);
      EXPECT_TRUE(rig.up()) << rig.log();
      const auto n = std::to_string(level);
      EXPECT_EQ(rig.device("spare gateway " + n).truth().state, NmtState::operational);
      EXPECT_EQ(rig.device("valve " + n).truth().state, NmtState::operational);
      EXPECT_EQ(rig.slot("gateway " + n).device->address.serial, static_cast<std::uint32_t>(900 + level)) << rig.log();
    }
  }
}

// The list was written and dated, and the power failed before it was saved: what is there then has another date.
TEST(GatewaysReturn, OneThatLostAnUnsavedListGetsItAgain) {
  const auto made = chain(2);
  Rig rig(made.machine, made.plant);
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(5s);
  Objects objects(rig);
  const ObjectRef days{0x1020, 1};
  const ObjectRef valve{0x1F81, 5};
  const auto was = objects.read("3/3/1", {days, valve});
  ASSERT_EQ(was.size(), 2U);
  EXPECT_TRUE(objects.write("3/3/1", days, 5));
  EXPECT_TRUE(objects.write("3/3/1", valve, was[1] & ~4U));  // as in the first list: it is not booted
  EXPECT_TRUE(objects.write("3/3/1", {0x1010, 1}, 0x65766173));
  EXPECT_TRUE(objects.write("3/3/1", valve, was[1]));
  EXPECT_TRUE(objects.write("3/3/1", days, was[0]));
  rig.run_for(5s);
  ASSERT_EQ(rig.state("valve 2"), SlotState::operational);
  rig.device("gateway 2").power(false);
  rig.run_for(20s);
  rig.device("gateway 2").power(true);
  rig.run_for(5s);
  EXPECT_TRUE(rig.up()) << rig.log();
  rig.run_for(5s);
  EXPECT_EQ(objects.read("3/3/1", {days, valve}), was) << rig.log();
  EXPECT_EQ(rig.device("valve 2").truth().state, NmtState::operational);
  rig.device("gateway 2").power(false);
  rig.run_for(20s);
  rig.device("gateway 2").power(true);
  rig.run_for(20s);
  EXPECT_EQ(objects.read("3/3/1", {days, valve}), was) << "it is saved";
}

}  // namespace berth::tree_tests

// The main job end to end on the simulator: paper 1's machine, its replacement story, and what goes wrong.
#include <gtest/gtest.h>
#include <cstdint>
#include <optional>
#include <vector>

#include "berth/rt/scope.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

namespace {

rt::Task<void> bind_alone(operate::Network& network, bool& done) {
  const auto bound = co_await network.bind_once();
  EXPECT_TRUE(bound);
  done = true;
}

}  // namespace

// S1.1, S1.26, S1.38: one master, five slots, five slaves. Table I becomes Table II's first column, from blank devices
// to operational ones.
TEST(MainJob, S1_01_S1_38_FiveBlankSlavesBecomeTableTwo) {
  Rig rig(five_slots(), five_slaves());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{1, 0x0A}, {2, 5}, {3, 8}, {4, 6}, {5, 7}})) << rig.log();
  for (const auto& t : rig.world().truth()) {
    EXPECT_EQ(t.state, NmtState::operational) << t.name;
    EXPECT_EQ(t.persistent, t.active) << t.name;
  }
}

// S1.51, S1.4: s2 and s4 fail; devices 15h and 18h come; a person presses the button twice.
TEST(MainJob, S1_51_S1_04_ReplacementEndsInTableTwo) {
  auto plant = five_slaves();
  add_device(plant, "new15", type_b, 0x15).plugged = false;
  add_device(plant, "new18", type_b, 0x18).plugged = false;
  Rig rig(five_slots(), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  rig.device("d2").unplug();
  rig.device("d4").unplug();
  ASSERT_TRUE(
      rig.run_until([&] { return rig.state(2) == SlotState::absent && rig.state(4) == SlotState::absent; }, 20s))
      << rig.log();
  rig.device("new15").plug();
  rig.device("new18").plug();
  rig.run_for(5s);
  EXPECT_EQ(rig.state(2), SlotState::absent) << "nobody pressed the button";
  ASSERT_TRUE(rig.network().replace("s2", std::nullopt));
  ASSERT_TRUE(rig.network().replace("s4", std::nullopt));
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{1, 0x0A}, {2, 0x15}, {3, 8}, {4, 0x18}, {5, 7}})) << rig.log();
  if (getenv("SHOW")) puts(rig.log().c_str());
}

// A device is started when it has its node-ID, not when all have theirs; `berth bind` starts none.
TEST(MainJob, ADeviceIsStartedWhileOthersAreStillBound) {
  design::Machine machine = five_slots();
  plant::PlantFile plant = five_slaves();
  for (unsigned id = 6; id <= 20; ++id) add_slot(machine, id, type_b);
  for (unsigned id = 6; id <= 20; ++id) add_device(plant, "d" + std::to_string(id), type_b, 0x100 + id);
  Rig rig(machine, plant);
  rig.begin();
  const auto count = [&](const auto& fits) {
    unsigned n = 0;
    for (const auto& t : rig.world().truth()) n += fits(t) ? 1U : 0U;
    return n;
  };
  const auto started = [&] { return count([](const auto& t) { return t.state == NmtState::operational; }); };
  ASSERT_TRUE(rig.run_until([&] { return started() == 1; }, 60s)) << rig.log();
  EXPECT_GT(count([](const auto& t) { return !t.persistent.configured(); }), 10U) << rig.log();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();

  Rig binding(machine, plant);
  binding.begin();
  binding.network().stop();
  bool done = false;
  rt::Scope scope(binding.world().executor());
  scope.spawn(bind_alone(binding.network(), done));
  ASSERT_TRUE(binding.run_until([&] { return done; }, 60s)) << binding.log();
  for (const auto& t : binding.world().truth()) {
    EXPECT_TRUE(t.persistent.configured()) << t.name;
    EXPECT_NE(t.state, NmtState::operational) << t.name;
  }
}

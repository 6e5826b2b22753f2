// A bus at rest on which a slot waits for a device that is not there: the longer nothing changes, the less Berth sends;
// a device that comes is seated as soon as before.
#include <gtest/gtest.h>

#include <string>

#include "berth/operate/main_job.hpp"
#include "tests/harness/master_ear.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using plant::Speaks;

namespace at_rest_tests {
namespace {

constexpr unsigned running = 12;
constexpr NodeId missing(40);
constexpr double most_frames_per_second = 12;  // with Berth's own heartbeat

struct Setting {
  plant::SpeaksSet speaks{Speaks::lss};
  bool has_node_id = false;  // of the device that comes: one that no slot has
};

void rests(const Setting& setting) {
  auto machine = one_bus(125'000);
  auto plant = one_bus_plant(1);
  for (unsigned i = 1; i <= running; ++i) {
    add_slot(machine, i, type_a);
    add_device(plant, "d" + std::to_string(i), type_a, 0x9E37'79B9U * i).speaks = setting.speaks;
  }
  add_slot(machine, missing.value(), type_b);
  auto& late = add_device(plant, "late", type_b, 5);
  late.speaks = setting.speaks;
  late.plugged = false;
  if (setting.has_node_id) {
    late.source = plant::NodeIdSource::nonvolatile;
    late.node_id = NodeId(99);
  }
  for (auto& slot : machine.slots) slot.spec.when_ambiguous = places::WhenAmbiguous::ascending;
  Rig rig(machine, plant);
  MasterEar ear(rig);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(missing.value()) == SlotState::empty; }, 120s)) << rig.log();
  rig.run_for(300s);
  ear.frames = 0;
  rig.run_for(200s);
  EXPECT_LT(ear.frames / 200.0, most_frames_per_second) << rig.log();
  rig.device("late").plug();
  EXPECT_TRUE(rig.until_operational(15s)) << rig.log();
}

}  // namespace

TEST(AtRest, AnEmptySlotCostsLittle) {
  for (const auto& speaks : {plant::SpeaksSet{Speaks::lss}, plant::SpeaksSet{Speaks::lss, Speaks::rand},
                             plant::SpeaksSet{Speaks::fastscan}}) {
    for (const bool has_node_id : {false, true}) rests({.speaks = speaks, .has_node_id = has_node_id});
  }
}

// They answer Fastscan at work. A blank one that answers neither 4Ch nor RAND, and that no slot waits for, is found
// among them all the same.
TEST(AtRest, BesideDevicesThatAnswerFastscanAtWorkASearchTakesItsTime) {
  constexpr unsigned lelys = 16;
  constexpr double most = 5;
  for (const unsigned bit_rate : {10'000U, 125'000U}) {
    SCOPED_TRACE(bit_rate);
    auto machine = one_bus(bit_rate);
    auto plant = one_bus_plant(1);
    for (unsigned i = 1; i <= lelys; ++i) {
      add_slot(machine, i, type_a);
      auto& d = add_device(plant, "d" + std::to_string(i), type_a, 0x9E37'79B9U * i);
      d.speaks = {Speaks::lss, Speaks::fastscan};
      d.lss.habit = plant::Habit::lely;
    }
    auto& stranger = add_device(plant, "stranger", type_b, 5);
    stranger.speaks = {Speaks::lss, Speaks::fastscan};
    stranger.lss.habit = plant::Habit::canopennode;
    stranger.plugged = false;
    for (auto& slot : machine.slots) slot.spec.when_ambiguous = places::WhenAmbiguous::ascending;
    Rig rig(machine, plant);
    MasterEar ear(rig);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(600s)) << rig.log();
    rig.run_for(60s);
    for (unsigned window = 0; window < 10; ++window) {
      ear.frames = 0;
      rig.run_for(30s);
      EXPECT_LT(ear.frames / 30.0, most) << window << rig.log();
    }
    rig.device("stranger").plug();
    const auto is_found = [&] { return rig.log().find("-00000005") != std::string::npos; };
    for (auto passed = 0s; passed < 2400s && !is_found(); passed += 30s) rig.run_for(30s);
    EXPECT_TRUE(is_found()) << rig.log();
  }
}

// How often: 8 periods, and twice as long behind every round in vain from the fourth on, until something changes.
TEST(AtRest, ASearchInVainBecomesSeldomAndBeginsAnew) {
  operate::SearchPace pace;
  const operate::SearchPace::View still{.found = 1, .heard = 3};
  EXPECT_TRUE(pace.look(still));
  for (const int periods : {8, 8, 8, 8, 16, 32, 64, 64}) {
    EXPECT_FALSE(pace.look(still));
    EXPECT_EQ(pace.round(), periods);
  }
  EXPECT_FALSE(pace.is_eager());
  EXPECT_TRUE(pace.look({.found = 1, .boot_ups = 1, .heard = 3})) << "a device booted";
  EXPECT_TRUE(pace.is_eager());
  EXPECT_EQ(pace.round(), 8);
  for (int i = 0; i < 8; ++i) static_cast<void>(pace.round());
  pace.hurry();
  EXPECT_EQ(pace.round(), 8) << "a person said so";
}

}  // namespace at_rest_tests

// Two devices under one node-ID, devices that are lent node-IDs, devices that leave unnoticed: what random worlds
// found, each as one case.
#include <gtest/gtest.h>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "berth/operate/loans.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using operate::Loans;
using places::SlotState;
using plant::Habit;
using plant::Speaks;
using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

namespace {

constexpr LssAddress one{1, 2, 3, 4};
constexpr LssAddress other{1, 2, 3, 5};

plant::PlantDevice& stored(plant::PlantFile& plant, const std::string& name, TypeCode type, std::uint32_t serial,
                           unsigned id) {
  auto& d = add_device(plant, name, type, serial);
  d.source = plant::NodeIdSource::nonvolatile;
  d.node_id = NodeId(static_cast<std::uint8_t>(id));
  d.speaks = {Speaks::lss, Speaks::fastscan};
  d.lss.habit = Habit::canopennode;
  return d;
}

design::Machine slot_five() {
  design::Machine m = one_bus(125'000);
  add_slot(m, 5, type_b);
  return m;
}

plant::PlantFile its_own_device() {
  auto p = one_bus_plant(1);
  add_device(p, "own", type_b, 1);
  return p;
}

struct LssEar final : can::Tap {
  void frame(const can::Frame& f, rt::Time, int) noexcept override {
    if (f.extended || f.id != 0x7E5) return;
    stores += f.data[0] == 0x17 ? 1U : 0U;
    given += f.data[0] == 0x11 && f.data[1] != 0xFF ? 1U : 0U;
  }
  unsigned stores = 0;
  unsigned given = 0;
};

struct WriteEar final : can::Tap {
  void frame(const can::Frame& f, rt::Time, int) noexcept override {
    const bool write = !f.extended && f.id == 0x605 && (f.data[0] & 0xE0U) == 0x20;
    if (!write) return;
    ++writes;
    if (at_write) at_write();
  }
  unsigned writes = 0;
  std::function<void()> at_write;
};

}  // namespace

// As they leave the factory: both with node-ID 32, which no slot has, no heartbeat, no answer to identify or Fastscan.
TEST(Duplicates, TwoWithTheFactorysNodeIdAreToldApartAndSeated) {
  design::Machine m = one_bus(125'000);
  add_slot(m, 3, type_a);
  add_slot(m, 7, type_b);
  auto p = one_bus_plant(1);
  stored(p, "a", type_a, 0xA1, 32);
  stored(p, "b", type_b, 0xB2, 32);
  Rig rig(m, p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{3, 0xA1}, {7, 0xB2}}));
}

// Three of one type differ in their serial numbers alone.
TEST(Duplicates, ThreeWithOneNodeId) {
  design::Machine m = one_bus(125'000);
  auto p = one_bus_plant(1);
  for (unsigned i = 1; i <= 3; ++i) {
    add_slot(m, i + 2, type_a);
    stored(p, "d" + std::to_string(i), type_a, i * 0x1111, 1);
  }
  Rig rig(m, p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(120s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{3, 0x1111}, {4, 0x2222}, {5, 0x3333}}));
}

// A stranger with the node-ID of a slot comes while the slot's device runs: it is taken off, and the device runs on.
TEST(Duplicates, AStrangerUnderARunningDevicesNodeIdIsTakenOff) {
  auto p = its_own_device();
  stored(p, "stranger", type_c, 9, 5).plugged = false;
  Rig rig(slot_five(), p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.device("stranger").plug();
  ASSERT_TRUE(rig.run_until([&] { return !rig.device("stranger").truth().persistent.configured(); }, 60s)) << rig.log();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_FALSE(rig.device("stranger").truth().active.configured()) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 1}}));
}

// A second device under its node-ID hears nothing, and its heartbeats report another state: neither answers twice, nor
// is one of them started by what the other is told.
TEST(Duplicates, OneThatLeavesOperationalAtEachHeartbeatOfAnotherIsDoubted) {
  auto p = its_own_device();
  auto& deaf = stored(p, "deaf", type_b, 9, 5);
  deaf.plugged = false;
  deaf.heartbeat = 1s;
  Rig rig(slot_five(), p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.device("deaf").plug();
  rig.device("deaf").deaf(0s);
  rig.run_for(60s);
  EXPECT_EQ(rig.state(5), SlotState::duplicate) << rig.log();
  unsigned left = 0;
  for (auto at = rig.log().find("left operational"); at != std::string::npos; ++left) {
    at = rig.log().find("left operational", at + 1);
  }
  EXPECT_LT(left, 8U) << rig.log();
  rig.device("deaf").unplug();
  EXPECT_TRUE(rig.until_operational(60s)) << rig.log();
}

// The slot's device answers at once. The stranger is still busy with that answer, or with a heartbeat under its own
// node-ID, when the next question comes, and its receive buffer holds one frame.
TEST(Duplicates, AStrangerThatLosesWhatComesBehindAnswersIsHeardWhenBerthBegins) {
  for (int phase = 0; phase < 120; ++phase) {
    auto p = its_own_device();
    p.devices.back().response = {50us, 100us, 0, 0ms};
    auto& stranger = stored(p, "stranger", type_c, 9, 5);
    stranger.plugged = false;
    stranger.speaks = {};
    stranger.controller.rx_depth = 1;
    stranger.response = {3ms, 3500us, 0, 0ms};
    Rig rig(slot_five(), p);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
    rig.kill();
    rig.device("stranger").plug();
    rig.run_for(2s + phase * 700us);
    rig.begin();
    rig.run_for(4s);
    EXPECT_EQ(rig.state(5), SlotState::duplicate) << phase << "\n" << rig.log();
  }
}

// It leaves between its last heartbeat and the first that the new run waits for.
TEST(Duplicates, ADeviceThatLeavesAsItIsIdentifiedIsMissed) {
  Rig rig(slot_five(), its_own_device());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.kill();
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::operational; }, 10s)) << rig.log();
  rig.device("own").unplug();
  EXPECT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::absent; }, 10s)) << rig.log();
}

// A stranger on the slot's node-ID has none in its memory any more, and uses it until its power cycle: a person is
// told, and it is not told again and again.
TEST(Duplicates, ADeviceThatFadesIsNotBlankedAtEveryLook) {
  auto p = one_bus_plant(1);
  stored(p, "stranger", type_c, 9, 5).storing.power_cycle_after = true;
  add_device(p, "own", type_b, 1);
  Rig rig(slot_five(), p);
  LssEar ear;
  rig.world().bus("backbone")->add_tap(ear);
  rig.begin();
  const auto told = [&] { return rig.log().find("until it is switched off and on") != std::string::npos; };
  ASSERT_TRUE(rig.run_until(told, 120s)) << rig.log();
  EXPECT_FALSE(rig.device("stranger").truth().persistent.configured());
  const unsigned before = ear.stores;
  rig.run_for(20s);
  EXPECT_EQ(ear.stores, before) << rig.log();
  rig.device("stranger").power(false);
  rig.run_for(100ms);
  rig.device("stranger").power(true);
  ASSERT_TRUE(rig.until_operational(120s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 1}}));
  rig.world().bus("backbone")->remove_tap(ear);
}

// Its answers to what is written to the slot's own device would be taken for that one's.
TEST(Duplicates, ASlotWaitsWhileADeviceThatFadesUsesItsNodeIdToo) {
  auto p = one_bus_plant(1);
  stored(p, "own", type_b, 1, 5);
  stored(p, "stranger", type_c, 9, 5).storing.power_cycle_after = true;
  Rig rig(slot_five(), p);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::power_cycle; }, 120s)) << rig.log();
  WriteEar ear;
  rig.world().bus("backbone")->add_tap(ear);
  rig.run_for(20s);
  EXPECT_EQ(rig.state(5), SlotState::power_cycle) << rig.log();
  EXPECT_EQ(ear.writes, 0U);
  EXPECT_EQ(rig.device("stranger").truth().active, NodeId(5));
  rig.device("stranger").power(false);
  rig.run_for(100ms);
  rig.device("stranger").power(true);
  EXPECT_TRUE(rig.until_operational(120s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 1}}));
  EXPECT_GT(ear.writes, 0U);
  rig.world().bus("backbone")->remove_tap(ear);
}

// One of two with a slot's node-ID gives it up at its power cycle; that slot is left for it, and the search that finds
// it afterwards lends it the same node-ID. It does not use it still (seed 360612).
TEST(Duplicates, ADeviceThatFadedAndIsLentItsOldNodeIdIsSeated) {
  design::Machine m = one_bus(125'000);
  for (const unsigned id : {3U, 4U, 5U}) {
    add_slot(m, id, type_b);
    m.slots.back().spec.when_ambiguous = places::WhenAmbiguous::ascending;
  }
  auto p = one_bus_plant(1);
  stored(p, "first", type_b, 1, 5);
  auto& fades = stored(p, "fades", type_b, 2, 5);
  fades.lss.habit = Habit::lely;
  fades.storing.power_cycle_after = true;
  add_device(p, "third", type_b, 3);
  Rig rig(m, p);
  rig.begin();
  const auto waits = [&] {
    return rig.log().find("until it is switched off and on") != std::string::npos && rig.idle() &&
           rig.state(4) == SlotState::operational;
  };
  ASSERT_TRUE(rig.run_until(waits, 120s)) << rig.log();
  ASSERT_EQ(rig.device("fades").truth().active, NodeId(5));
  ASSERT_EQ(rig.state(5), SlotState::power_cycle) << "it is of its type, and named\n" << rig.log();
  rig.device("fades").power(false);
  rig.run_for(100ms);
  rig.device("fades").power(true);
  const auto stored_it = [&] { return rig.log().find("s5: power cycle needed: node-ID stored") != std::string::npos; };
  ASSERT_TRUE(rig.run_until(stored_it, 30s)) << rig.log();
  rig.device("fades").power(false);
  rig.run_for(100ms);
  rig.device("fades").power(true);
  EXPECT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{3, 1}, {4, 3}, {5, 2}}));
}

// What is written and saved while two listen is saved by both, the node-ID with it (seed 151046). The slow one's
// answers come behind those of the other, whose questions have ended.
TEST(Duplicates, NothingIsSavedUnderANodeIdThatAnsweredTwice) {
  auto p = one_bus_plant(1);
  stored(p, "own", type_b, 1, 5);
  stored(p, "stranger", type_c, 9, 5).response = {70ms, 70ms, 0, 0ms};
  Rig rig(slot_five(), p);
  WriteEar ear;
  rig.world().bus("backbone")->add_tap(ear);
  unsigned together = 0;
  ear.at_write = [&] {
    const bool both = rig.device("own").truth().active == rig.device("stranger").truth().active;
    together += both ? 1U : 0U;
  };
  rig.begin();
  ASSERT_TRUE(rig.until_operational(120s)) << rig.log();
  EXPECT_GT(ear.writes, 0U);
  EXPECT_EQ(together, 0U) << rig.log();
  rig.world().bus("backbone")->remove_tap(ear);
}

// It sits there already, and boots while the other, which was plugged in, fades.
TEST(Duplicates, ABoundSlotWaitsWhileADeviceThatFadesUsesItsNodeIdToo) {
  auto p = one_bus_plant(1);
  stored(p, "own", type_b, 1, 5);
  stored(p, "stranger", type_c, 9, 5).storing.power_cycle_after = true;
  Rig rig(slot_five(), p);
  rig.device("stranger").power(false);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  rig.device("stranger").power(true);
  const auto fades = [&] { return rig.log().find("until it is switched off and on") != std::string::npos; };
  ASSERT_TRUE(rig.run_until(fades, 120s)) << rig.log();
  rig.device("own").power(false);
  rig.run_for(100ms);
  rig.device("own").power(true);
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::power_cycle; }, 60s)) << rig.log();
  WriteEar ear;
  rig.world().bus("backbone")->add_tap(ear);
  const bool changes = rig.run_until([&] { return rig.state(5) != SlotState::power_cycle; }, 10s);
  EXPECT_FALSE(changes) << "nobody is asked what two answer\n" << rig.log();
  EXPECT_EQ(ear.writes, 0U) << rig.log();
  rig.world().bus("backbone")->remove_tap(ear);
  rig.device("stranger").power(false);  // for good
  EXPECT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 1}}));
}

// Device "a" waits for its power cycle and is told to store nothing meanwhile; after it, it comes to work.
void is_not_told_again(const plant::PlantFile& p, rt::Duration time) {
  Rig rig(slot_five(), p);
  LssEar ear;
  rig.world().bus("backbone")->add_tap(ear);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::power_cycle; }, 60s)) << rig.log();
  const unsigned before = ear.stores;
  rig.run_for(time);
  EXPECT_EQ(ear.stores, before);
  EXPECT_EQ(rig.state(5), SlotState::power_cycle);
  rig.device("a").power(false);
  rig.run_for(100ms);
  rig.device("a").power(true);
  EXPECT_TRUE(rig.until_operational(60s)) << rig.log();
  rig.world().bus("backbone")->remove_tap(ear);
}

// A person is asked whether it may be used again. Each search lends it a slot's node-ID meanwhile and takes that back;
// its memory has none, and is not written again (seed 142477).
TEST(Duplicates, ADeviceThatWaitsForAPersonIsNotToldToStoreAtEverySearch) {
  design::Machine m = one_bus(125'000);
  add_slot(m, 4, type_b);
  add_slot(m, 5, type_b);
  add_slot(m, 9, type_c);
  auto p = one_bus_plant(1);
  add_device(p, "a", type_b, 1).speaks = {Speaks::lss};
  add_device(p, "other", type_c, 2);
  Rig rig(m, p);
  rig.begin();
  rig.run_for(5s);
  ASSERT_TRUE(rig.network().replace("s4", LssAddress{type_b.vendor, type_b.product, 0, 1})) << rig.log();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(4) == SlotState::operational; }, 60s)) << rig.log();
  rig.device("a").power(false);
  ASSERT_TRUE(rig.run_until([&] { return rig.state(4) == SlotState::absent; }, 60s)) << rig.log();
  ASSERT_TRUE(rig.network().replace("s4", std::nullopt));
  rig.device("a").power(true);
  ASSERT_TRUE(rig.run_until([&] { return rig.state(4) == SlotState::question; }, 60s)) << rig.log();
  LssEar ear;
  rig.world().bus("backbone")->add_tap(ear);
  rig.run_for(120s);
  EXPECT_EQ(ear.stores, 0U) << rig.log();
  EXPECT_GT(ear.given, 0U) << "it was lent none: this shows nothing";
  rig.world().bus("backbone")->remove_tap(ear);
}

// What was stored once is not stored again at every look: memory wears out.
TEST(Duplicates, ADeviceThatWaitsForItsPowerCycleIsNotToldAgainAndAgain) {
  auto p = one_bus_plant(1);
  stored(p, "a", type_b, 7, 9).storing.power_cycle_after = true;
  is_not_told_again(p, 20s);
}

// It was lent the slot's own node-ID for the search: taking that back would have it stored once more at every look.
TEST(Duplicates, ABorrowerThatWaitsForItsPowerCycleIsNotToldAgain) {
  auto p = one_bus_plant(1);
  auto& a = add_device(p, "a", type_b, 7);
  a.speaks = {Speaks::lss, Speaks::fastscan};
  a.storing.power_cycle_after = true;
  is_not_told_again(p, 30s);
}

// Two devices and one slot: the question ends when both have left.
TEST(Duplicates, AQuestionEndsWithItsDevices) {
  design::Machine m = one_bus(125'000);
  add_slot(m, 5, type_b);
  auto p = one_bus_plant(1);
  add_device(p, "a", type_b, 1);
  add_device(p, "b", type_b, 2);
  Rig rig(m, p);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::question; }, 30s)) << rig.log();
  rig.device("a").unplug();
  rig.device("b").unplug();
  EXPECT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::empty; }, 60s)) << rig.log();
}

// Two devices of one address are told, and a device that fits the same slot is found and seated all the same.
TEST(Duplicates, TwoOfOneAddressHideNobodyElse) {
  design::Machine m = one_bus(125'000);
  add_slot(m, 5, type_b);
  auto p = one_bus_plant(1);
  for (const char* name : {"a", "clone"}) add_device(p, name, type_b, 7).speaks = {Speaks::lss, Speaks::fastscan};
  auto& late = add_device(p, "late", type_b, 9);
  late.speaks = {Speaks::lss, Speaks::fastscan};
  late.plugged = false;
  Rig rig(m, p);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::duplicate; }, 30s)) << rig.log();
  rig.device("late").plug();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 9}}));
}

// Two rules see the two, one by their SDO answers and one by LSS. The slot shows one reason, and not each in turn.
TEST(Duplicates, OfTwoOfOneAddressUnderOneNodeIdOneReasonIsShown) {
  auto p = one_bus_plant(1);
  for (const char* name : {"own", "clone"}) {
    auto& d = stored(p, name, type_b, 7, 5);
    d.lss.habit.reset();
    d.speaks = {Speaks::lss, Speaks::rand};
  }
  p.devices.back().plugged = false;
  Rig rig(slot_five(), p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.device("clone").plug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::duplicate; }, 30s)) << rig.log();
  rig.run_for(120s);
  EXPECT_EQ(rig.state(5), SlotState::duplicate);
  const std::string log = rig.log();
  std::size_t reasons = 0;
  for (auto at = log.find(": duplicate: "); at != std::string::npos; at = log.find(": duplicate: ", at + 1)) ++reasons;
  EXPECT_LE(reasons, 2U) << log;
}

// Three came with the node-ID of a slot, two of them with one address. The third is not bound there again and again:
// the other slot is free.
TEST(Duplicates, TheThirdUnderANodeIdThatTwoOfOneAddressKeepIsAskedAbout) {
  design::Machine m = slot_five();
  add_slot(m, 6, type_b);
  // Of 24 seeds 11 end otherwise: the third is bound to slot 5 before the two are known (docs/faults.md, Open).
  auto p = one_bus_plant(4);
  for (const char* name : {"a", "clone"}) {
    auto& d = stored(p, name, type_b, 7, 5);
    d.lss.habit.reset();
    d.speaks = {Speaks::lss, Speaks::rand};
    d.response = {0ms, 4ms, 0, 0ms};
  }
  auto& third = stored(p, "third", type_b, 9, 5);
  third.lss.habit.reset();
  third.speaks = {Speaks::lss, Speaks::rand};
  third.response = {0ms, 4ms, 0, 0ms};
  Rig rig(m, p);
  rig.begin();
  EXPECT_TRUE(rig.run_until([&] { return rig.state(6) == SlotState::question; }, 60s)) << rig.log();
  rig.run_for(20s);
  EXPECT_EQ(rig.state(6), SlotState::question) << rig.log();
  EXPECT_FALSE(rig.device("third").truth().active.configured());
}

// It holds the node-ID of a slot whose own device answers there, and is deaf each time that it is to lose it: what
// answers under the node-ID is not that device, which LSS reaches as soon as it hears again.
TEST(Duplicates, ADeafDeviceIsNotOutOfLssBecauseAnotherAnswersUnderItsNodeId) {
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U}) {
    auto p = one_bus_plant(seed);
    for (const auto& [name, type] : {std::pair("own", type_b), {"other", type_c}}) {
      auto& d = stored(p, name, type, 7, 5);
      d.lss.habit.reset();
      d.speaks = {Speaks::lss, Speaks::rand};
    }
    Rig rig(slot_five(), p);
    unsigned vain = 0;
    rt::Time deaf_until{};
    const auto hear = [&] { rig.device("other").controller().deaf(rig.world().sim().now() < deaf_until); };
    rig.on_step([&](const std::string&, const places::Binding& binding) {
      const bool begins = binding.kind() == places::Binding::Kind::blank && binding.step() == places::Step::select;
      if (!begins || vain == 6) return;
      ++vain;
      deaf_until = rig.world().sim().now() + 4s;
      hear();
      rig.world().sim().after(4s, hear);
    });
    rig.begin();
    ASSERT_TRUE(rig.until_operational(120s)) << seed << ": " << vain << "\n" << rig.log();
    EXPECT_GE(vain, 2U) << seed << ": this case is not the one that is meant";
    const auto alone = [&] { return !rig.device("other").truth().active.configured(); };
    EXPECT_TRUE(rig.run_until(alone, 120s)) << seed << "\n" << rig.log();
    EXPECT_EQ(rig.seats(), (Seats{{5, 7}})) << seed;
  }
}

// One of the two speaks RAND, and is found alone by it at each look; the third does not.
TEST(Duplicates, TwoOfOneAddressOfWhichOneSpeaksRandHideNobodyElse) {
  auto p = one_bus_plant(1);
  for (const char* name : {"a", "clone"}) add_device(p, name, type_b, 7);
  p.devices.back().speaks = {Speaks::lss};
  auto& late = add_device(p, "late", type_b, 9);
  late.speaks = {Speaks::lss};
  late.plugged = false;
  Rig rig(slot_five(), p);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::duplicate; }, 30s)) << rig.log();
  rig.device("late").plug();
  ASSERT_TRUE(rig.until_operational(120s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 9}}));
}

// One of two with one address is deaf at the second look: the other one is found alone, and is not lent the slot's
// node-ID. Which of the two has it pending later could not be asked.
TEST(Duplicates, OneOfTwoWithOneAddressIsLentNoSlotsNodeId) {
  design::Machine m = slot_five();
  m.buses.front().discovery = "fastscan";
  auto p = one_bus_plant(1);
  for (const char* name : {"own", "clone"}) add_device(p, name, type_b, 1).speaks = {Speaks::lss, Speaks::fastscan};
  Rig rig(m, p);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::duplicate; }, 30s)) << rig.log();
  rig.device("clone").controller().deaf(true);
  bool slots = false;
  bool others = false;
  for (int i = 0; i < 6000; ++i) {
    rig.run_for(5ms);
    for (const places::LentId& lent : rig.store().lent().value()) (lent.id == NodeId(5) ? slots : others) = true;
  }
  EXPECT_FALSE(slots) << rig.log();
  EXPECT_TRUE(others) << "this case is not the one that is meant\n" << rig.log();
}

// ---- the list of loans ----

TEST(LoanList, IsInTheStoreBeforeAnythingElse) {
  places::MemoryStore store;
  Loans loans(store, {"m", "b"});
  ASSERT_TRUE(loans.lend(one, NodeId(126)));
  EXPECT_EQ(store.lent().value(), (std::vector<places::LentId>{{one, "m", "b", NodeId(126)}}));
  Loans next(store, {"m", "b"});
  ASSERT_TRUE(next.load());
  ASSERT_EQ(next.all().size(), 1U);
  EXPECT_TRUE(next.borrowed(one)) << "what it uses may be what an earlier run lent it";
  Loans elsewhere(store, {"m", "another bus"});
  ASSERT_TRUE(elsewhere.load());
  EXPECT_TRUE(elsewhere.empty());
}

TEST(LoanList, ANodeIdIsLentToNobodyElseUntilItIsBack) {
  places::MemoryStore store;
  Loans loans(store, {"m", "b"});
  ASSERT_TRUE(loans.lend(one, NodeId(126)));
  EXPECT_TRUE(loans.lent(NodeId(126)));
  EXPECT_EQ(loans.to_another(NodeId(126), one), nullptr);
  ASSERT_NE(loans.to_another(NodeId(126), other), nullptr);
  for (int i = 0; i < 10; ++i) loans.kept(one);
  EXPECT_TRUE(Loans::given_up(loans.all().front()));
  EXPECT_TRUE(loans.lent(NodeId(126))) << "it was not seen to give it back";
  loans.seen(one);
  EXPECT_FALSE(Loans::given_up(loans.all().front()));
  ASSERT_TRUE(loans.end(one));
  EXPECT_FALSE(loans.lent(NodeId(126)));
  EXPECT_TRUE(store.lent().value().empty());
  EXPECT_TRUE(loans.borrowed(one)) << "the reset behind it may have been lost";
  loans.bound(one);
  EXPECT_FALSE(loans.borrowed(one));
}

TEST(LoanList, ADevicesNewLoanEndsItsOldOne) {
  places::MemoryStore store;
  Loans loans(store, {"m", "b"});
  ASSERT_TRUE(loans.lend(one, NodeId(126)));
  ASSERT_TRUE(loans.lend(one, NodeId(125)));
  EXPECT_FALSE(loans.lent(NodeId(126)));
  EXPECT_EQ(loans.of(one)->id, NodeId(125));
}

// Who sits where when it is not one device for one slot: the five words of `when_ambiguous` (S4.19).
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using places::WhenAmbiguous;
using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

namespace {

// The sensor of examples/: 6000h is what a harness codes.
constexpr TypeCode sensor{0x00000001, 0x00000001};

design::Machine two_slots(WhenAmbiguous how) {
  design::Machine m = one_bus(125'000);
  for (const unsigned id : {5U, 6U}) {
    add_slot(m, id, sensor);
    m.slots.back().spec.when_ambiguous = how;
    if (how == WhenAmbiguous::probe) m.slots.back().spec.probe = places::Probe{0x6000, 0, id, 0xFF};
  }
  return m;
}

plant::PlantFile two_sensors() {
  auto plant = one_bus_plant(7);
  for (const std::uint32_t serial : {0x20U, 0x10U}) {
    auto& d = add_device(plant, serial == 0x10 ? "low" : "high", sensor, serial);
    d.eds = d.eds_path = example_eds("sensor.eds");
    d.heartbeat = 0ms;
  }
  return plant;
}

// A coding in the harness: what a device reads in 6000h where it is plugged in, whatever was reset in it.
class Harness final : public od::Hook {
 public:
  Harness(Rig& rig, const std::string& name, std::uint8_t place) {
    rig.device(name).device().values().attach(*this, 0x6000, 0x6000);
    move_to(place);
  }
  void move_to(std::uint8_t place) { place_ = {place, 0xAB}; }

 private:
  od::AbortCode reading(const od::Values&, ObjectRef, std::span<const std::uint8_t>& value) noexcept override {
    value = place_;
    return od::AbortCode::none;
  }
  std::array<std::uint8_t, 2> place_{};
};

const operate::Event* event(const Rig& rig, operate::EventKind kind) {
  const auto it = std::ranges::find(rig.events(), kind, &operate::Event::kind);
  return it == rig.events().end() ? nullptr : &*it;
}

}  // namespace

// S4.19: a question, with slots and devices for a program, and its answer.
TEST(Places, S4_19_AskIsAQuestionEvenWhenNumbersAgree) {
  Rig rig(two_slots(WhenAmbiguous::ask), two_sensors());
  rig.begin();
  rig.run_for(5s);
  EXPECT_EQ(rig.state(5), SlotState::question) << rig.log();
  const auto* const question = event(rig, operate::EventKind::question);
  ASSERT_NE(question, nullptr);
  EXPECT_EQ(question->slots, (std::vector<std::string>{"s5", "s6"}));
  EXPECT_EQ(question->devices,
            (std::vector<std::string>{"00000001-00000001-00000000-00000010", "00000001-00000001-00000000-00000020"}));
  EXPECT_EQ(rig.network().planning().question_events().size(), 1U);
  // One answer is enough: what is left is one device for one slot.
  ASSERT_TRUE(rig.network().replace("s5", LssAddress{1, 1, 0, 0x20}));
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 0x20}, {6, 0x10}}));
  EXPECT_TRUE(rig.network().planning().question_events().empty());
}

TEST(Places, S4_19_AscendingIsPaperOnesRuleTwo) {
  Rig rig(two_slots(WhenAmbiguous::ascending), two_sensors());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 0x10}, {6, 0x20}}));
}

// S4.19: "new device: manufacturer, product, serial", and the slot that it took; and it is remembered.
TEST(Places, S4_19_OneAtATimeTakesWhoeverComes) {
  auto plant = two_sensors();
  plant.devices[1].plugged = false;
  Rig rig(two_slots(WhenAmbiguous::one_at_a_time), plant);
  rig.begin();
  rig.run_for(5s);
  EXPECT_EQ(rig.state(5), SlotState::operational) << rig.log();
  const auto* const first = event(rig, operate::EventKind::new_device);
  ASSERT_NE(first, nullptr);
  EXPECT_EQ(first->slot, "s5");
  EXPECT_NE(first->text.find("manufacturer 00000001h, product 00000001h, serial 00000020h"), std::string::npos)
      << first->text;
  rig.device("low").plug();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 0x20}, {6, 0x10}}));
  rig.kill();
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 0x20}, {6, 0x10}}));
}

// Two at once cannot be told apart by their time.
TEST(Places, S4_19_TwoAtATimeIsAQuestion) {
  Rig rig(two_slots(WhenAmbiguous::one_at_a_time), two_sensors());
  rig.begin();
  rig.run_for(5s);
  EXPECT_EQ(rig.state(5), SlotState::question) << rig.log();
  EXPECT_TRUE(rig.seats().empty());
  rig.device("low").unplug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::operational; }, 30s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 0x20}}));
}

// The larger serial number comes first and gets the lower slot; a third finds no place.
TEST(Places, S4_19_FirstSeenGoesByTime) {
  auto plant = two_sensors();
  plant.devices[1].plugged = false;
  add_device(plant, "late", sensor, 1).plugged = false;
  Rig rig(two_slots(WhenAmbiguous::first_seen), plant);
  rig.begin();
  rig.run_for(5s);
  rig.device("low").plug();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.device("late").plug();
  rig.run_for(10s);
  EXPECT_EQ(rig.seats(), (Seats{{5, 0x20}, {6, 0x10}})) << rig.log();
  EXPECT_NE(event(rig, operate::EventKind::surplus), nullptr);
}

// The object of the harness tells left from right, against the order of the serial numbers; nobody keeps what was lent.
TEST(Places, S4_19_ProbeTellsLeftFromRight) {
  Rig rig(two_slots(WhenAmbiguous::probe), two_sensors());
  Harness high(rig, "high", 5);
  Harness low(rig, "low", 6);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 0x20}, {6, 0x10}})) << rig.log();
  for (const auto& t : rig.world().truth()) EXPECT_EQ(t.persistent, t.active) << t.name;
}

// What such a device is lent to be read comes into use at NMT reset communication of node-ID 255 (Lely core).
TEST(Places, S4_19_ADeviceThatWaitsForAResetIsReadUnderItsLoan) {
  auto plant = two_sensors();
  for (auto& d : plant.devices) {
    d.lss.habit = plant::Habit::lely;
    d.speaks = {plant::Speaks::lss, plant::Speaks::fastscan};
  }
  Rig rig(two_slots(WhenAmbiguous::probe), plant);
  Harness left(rig, "high", 5);
  Harness right(rig, "low", 6);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 0x20}, {6, 0x10}}));
}

// Both show the same place: a question, and both are blank again.
TEST(Places, S4_19_ProbesThatDoNotTellAreAQuestion) {
  Rig rig(two_slots(WhenAmbiguous::probe), two_sensors());
  const Harness high(rig, "high", 5);
  const Harness low(rig, "low", 5);
  rig.begin();
  rig.run_for(6s);
  EXPECT_EQ(rig.state(5), SlotState::question) << rig.log();
  EXPECT_TRUE(rig.seats().empty());
  const std::string log = rig.log();
  rig.kill();
  for (const auto& t : rig.world().truth()) {
    EXPECT_FALSE(t.active.configured()) << t.name << "\n" << log;
    EXPECT_FALSE(t.persistent.configured()) << t.name;
  }
}

// S4.19: a mechanic swaps the two. The probe wins over the serial numbers that the slots remember.
TEST(Places, S4_19_SwappedDevicesAreBoundToTheirPlacesAgain) {
  Rig rig(two_slots(WhenAmbiguous::probe), two_sensors());
  Harness high(rig, "high", 5);
  Harness low(rig, "low", 6);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  for (const char* name : {"high", "low"}) rig.device(name).unplug();
  rig.run_for(3s);
  high.move_to(6);
  low.move_to(5);
  for (const char* name : {"high", "low"}) rig.device(name).plug();
  ASSERT_TRUE(rig.run_until(
      [&] {
        return rig.seats() == Seats{{5, 0x10}, {6, 0x20}} && rig.network().operational();
      },
      60s))
      << rig.log();
  EXPECT_NE(event(rig, operate::EventKind::moved), nullptr);
  EXPECT_TRUE(rig.world().duplicates().empty());
}

// The same while Berth was away.
TEST(Places, S4_19_SwappedWhileBerthWasAway) {
  Rig rig(two_slots(WhenAmbiguous::probe), two_sensors());
  Harness high(rig, "high", 5);
  Harness low(rig, "low", 6);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.kill();
  for (const char* name : {"high", "low"}) rig.device(name).unplug();
  rig.run_for(1s);
  high.move_to(6);
  low.move_to(5);
  for (const char* name : {"high", "low"}) rig.device(name).plug();
  rig.run_for(1s);
  rig.begin();
  ASSERT_TRUE(rig.run_until(
      [&] {
        return rig.seats() == Seats{{5, 0x10}, {6, 0x20}} && rig.network().operational();
      },
      60s))
      << rig.log();
}

// A device whose probe tells no place of the machine is not started, and says why.
TEST(Places, S4_19_AProbeOfNoPlaceIsNamed) {
  Rig rig(two_slots(WhenAmbiguous::probe), two_sensors());
  Harness high(rig, "high", 5);
  Harness low(rig, "low", 6);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.device("high").unplug();
  rig.run_for(3s);
  high.move_to(9);
  rig.device("high").plug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::failed; }, 30s)) << rig.log();
  EXPECT_EQ(rig.state(6), SlotState::operational);
  EXPECT_EQ(rig.seats(), (Seats{{5, 0x20}, {6, 0x10}})) << "it stays its slot's";
}

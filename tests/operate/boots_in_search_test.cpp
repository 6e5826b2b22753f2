// A device that boots while a long search has the turn is asked who it is at once, and works before the search ends.
#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using plant::Speaks;

namespace boots_in_search_tests {
namespace {

enum class Comes : std::uint8_t {
  at_its_slots_id,  // LSS, its node-ID stored: an earlier master's, the slot table is new
  at_another_id,    // LSS, to be moved
  with_switches,    // `assign = "fixed"`
};

struct Setting {
  std::uint32_t bit_rate = 20'000;
  Comes comes = Comes::at_its_slots_id;
  std::string method = "auto";
  plant::SpeaksSet others{Speaks::lss};
  rt::Duration runs_within = 15s;  // of its boot-up; what was found is bound with it
  bool has_found = true;           // it boots when the search has found one, else when it is a while under way
  unsigned searched_for = 0;       // 0: so many that the search takes long at this bit rate
};

unsigned others_of(const Setting& setting) {
  if (setting.searched_for > 0) return setting.searched_for;
  return setting.bit_rate <= 20'000 ? 24 : setting.bit_rate <= 50'000 ? 60 : 100;
}

constexpr NodeId slots_id(1);

NodeId id_of(const Setting& setting) { return setting.comes == Comes::at_another_id ? NodeId(99) : slots_id; }

design::Machine machine_of(const Setting& setting) {
  design::Machine m = one_bus(setting.bit_rate);
  m.buses[0].discovery = setting.method;
  add_slot(m, slots_id.value(), type_a);
  if (setting.comes == Comes::with_switches) m.slots.back().spec.assign = places::Assign::fixed;
  for (unsigned i = 0; i < others_of(setting); ++i) add_slot(m, 10 + i, type_b);
  return m;
}

plant::PlantFile plant_of(const Setting& setting) {
  auto p = one_bus_plant(7);
  for (unsigned i = 0; i < others_of(setting); ++i) {
    add_device(p, "p" + std::to_string(i), type_b, 0x9E37'79B9U * (i + 1)).speaks = setting.others;
  }
  auto& late = add_device(p, "late", type_a, 0x0A);
  late.plugged = false;
  late.node_id = id_of(setting);
  late.speaks = setting.others;
  late.source = plant::NodeIdSource::nonvolatile;
  if (setting.comes == Comes::with_switches) {
    late.speaks = {};
    late.source = plant::NodeIdSource::hard_coded;
  }
  return p;
}

// When the device told its boot-up, and when it was asked for its identity (1018h) for the first time after that.
class Ear final : private can::Tap {
 public:
  Ear(Rig& rig, NodeId id) : rig_(rig), id_(id) { rig_.world().bus("backbone")->add_tap(*this); }
  ~Ear() { rig_.world().bus("backbone")->remove_tap(*this); }
  std::optional<rt::Time> booted;
  std::optional<rt::Time> asked;

 private:
  void frame(const can::Frame& f, rt::Time at, int) noexcept override {
    const bool boots = f.key() == 0x700U + id_.value() && f.size == 1 && f.data[0] == 0;
    if (boots && !booted) booted = at;
    const bool identity = f.key() == 0x600U + id_.value() && f.size == 8 && f.data[1] == 0x18 && f.data[2] == 0x10;
    if (booted && !asked && identity) asked = at;
  }
  Rig& rig_;
  NodeId id_;
};

std::string words_of(const Setting& setting) {
  constexpr const char* comes[] = {"at its slot's node-ID", "at another node-ID", "with switches"};
  return setting.method + ", " + std::to_string(setting.bit_rate) + " bit/s, a device " +
         comes[static_cast<unsigned>(setting.comes)];
}

void boots_in_a_search(const Setting& setting) {
  SCOPED_TRACE(words_of(setting));
  Rig rig(machine_of(setting), plant_of(setting));
  Ear ear(rig, id_of(setting));
  bool unasked_called_empty = false;
  bool found_one = false;
  rig.on_event([&](const operate::Event& e) {
    found_one = found_one || e.kind == operate::EventKind::found;
    const bool empty = e.slot == "s1" && e.text.find("no device of its type") != std::string::npos;
    unasked_called_empty = unasked_called_empty || (empty && ear.booted && !ear.asked);
  });
  const auto searches = [&] {
    return (found_one || !setting.has_found) && rig.network().phase() == operate::Phase::discovery &&
           rig.network().services().turn.taken();
  };
  rig.begin();
  ASSERT_TRUE(rig.run_until(searches, 120s)) << rig.log();
  if (!setting.has_found) rig.run_for(4s);  // the slots' own node-IDs are asked before
  rig.device("late").plug();
  ASSERT_TRUE(rig.run_until([&] { return ear.booted.has_value(); }, 5s)) << rig.log();
  EXPECT_TRUE(rig.run_until([&] { return ear.asked.has_value(); }, 2s)) << "not asked when it booted\n" << rig.log();
  EXPECT_TRUE(rig.run_until([&] { return rig.state(1) == SlotState::operational; }, setting.runs_within)) << rig.log();
  EXPECT_FALSE(rig.operational()) << "the search was over before\n" << rig.log();
  ASSERT_TRUE(rig.until_operational(1200s)) << rig.log();
  EXPECT_FALSE(unasked_called_empty) << rig.log();
}

}  // namespace

TEST(BootsInSearch, ADeviceAtItsSlotsNodeIdIsAskedWhenItBoots) {
  for (const std::uint32_t rate : {10'000U, 20'000U, 50'000U, 125'000U}) boots_in_a_search({.bit_rate = rate});
}

TEST(BootsInSearch, ADeviceWithSwitchesIsAskedWhenItBoots) {
  for (const std::uint32_t rate : {10'000U, 50'000U, 125'000U}) {
    boots_in_a_search({.bit_rate = rate, .comes = Comes::with_switches});
  }
}

TEST(BootsInSearch, ADeviceAtAnotherNodeIdIsAskedWhenItBoots) {
  for (const std::uint32_t rate : {10'000U, 50'000U, 125'000U}) {
    boots_in_a_search({.bit_rate = rate, .comes = Comes::at_another_id});
  }
}

TEST(BootsInSearch, WhateverMethodSearches) {
  for (const auto& others : {plant::SpeaksSet{Speaks::lss, Speaks::rand}, plant::SpeaksSet{Speaks::fastscan}}) {
    boots_in_a_search({.others = others, .runs_within = 60s, .has_found = false, .searched_for = 80});
  }
}

}  // namespace boots_in_search_tests

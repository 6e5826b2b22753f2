// Devices that lack services of LSS: what one procedure of CiA 305 can seat, the default seats
// (docs/limits.md, "LSS as far as a device has it"). Sizes and mixtures: tests/matrix.
#include <gtest/gtest.h>
#include <algorithm>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using namespace std::chrono_literals;
using lss::Lackable;
using places::SlotState;
using plant::Speaks;

namespace {

const lss::LackSet inquiries{Lackable::inquire_identity, Lackable::inquire_node_id};

plant::PlantDevice& add_lacking(plant::PlantFile& p, const std::string& name, std::uint32_t serial, lss::LackSet lacks,
                                plant::SpeaksSet speaks = {Speaks::lss}) {
  auto& d = add_device(p, name, type_b, serial);
  d.speaks = speaks;
  d.lss.without = lacks;
  return d;
}

design::Machine slots(unsigned count) {
  design::Machine m = one_bus(125'000);
  for (unsigned id = 1; id <= count; ++id) add_slot(m, id, type_b);
  return m;
}

// Each device has a node-ID of its own, in use and in its memory.
void expect_each_seated(Rig& rig, std::size_t devices) {
  EXPECT_EQ(rig.seats().size(), devices) << rig.log();
  std::set<unsigned> ids;
  for (const auto& t : rig.world().truth()) {
    EXPECT_TRUE(t.active.configured()) << rig.log();
    EXPECT_EQ(t.active, t.persistent) << rig.log();
    EXPECT_TRUE(ids.insert(t.active.value()).second) << "a node-ID given twice\n" << rig.log();
  }
}

struct Requests final : can::Tap {
  std::array<unsigned, 256> of{};  // by command
  [[nodiscard]] unsigned inquiries() const { return of[0x5A] + of[0x5B] + of[0x5C] + of[0x5D] + of[0x5E]; }
  void frame(const can::Frame& f, rt::Time, int) noexcept override {
    if (f.key() == lss::master_cob_id) ++of.at(f.data[0]);
  }
};

}  // namespace

TEST(LackingLss, NoInquiriesAtAll) {
  auto p = one_bus_plant(1);
  for (unsigned i = 1; i <= 3; ++i) add_lacking(p, "d" + std::to_string(i), i * 1000, inquiries);
  add_device(p, "whole", type_b, 7);
  Rig rig(slots(4), p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  expect_each_seated(rig, 4);
}

// RAND finds it, and tells no node-ID.
TEST(LackingLss, FoundByRand) {
  auto p = one_bus_plant(2);
  add_lacking(p, "d1", 1, inquiries, {Speaks::lss, Speaks::rand});
  add_lacking(p, "d2", 2, inquiries, {Speaks::lss, Speaks::rand});
  Rig rig(slots(2), p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  expect_each_seated(rig, 2);
}

// LSS does not tell that it has a node-ID, nor which: SDO does.
TEST(LackingLss, ANodeIdOfNoSlotIsFoundBySdo) {
  for (const bool rand : {false, true}) {
    auto p = one_bus_plant(4);
    auto& d = add_lacking(p, "d1", 1, inquiries);
    if (rand) d.speaks.add(Speaks::rand);
    d.source = plant::NodeIdSource::nonvolatile;
    d.node_id = NodeId(99);
    Rig rig(slots(1), p);
    rig.world().sim().run_for(1s);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    expect_each_seated(rig, 1);
  }
}

// Told by 17h's error code 1: it gets its node-ID anew at each power-on. What it lacks was learnt at the first.
TEST(LackingLss, ADeviceThatCannotStoreIsSeatedAtEachPowerOn) {
  auto p = one_bus_plant(5);
  auto& d = add_lacking(p, "d1", 1, inquiries);
  d.lss.refuses_store = true;
  Rig rig(slots(1), p);
  Requests requests;
  rig.world().bus("backbone")->add_tap(requests);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_NE(rig.log().find("which it cannot store"), std::string::npos) << rig.log();
  const unsigned asked = requests.inquiries();
  EXPECT_LE(asked, 8U);
  rig.device("d1").power(false);
  rig.run_for(10s);
  EXPECT_FALSE(rig.operational());
  rig.device("d1").power(true);
  ASSERT_TRUE(rig.until_operational(90s)) << rig.log();
  EXPECT_EQ(requests.inquiries(), asked);
}

TEST(LackingLss, FastscanAndSelectionAlone) {
  auto p = one_bus_plant(6);
  const lss::LackSet all_but_selection{Lackable::inquire_identity, Lackable::inquire_node_id, Lackable::identify,
                                       Lackable::bit_timing, Lackable::activate};
  add_lacking(p, "d1", 1, all_but_selection, {Speaks::fastscan});
  add_lacking(p, "d2", 2, all_but_selection, {Speaks::fastscan});
  add_device(p, "whole", type_b, 7);
  Rig rig(slots(3), p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  expect_each_seated(rig, 3);
}

// Nothing but 40h to 43h, 11h and 17h: no search finds it, and its slot says what helps.
TEST(LackingLss, AnAddressThatNobodyCanFindIsAskedForByName) {
  const lss::LackSet all_but_selection{Lackable::inquire_identity, Lackable::inquire_node_id, Lackable::identify,
                                       Lackable::bit_timing, Lackable::activate};
  using Rule = places::RevisionRule;
  // Whatever the slot would take besides: the revision that it names is a part of the address.
  for (const std::optional<Rule> rule :
       {std::optional<Rule>(), std::optional(Rule::exact), std::optional(Rule::major), std::optional(Rule::any)}) {
    const bool named = rule.has_value();
    auto p = one_bus_plant(7);
    add_lacking(p, "d1", 1, all_but_selection);
    auto m = slots(1);
    if (named) {
      m.slots.back().spec.spares = {1};
      m.slots.back().spec.revision = 0;
      m.slots.back().spec.rule = *rule;
    }
    Rig rig(m, p);
    rig.begin();
    EXPECT_EQ(rig.until_operational(30s), named) << rig.log();
    const bool says = rig.log().find("needs its slot's `spares` and `revision`") != std::string::npos;
    EXPECT_TRUE(named || says) << rig.log();
    if (named) expect_each_seated(rig, 1);
  }
}

// Nothing but Fastscan selects it, and that not while it has what the search lent it, or boots under that.
TEST(LackingLss, OneThatBootsSlowlyUnderItsLoan) {
  const lss::LackSet all{Lackable::select,   Lackable::inquire_identity, Lackable::inquire_node_id,
                         Lackable::identify, Lackable::bit_timing,       Lackable::activate};
  for (const plant::SpeaksSet speaks : {plant::SpeaksSet{Speaks::fastscan}, {Speaks::fastscan, Speaks::rand}}) {
    auto p = one_bus_plant(11);
    auto& d = add_lacking(p, "d1", 1, all, speaks);
    d.reset = 3s;
    Rig rig(slots(1), p);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(2min)) << rig.log();
    expect_each_seated(rig, 1);
  }
}

// Its receive buffer holds fewer frames than a selection has, and its answers take longer than their pauses.
TEST(LackingLss, ASmallBufferIsAskedByNameWithPauses) {
  auto p = one_bus_plant(9);
  auto& d = add_lacking(p, "d1", 1, {Lackable::identify});
  d.controller.rx_depth = 2;
  d.response = {3ms, 3ms, 0, 0ms};
  auto m = slots(1);
  m.slots.back().spec.spares = {1};
  m.slots.back().spec.revision = 0;
  Rig rig(m, p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(90s)) << rig.log();
  expect_each_seated(rig, 1);
}

// A device of Lely core answers each Fastscan, so that a search on a slow bus takes longer than the patience for one:
// the names, which are asked after it, have their turn in the next.
TEST(LackingLss, NamesHaveTheirTurnBesideALongSearch) {
  auto p = one_bus_plant(10);
  add_lacking(p, "named", 1, {Lackable::identify});
  for (unsigned i = 0; i < 6; ++i) {
    auto& d = add_device(p, "lely" + std::to_string(i), type_c, 100 + 7919 * i);
    d.lss.habit = plant::Habit::lely;
    d.speaks = {Speaks::fastscan};
  }
  design::Machine m = one_bus(20'000);
  add_slot(m, 1, type_b);
  m.slots.back().spec.spares = {1};
  m.slots.back().spec.revision = 0;
  for (unsigned id = 2; id <= 7; ++id) add_slot(m, id, type_c);
  Rig rig(m, p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(10min)) << rig.log();
}

// Nothing but Fastscan, 11h and 17h: what a search lends it is ended by NMT reset node.
TEST(LackingLss, FastscanAlone) {
  const lss::LackSet all{Lackable::select,   Lackable::inquire_identity, Lackable::inquire_node_id,
                         Lackable::identify, Lackable::bit_timing,       Lackable::activate};
  auto p = one_bus_plant(8);
  add_lacking(p, "d1", 1, all, {Speaks::fastscan});
  add_lacking(p, "d2", 0xF0000000, all, {Speaks::fastscan});
  add_lacking(p, "d3", 77, {Lackable::select}, {Speaks::fastscan});
  add_device(p, "whole", type_b, 7);
  Rig rig(slots(4), p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(90s)) << rig.log();
  expect_each_seated(rig, 4);
}

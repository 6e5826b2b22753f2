// Paper 1's rules and what they leave open (checklist S1.27 to S1.38).
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "berth/places/plan.hpp"

using namespace berth;
using namespace berth::places;

namespace planner_tests {
namespace {

constexpr TypeCode A{0x01000001, 1};
constexpr TypeCode B{0x00000001, 1};
constexpr TypeCode C{0x00000001, 5};
constexpr NodeId master(127);

LssAddress address_of(TypeCode type, std::uint32_t serial, std::uint32_t revision = 0) {
  return {type.vendor, type.product, revision, serial};
}

Slot slot(unsigned id, TypeCode type, std::optional<LssAddress> bound = std::nullopt) {
  Slot s;
  s.spec.id = NodeId(static_cast<std::uint8_t>(id));
  s.spec.type = type;
  s.record.slot = SlotId{static_cast<std::int64_t>(id) + 100};
  if (bound) s.record.confirmed = Assignment{*bound, s.spec.id};
  return s;
}

// Table I of the paper (S1.28).
std::vector<Slot> table_1() { return {slot(1, A), slot(2, B), slot(3, C), slot(4, B), slot(5, B)}; }

std::map<unsigned, std::uint32_t> seats(const std::vector<Slot>& slots, const Plan& p) {
  std::map<unsigned, std::uint32_t> result;
  for (const auto& a : p.actions) {
    if (a.kind == Action::Kind::bind) result[slots[a.slot].spec.id.value()] = a.device.address.serial;
  }
  return result;
}

std::vector<Found> blank(const std::vector<LssAddress>& devices) {
  std::vector<Found> found;
  for (const auto& d : devices) found.push_back({d, NodeId()});
  return found;
}

}  // namespace

// S1.32: sorted ascending, each goes to the first free row of its type, in whatever order they were found.
TEST(Planner, S1_27_S1_28_S1_38_TableOneBecomesTableTwo) {
  const auto slots = table_1();
  const auto p =
      plan(slots, blank({address_of(B, 7), address_of(A, 0x0A), address_of(B, 5), address_of(C, 8), address_of(B, 6)}),
           {}, master);
  EXPECT_EQ(seats(slots, p), (std::map<unsigned, std::uint32_t>{{1, 0x0A}, {2, 5}, {3, 8}, {4, 6}, {5, 7}}));
  EXPECT_TRUE(p.questions.empty());
  EXPECT_TRUE(p.oddities.empty());
}

TEST(Planner, S1_27_R_SN_OrdersByRevisionBeforeSerial) {
  const std::vector<Slot> slots{slot(2, B), slot(4, B)};
  const auto p = plan(slots, blank({address_of(B, 1, 2), address_of(B, 9, 1)}), {}, master);
  EXPECT_EQ(seats(slots, p), (std::map<unsigned, std::uint32_t>{{2, 9}, {4, 1}}));
}

// It fits both slots: its node-ID tells where it belongs, also if nothing can change that node-ID.
TEST(Planner, ADeviceThatSaysItsVendorAloneBelongsToTheSlotOfItsNodeId) {
  const std::vector<Slot> slots{slot(3, C), slot(5, B)};
  for (const bool keeps : {false, true}) {
    Identity little{B.vendor, 0, 0, 0};
    little.unknown = 0b1110;
    const auto p = plan(slots, {Found{.device = little, .active = NodeId(5), .keeps = keeps}}, {}, master);
    ASSERT_EQ(p.actions.size(), 1U) << keeps;
    EXPECT_EQ(slots[p.actions[0].slot].spec.id, NodeId(5)) << keeps;
    EXPECT_TRUE(p.oddities.empty());
  }
}

// S1.35, S1.51: after s2 and s4 were replaced rule 2 holds among the new ones only; s5 keeps its smaller number.
TEST(Planner, S1_35_OnlyTheDevicesOfThisRunAreSorted) {
  auto slots = table_1();
  slots[0].record.confirmed = Assignment{address_of(A, 0x0A), NodeId(1)};
  slots[2].record.confirmed = Assignment{address_of(C, 8), NodeId(3)};
  slots[4].record.confirmed = Assignment{address_of(B, 7), NodeId(5)};
  const auto p = plan(slots, blank({address_of(B, 0x18), address_of(B, 0x15)}), {}, master);
  EXPECT_EQ(seats(slots, p), (std::map<unsigned, std::uint32_t>{{2, 0x15}, {4, 0x18}}));
}

// S1.33 (a): one node takes one row, not all free rows of its type; (b): the row is the slot's, not the node's number.
TEST(Planner, S1_33_OneDeviceOneSlot) {
  auto slots = table_1();
  for (auto& s : slots) s.spec.when_ambiguous = WhenAmbiguous::one_at_a_time;
  const auto one = plan(slots, blank({address_of(B, 5)}), {}, master);
  EXPECT_EQ(one.actions.size(), 1U);
  EXPECT_EQ(seats(slots, one), (std::map<unsigned, std::uint32_t>{{2, 5}}));
  // As many nodes as rows: each its own, none twice.
  const auto table = table_1();
  const auto all = plan(table, blank({address_of(B, 7), address_of(B, 5), address_of(B, 6)}), {}, master);
  EXPECT_EQ(seats(table, all), (std::map<unsigned, std::uint32_t>{{2, 5}, {4, 6}, {5, 7}}));
  // The only new node is number 0 of the discovered ones and belongs into row 3.
  const auto other = plan(slots, blank({address_of(C, 8)}), {}, master);
  EXPECT_EQ(seats(slots, other), (std::map<unsigned, std::uint32_t>{{3, 8}}));
}

// S1.34
TEST(Planner, S1_34_FewerDevicesThanSlotsIsAQuestion) {
  const std::vector<Slot> slots{slot(2, B), slot(4, B)};
  const auto p = plan(slots, blank({address_of(B, 5)}), {}, master);
  EXPECT_TRUE(p.actions.empty());
  ASSERT_EQ(p.questions.size(), 1U);
  EXPECT_EQ(p.questions[0].slots, (std::vector<std::size_t>{0, 1}));
  EXPECT_EQ(p.questions[0].devices, (std::vector<Identity>{address_of(B, 5)}));
}

// Rule 2 orders by serial numbers: without them it helps nobody to plug in more, with a node-ID or without.
TEST(Planner, WhoHasNoSerialNumberIsSwitchedOnAlone) {
  const std::vector<Slot> slots{slot(2, B), slot(4, B)};
  for (const NodeId active : {NodeId(), NodeId(9)}) {
    const Found found{Identity(address_of(B, 0)).with(active), active};
    const auto p = plan(slots, {found}, {}, master);
    ASSERT_EQ(p.questions.size(), 1U);
    EXPECT_NE(p.questions[0].text.find("leave only the next one switched on"), std::string::npos)
        << p.questions[0].text;
    EXPECT_EQ(p.questions[0].text.find("the others"), std::string::npos) << p.questions[0].text;
  }
}

TEST(Planner, S1_34_MoreDevicesThanSlotsIsAQuestion) {
  const std::vector<Slot> slots{slot(2, B)};
  const auto p = plan(slots, blank({address_of(B, 5), address_of(B, 6)}), {}, master);
  EXPECT_TRUE(p.actions.empty());
  EXPECT_EQ(p.questions.size(), 1U);
}

// S1.3: vendor-ID and product code together, and nothing else, say what a device is for; how many there are is known.
TEST(Planner, S1_3_TheTypeIsVendorAndProduct) {
  const TypeCode type{0x319, 0x1234};
  const std::vector<Slot> slots{slot(7, type)};
  const LssAddress right{0x319, 0x1234, 0x00010002, 99};
  for (const LssAddress& same : {right, LssAddress{0x319, 0x1234, 0xFFFF0001, 99}, LssAddress{0x319, 0x1234, 0, 1}}) {
    const auto p = plan(slots, blank({same}), {}, master);
    EXPECT_EQ(seats(slots, p), (std::map<unsigned, std::uint32_t>{{7, same.serial}})) << to_string(same);
    EXPECT_TRUE(p.oddities.empty());
  }
  for (const LssAddress& other : {LssAddress{0x31A, 0x1234, 0x00010002, 99}, LssAddress{0x319, 0x1235, 0x00010002, 99},
                                  LssAddress{0x1234, 0x319, 0x00010002, 99}, LssAddress{0, 0x1234, 0x00010002, 99}}) {
    const auto p = plan(slots, blank({other}), {}, master);
    EXPECT_TRUE(p.actions.empty()) << to_string(other);
    ASSERT_EQ(p.oddities.size(), 1U);
    EXPECT_EQ(p.oddities[0].kind, OddityKind::foreign);
  }
  // One more than the network has: none of the two is taken for the right one.
  const auto two = plan(slots, blank({right, {0x319, 0x1234, 0x00010002, 100}}), {}, master);
  EXPECT_TRUE(two.actions.empty());
}

TEST(Planner, S1_34_SurplusAndForeignDevicesAreNamed) {
  const std::vector<Slot> slots{slot(2, B, address_of(B, 5))};
  const auto p = plan(slots, blank({address_of(B, 6), address_of(C, 1)}), {}, master);
  EXPECT_TRUE(p.actions.empty());
  ASSERT_EQ(p.oddities.size(), 2U);
  EXPECT_EQ(p.oddities[0].kind, OddityKind::surplus);
  EXPECT_NE(p.oddities[0].text.find("is of the type of " + slots[0].spec.name.name + ", and that has its device"),
            std::string::npos)
      << p.oddities[0].text;
  EXPECT_EQ(p.oddities[1].kind, OddityKind::foreign);
  const std::string also = fmt::format("also = [{{ vendor = 0x{:X}, product = 0x{:X} }}]", C.vendor, C.product);
  EXPECT_NE(p.oddities[1].text.find(also), std::string::npos) << p.oddities[1].text;
}

TEST(Planner, OneAtATimeTakesTheLowestFreeSlot) {
  std::vector<Slot> slots{slot(2, B), slot(4, B)};
  for (auto& s : slots) s.spec.when_ambiguous = WhenAmbiguous::one_at_a_time;
  EXPECT_EQ(seats(slots, plan(slots, blank({address_of(B, 9)}), {}, master)),
            (std::map<unsigned, std::uint32_t>{{2, 9}}));
  slots.push_back(slot(6, B));
  EXPECT_EQ(plan(slots, blank({address_of(B, 9), address_of(B, 10)}), {}, master).questions.size(), 1U);
}

// Its switches, and not LSS, give it its node-ID.
TEST(Planner, WhoKeepsItsNodeIdSitsThereOrNowhere) {
  const std::vector<Slot> slots = {slot(2, B), slot(3, B)};
  const auto keeps = [](std::uint32_t serial, unsigned id) {
    Found f{address_of(B, serial), NodeId(static_cast<std::uint8_t>(id))};
    f.keeps = true;
    return f;
  };
  const auto home = plan(slots, {keeps(9, 3)}, {}, master);
  ASSERT_EQ(home.actions.size(), 1U);
  EXPECT_EQ(home.actions[0].slot, 1U);
  const auto nowhere = plan(slots, {keeps(9, 7)}, {}, master);
  EXPECT_TRUE(nowhere.actions.empty());
  EXPECT_TRUE(nowhere.questions.empty());
  ASSERT_EQ(nowhere.oddities.size(), 1U);
  EXPECT_EQ(nowhere.oddities[0].kind, OddityKind::fixed_mismatch);
  // Nor is it one of those among whom a person would choose.
  auto both = blank({address_of(B, 1), address_of(B, 2)});
  both.push_back(keeps(9, 7));
  EXPECT_EQ(plan(slots, both, {}, master).actions.size(), 2U);
}

TEST(Planner, RevisionRules) {
  auto s = slot(2, B);
  s.spec.revision = 0x00020003;
  s.spec.rule = RevisionRule::major;
  EXPECT_TRUE(fits(s.spec, address_of(B, 1, 0x00020009)));
  EXPECT_FALSE(fits(s.spec, address_of(B, 1, 0x00010003)));
  s.spec.rule = RevisionRule::exact;
  EXPECT_FALSE(fits(s.spec, address_of(B, 1, 0x00020009)));
  const auto p = plan({s}, blank({address_of(B, 1, 0x00020009)}), {}, master);
  EXPECT_TRUE(p.actions.empty());
  ASSERT_EQ(p.oddities.size(), 1U);
  EXPECT_EQ(p.oddities[0].kind, OddityKind::wrong_revision);
}

// Two slots of exact revisions and one device of each: only one assignment is possible, whatever `when_ambiguous` says.
TEST(Planner, WhatHasOneAnswerIsNoQuestion) {
  for (const auto mode : {WhenAmbiguous::ask, WhenAmbiguous::ascending, WhenAmbiguous::one_at_a_time}) {
    std::vector<Slot> slots{slot(2, B), slot(4, B)};
    for (auto& s : slots) {
      s.spec.rule = RevisionRule::exact;
      s.spec.when_ambiguous = mode;
    }
    slots[0].spec.revision = 0x00020000;
    slots[1].spec.revision = 0x00010000;
    // The smaller R_SN belongs in the larger slot: rule 2 alone would fail.
    const auto p = plan(slots, blank({address_of(B, 5, 0x00010000), address_of(B, 6, 0x00020000)}), {}, master);
    EXPECT_TRUE(p.questions.empty());
    EXPECT_EQ(seats(slots, p), (std::map<unsigned, std::uint32_t>{{2, 6}, {4, 5}}));
    // One device, and one slot that it fits: the other slot has nothing to do with it.
    const auto one = plan(slots, blank({address_of(B, 5, 0x00010000)}), {}, master);
    EXPECT_EQ(seats(slots, one), (std::map<unsigned, std::uint32_t>{{4, 5}}));
  }
}

// Rule 2 among those that revisions leave: the slots that want revision 2 get the devices of revision 2 in their order,
// the others the rest, and no person is asked.
TEST(Planner, AscendingGoesRoundRevisions) {
  std::vector<Slot> slots{slot(1, B), slot(3, B), slot(5, B), slot(10, B)};
  for (const std::size_t i : {0U, 2U}) {
    slots[i].spec.rule = RevisionRule::exact;
    slots[i].spec.revision = 2;
  }
  const auto p = plan(
      slots, blank({address_of(B, 1, 0), address_of(B, 2, 2), address_of(B, 3, 0), address_of(B, 5, 2)}), {}, master);
  EXPECT_TRUE(p.questions.empty());
  EXPECT_EQ(seats(slots, p), (std::map<unsigned, std::uint32_t>{{1, 2}, {3, 1}, {5, 5}, {10, 3}}));
}

// The slot that takes any revision is left for the device that fits no other.
TEST(Planner, OthersMayLeaveADeviceOnePlace) {
  std::vector<Slot> slots{slot(2, B), slot(4, B)};
  slots[1].spec.rule = RevisionRule::exact;
  slots[1].spec.revision = 0x00020000;
  for (auto& s : slots) s.spec.when_ambiguous = WhenAmbiguous::ask;
  const auto p = plan(slots, blank({address_of(B, 7, 0x00020000), address_of(B, 9, 0x00010000)}), {}, master);
  EXPECT_EQ(seats(slots, p), (std::map<unsigned, std::uint32_t>{{2, 9}, {4, 7}}));
  // Alone, the newer one could sit in either.
  const auto q = plan(slots, blank({address_of(B, 7, 0x00020000)}), {}, master);
  EXPECT_TRUE(q.actions.empty());
  ASSERT_EQ(q.questions.size(), 1U);
  EXPECT_EQ(q.questions[0].slots, (std::vector<std::size_t>{0, 1}));
}

// Two of one revision stay a question, and only theirs: the other revision's device is seated.
TEST(Planner, AQuestionNamesOnlyWhatItIsAbout) {
  std::vector<Slot> slots{slot(2, B), slot(4, B), slot(6, B)};
  for (auto& s : slots) {
    s.spec.rule = RevisionRule::exact;
    s.spec.revision = 0x00010000;
    s.spec.when_ambiguous = WhenAmbiguous::ask;
  }
  slots[2].spec.revision = 0x00020000;
  const auto p =
      plan(slots, blank({address_of(B, 5, 0x00010000), address_of(B, 6, 0x00010000), address_of(B, 7, 0x00020000)}), {},
           master);
  EXPECT_EQ(seats(slots, p), (std::map<unsigned, std::uint32_t>{{6, 7}}));
  ASSERT_EQ(p.questions.size(), 1U);
  EXPECT_EQ(p.questions[0].slots, (std::vector<std::size_t>{0, 1}));
  EXPECT_EQ(p.questions[0].devices.size(), 2U);
}

// S1.36
TEST(Planner, S1_36_WhoHoldsAnothersNodeIdGivesItUpFirst) {
  const std::vector<Slot> slots{slot(1, A, address_of(A, 1)), slot(2, B)};
  const std::vector<Found> found{{address_of(B, 5), NodeId(1)}};
  const auto p = plan(slots, found, {}, master);
  ASSERT_EQ(p.actions.size(), 2U);
  EXPECT_EQ(p.actions[0].kind, Action::Kind::blank);
  EXPECT_EQ(p.actions[0].device, address_of(B, 5));
  EXPECT_EQ(p.actions[1].kind, Action::Kind::bind);
}

TEST(Planner, S1_36_AForeignDeviceAtTheMastersNodeIdIsBlanked) {
  const auto p = plan({slot(2, B)}, {{address_of(C, 5), master}}, {}, master);
  ASSERT_EQ(p.actions.size(), 1U);
  EXPECT_EQ(p.actions[0].kind, Action::Kind::blank);
}

TEST(Planner, S1_36_AForeignDeviceAtAFreeNodeIdIsLeftAlone) {
  const auto p = plan({slot(2, B)}, {{address_of(C, 5), NodeId(99)}}, {}, master);
  EXPECT_TRUE(p.actions.empty());
  EXPECT_EQ(p.oddities.size(), 1U);
}

// S1.22
TEST(Planner, S1_22_ClonesAreNamedAndNeverSeated) {
  const auto p = plan({slot(2, B)}, {{address_of(B, 5), NodeId(), true}}, {}, master);
  EXPECT_TRUE(p.actions.empty());
  ASSERT_EQ(p.oddities.size(), 1U);
  EXPECT_EQ(p.oddities[0].kind, OddityKind::clone);
}

TEST(Planner, S1_53_UnfinishedWorkComesBeforeNewWork) {
  std::vector<Slot> slots{slot(2, B), slot(4, C)};
  slots[1].record.intended = Assignment{address_of(C, 9), NodeId(4)};
  const auto p = plan(slots, blank({address_of(B, 5)}), {address_of(A, 3)}, master);
  ASSERT_EQ(p.actions.size(), 3U);
  EXPECT_EQ(p.actions[0].kind, Action::Kind::blank);
  EXPECT_EQ(p.actions[0].device, address_of(A, 3));
  EXPECT_EQ(p.actions[1].device, address_of(C, 9));
  EXPECT_EQ(p.actions[2].device, address_of(B, 5));
}

// Whatever is found, no plan seats one device twice, two devices in one slot, a wrong type, or over a binding.
RC_GTEST_PROP(Planner, NeverTwoInOneSlotNorOneInTwo, ()) {
  const auto n = *rc::gen::inRange(1, 8);
  std::vector<Slot> slots;
  for (int i = 0; i < n; ++i) {
    auto s = slot(static_cast<unsigned>(i) + 1, *rc::gen::element(A, B));
    s.spec.when_ambiguous = *rc::gen::element(WhenAmbiguous::ask, WhenAmbiguous::ascending,
                                              WhenAmbiguous::one_at_a_time, WhenAmbiguous::first_seen);
    if (*rc::gen::inRange(0, 3) == 0)
      s.record.confirmed = Assignment{address_of(s.spec.type, 1000U + static_cast<unsigned>(i)), s.spec.id};
    slots.push_back(s);
  }
  std::vector<Found> found;
  const auto m = *rc::gen::inRange(0, 9);
  for (int i = 0; i < m; ++i) {
    const auto id = *rc::gen::inRange(0, 10);
    found.push_back({address_of(*rc::gen::element(A, B, C), static_cast<unsigned>(i)),
                     id == 0 ? NodeId() : NodeId(static_cast<std::uint8_t>(id))});
  }
  const auto p = plan(slots, found, {}, master);
  std::map<std::size_t, int> per_slot;
  std::map<Identity, int> per_device;
  for (const auto& a : p.actions) {
    if (a.kind != Action::Kind::bind) continue;
    RC_ASSERT(fits(slots[a.slot].spec, a.device));
    RC_ASSERT(++per_slot[a.slot] == 1);
    RC_ASSERT(++per_device[a.device] == 1);
    RC_ASSERT(!slots[a.slot].record.confirmed || slots[a.slot].record.confirmed->device == a.device);
  }
}

}  // namespace planner_tests

// Where a device sat before, told by the history's lines.
#include <gtest/gtest.h>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/places/slot_store.hpp"
#include "tests/pch.hpp"

using namespace berth;
using namespace berth::places;

namespace {

LssAddress with_serial(std::uint32_t serial) { return {1, 2, 0, serial}; }

const BusName here{"m", "b"};

struct Table {
  MemoryStore store;
  SlotId left = store.declare({"m", "b", "left"}).value();
  SlotId right = store.declare({"m", "b", "right"}).value();
  void seat(SlotId slot, std::uint32_t serial, unsigned id) {
    const Assignment seat{with_serial(serial), NodeId(static_cast<std::uint8_t>(id))};
    ASSERT_TRUE(store.ask(slot, seat, "x"));
    ASSERT_TRUE(store.confirm(slot, seat, "x"));
  }
  void clear(SlotId slot, std::int64_t at) {
    store.stamp(at);
    ASSERT_TRUE(store.clear(slot, "x"));
  }
  std::optional<FormerSeat> former(std::uint32_t serial) { return former(serial, here); }
  std::optional<FormerSeat> former(std::uint32_t serial, const BusName& on) {
    const auto lines = store.history_of({with_serial(serial), on});
    return former_seat(lines.value());
  }
};

}  // namespace

struct Ticking final : StoreClock {
  std::int64_t ms = 0;
  [[nodiscard]] std::int64_t now_ms() const noexcept override { return ms; }
};

TEST(SlotStore, ALineHasTheTimeOfTheClockElseOfTheStamp) {
  MemoryStore store;
  Ticking clock;
  const auto slot = store.declare({"m", "b", "left"}).value();
  const auto last = [&] { return store.history(std::nullopt).value().back().stamp_ms; };
  const auto write = [&] { ASSERT_TRUE(store.clear(slot, "x")); };
  store.stamp(5);
  write();
  EXPECT_EQ(last(), 5);
  store.set_clock(&clock);
  clock.ms = 70;
  write();
  EXPECT_EQ(last(), 70);
  clock.ms = 71;
  write();
  EXPECT_EQ(last(), 71);
  store.set_clock(nullptr);
  write();
  EXPECT_EQ(last(), 5) << "as it was stamped before";
}

TEST(FormerSeat, IsTheLastOneThatEnded) {
  Table t;
  EXPECT_FALSE(t.former(5));
  t.seat(t.left, 5, 2);
  EXPECT_FALSE(t.former(5)) << "it sits there";
  t.clear(t.left, 100);
  EXPECT_EQ(t.former(5), (FormerSeat{t.left, NodeId(2), 100}));
  t.seat(t.right, 5, 3);
  EXPECT_FALSE(t.former(5)) << "it sits again";
  t.clear(t.right, 200);
  EXPECT_EQ(t.former(5), (FormerSeat{t.right, NodeId(3), 200}));
}

TEST(FormerSeat, AskedAndNeverHeardIsNone) {
  Table t;
  ASSERT_TRUE(t.store.ask(t.left, {with_serial(5), NodeId(2)}, "x"));
  t.clear(t.left, 100);
  EXPECT_FALSE(t.former(5));
}

TEST(FormerSeat, FactorySettingsMakeItNew) {
  Table t;
  t.seat(t.left, 5, 2);
  t.clear(t.left, 100);
  ASSERT_TRUE(t.store.mark(Mark::restore, {with_serial(5), here}, NodeId(2), "used"));
  EXPECT_TRUE(t.former(5)) << "asked for is not done";
  ASSERT_TRUE(t.store.unmark(Mark::restore, {with_serial(5), here}, "done"));
  EXPECT_FALSE(t.former(5));
}

TEST(FormerSeat, OfAnotherDeviceIsNotItsOwn) {
  Table t;
  t.seat(t.left, 5, 2);
  t.clear(t.left, 100);
  t.seat(t.left, 6, 2);
  EXPECT_FALSE(t.former(6));
  EXPECT_EQ(t.former(5), (FormerSeat{t.left, NodeId(2), 100}));
}

// ---- twins: one LSS address on two buses ----

namespace {

const LssAddress zero = with_serial(0);
const BusDevice on_a{zero, {"m", "a"}};
const BusDevice on_b{zero, {"m", "b"}};
const BusDevice on_another_machine{zero, {"n", "a"}};

struct Twins {
  MemoryStore store;
  SlotId a = store.declare({"m", "a", "s"}).value();
  SlotId b = store.declare({"m", "b", "s"}).value();
  SlotId spare = store.declare({"m", "b", "spare"}).value();
  SlotId n = store.declare({"n", "a", "s"}).value();
};

}  // namespace

TEST(Twins, EachSitsOnItsBusAndInOneSlotOfIt) {
  Twins t;
  const Assignment seat{zero, NodeId(1)};
  for (const SlotId slot : {t.a, t.b, t.n}) {
    ASSERT_TRUE(t.store.ask(slot, seat, "x"));
    ASSERT_TRUE(t.store.confirm(slot, seat, "x"));
  }
  const auto refused = t.store.ask(t.spare, {zero, NodeId(2)}, "x");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::duplicate);
  const std::string text = refused.error().text;
  EXPECT_NE(text.find("slot s of bus b"), std::string::npos) << text;
  EXPECT_NE(text.find("berth replace b/s"), std::string::npos) << text;
  // One of them leaves: the other two stay, and its slot is free for it again.
  ASSERT_TRUE(t.store.clear(t.b, std::string(by_a_person)));
  EXPECT_EQ(t.store.load(t.a).value().confirmed, seat);
  EXPECT_EQ(t.store.load(t.n).value().confirmed, seat);
  EXPECT_TRUE(t.store.ask(t.spare, {zero, NodeId(2)}, "x"));
  EXPECT_EQ(t.store.ask(t.b, seat, "x").error().code, Errc::duplicate);
}

TEST(Twins, ABlankOfOneIsNotEndedByTheOther) {
  Twins t;
  const UnfinishedBlank of_a{zero, "m", "a", NodeId(5)};
  const UnfinishedBlank of_b{zero, "m", "b", NodeId(6)};
  ASSERT_TRUE(t.store.ask_blank(of_a, "x"));
  ASSERT_TRUE(t.store.ask_blank(of_b, "x"));
  EXPECT_EQ(t.store.unfinished_blanks().value(), (std::vector{of_a, of_b}));
  ASSERT_TRUE(t.store.ask(t.b, {zero, NodeId(1)}, "x"));
  ASSERT_TRUE(t.store.confirm(t.b, {zero, NodeId(1)}, "x"));
  EXPECT_EQ(t.store.unfinished_blanks().value(), std::vector{of_a}) << "its twin was bound on the other bus";
  EXPECT_EQ(t.store.drop_blank(on_b, "x").error().code, Errc::not_found);
  ASSERT_TRUE(t.store.confirm_blank(on_b, "x"));
  EXPECT_EQ(t.store.unfinished_blanks().value(), std::vector{of_a});
  ASSERT_TRUE(t.store.confirm_blank(on_a, "x"));
  EXPECT_TRUE(t.store.unfinished_blanks().value().empty());
}

// A row of before schema 5 or 6 names no bus: the first bus that writes or ends it has it.
TEST(Twins, WhatIsOfAnyBusEndsOnTheFirstThatEndsIt) {
  Twins t;
  ASSERT_TRUE(t.store.ask_blank({zero, "", "", NodeId()}, "old"));
  ASSERT_TRUE(t.store.lend({zero, "", "", NodeId(126)}));
  ASSERT_TRUE(t.store.mark(Mark::fixed, {zero, {}}, NodeId(3), "old"));
  EXPECT_TRUE(t.store.is_marked(Mark::fixed, on_a).value());
  EXPECT_TRUE(t.store.is_marked(Mark::fixed, on_b).value());
  const UnfinishedBlank of_b{zero, "m", "b", NodeId(6)};
  ASSERT_TRUE(t.store.ask_blank(of_b, "begun anew"));
  EXPECT_EQ(t.store.unfinished_blanks().value(), std::vector{of_b});
  const LentId lent_on_a{zero, "m", "a", NodeId(125)};
  ASSERT_TRUE(t.store.lend(lent_on_a));
  EXPECT_EQ(t.store.lent().value(), std::vector{lent_on_a});
  ASSERT_TRUE(t.store.unmark(Mark::fixed, on_b, "tried again"));
  EXPECT_FALSE(t.store.is_marked(Mark::fixed, on_a).value());
  ASSERT_TRUE(t.store.lend({zero, "", "", NodeId(126)}));
  ASSERT_TRUE(t.store.give_back(on_b));
  EXPECT_EQ(t.store.lent().value(), std::vector{lent_on_a});
}

TEST(Twins, ALoanAndAMarkOfOneAreNotTheOthers) {
  Twins t;
  const LentId lent_on_a{zero, "m", "a", NodeId(126)};
  const LentId lent_on_b{zero, "m", "b", NodeId(7)};
  const LentId lent_on_n{zero, "n", "a", NodeId(8)};
  for (const auto& lent : {lent_on_b, lent_on_n, lent_on_a}) ASSERT_TRUE(t.store.lend(lent));
  EXPECT_EQ(t.store.lent().value(), (std::vector{lent_on_a, lent_on_b, lent_on_n}));
  ASSERT_TRUE(t.store.give_back(on_a));
  EXPECT_EQ(t.store.lent().value(), (std::vector{lent_on_b, lent_on_n}));
  ASSERT_TRUE(t.store.mark(Mark::restore, on_a, NodeId(1), "used"));
  EXPECT_FALSE(t.store.is_marked(Mark::restore, on_b).value());
  EXPECT_FALSE(t.store.is_marked(Mark::restore, on_another_machine).value());
  ASSERT_TRUE(t.store.mark(Mark::restore, on_b, NodeId(2), "used"));
  ASSERT_TRUE(t.store.unmark(Mark::restore, on_b, "done"));
  EXPECT_EQ(t.store.marked(Mark::restore).value(), (std::vector<Marked>{{zero, NodeId(1), on_a.on}}));
}

// A device that is moved to another bus is a new one there; and its twin there has no past of its own.
TEST(Twins, TheFormerSeatIsOfTheBus) {
  Table t;
  t.seat(t.left, 0, 2);
  t.clear(t.left, 100);
  EXPECT_TRUE(t.former(0));
  EXPECT_FALSE(t.former(0, {"m", "c"}));
  EXPECT_FALSE(t.former(0, {"n", "b"}));
  // Its twin gets its factory settings on the other bus: this one did not.
  ASSERT_TRUE(t.store.mark(Mark::restore, {with_serial(0), {"m", "c"}}, NodeId(2), "used"));
  ASSERT_TRUE(t.store.unmark(Mark::restore, {with_serial(0), {"m", "c"}}, "done"));
  EXPECT_TRUE(t.former(0));
  // Nothing said on which bus, as in stores of before schema 7: of any.
  ASSERT_TRUE(t.store.unmark(Mark::restore, {with_serial(0), {}}, "done"));
  EXPECT_FALSE(t.former(0));
}

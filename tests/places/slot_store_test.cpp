// Where a device sat before, told by the history's lines.
#include <gtest/gtest.h>
#include <cstdint>
#include <optional>

#include "berth/places/slot_store.hpp"
#include "tests/pch.hpp"

using namespace berth;
using namespace berth::places;

namespace {

LssAddress with_serial(std::uint32_t serial) { return {1, 2, 0, serial}; }

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
  std::optional<FormerSeat> former(std::uint32_t serial) {
    const auto lines = store.history_of(with_serial(serial));
    return former_seat(lines.value());
  }
};

}  // namespace

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
  ASSERT_TRUE(t.store.mark(Mark::restore, with_serial(5), NodeId(2), "used"));
  EXPECT_TRUE(t.former(5)) << "asked for is not done";
  ASSERT_TRUE(t.store.unmark(Mark::restore, with_serial(5), "done"));
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

// The devices found on the bus of a network list: under which identity each is known, and in which slot one runs.
#include "berth/manager/list_found.hpp"

#include <gtest/gtest.h>

namespace berth::manager {
namespace {

constexpr Identity drive{1, 2, 3, 4};
constexpr Identity other{1, 2, 3, 5};

class List : public ::testing::Test {
 protected:
  List() {
    ListSlot slot;
    slot.slot.spec.id = NodeId(5);
    slot.slot.spec.type.vendor = 1;
    slot.slot.spec.type.product = 2;
    slot.typed = true;
    slots_.push_back(slot);
  }
  std::vector<ListSlot> slots_;
  ListFound found_{slots_};
};

TEST_F(List, ADeviceThatRunsUnderItsSlotsNodeIdIsTheSlots) {
  found_.note({drive, NodeId(5)});
  ASSERT_TRUE(slots_[0].device);
  EXPECT_EQ(*slots_[0].device, drive);
  found_.note({other, NodeId(5)});
  EXPECT_EQ(*slots_[0].device, drive) << "who answered in this run counts";
}

TEST_F(List, OneOfSeveralOrUnderAnotherNodeIdIsNot) {
  found_.note({drive, NodeId(6)});
  found_.note({other, NodeId(5), true});
  places::Found shared{drive, NodeId(5)};
  shared.shared = true;
  found_.note(shared);
  found_.note({drive, NodeId()});
  EXPECT_FALSE(slots_[0].device);
}

TEST_F(List, EachIsKnownOnceAndForgotten) {
  found_.note({drive, NodeId(6)});
  found_.note({drive, NodeId(7)});
  ASSERT_NE(found_.find(drive), nullptr);
  EXPECT_EQ(found_.find(drive)->active, NodeId(7));
  EXPECT_EQ(std::distance(found_.begin(), found_.end()), 1);
  found_.forget(drive);
  EXPECT_TRUE(found_.empty());
}

// Without a serial number it is known by its node-ID, and its equals answer to its LSS address.
TEST_F(List, EqualsWithoutASerialNumberAreKnownByTheirNodeIds) {
  constexpr Identity plain{1, 2, 3, 0};
  found_.note({plain, NodeId(6)});
  found_.note({plain, NodeId(7)});
  EXPECT_EQ(std::distance(found_.begin(), found_.end()), 2);
  EXPECT_TRUE(found_.has_equals(plain.with(NodeId(6)), NodeId(6)));
  EXPECT_FALSE(found_.can_be_selected(plain.with(NodeId(6))));
  EXPECT_TRUE(found_.can_be_selected(drive));
}

}  // namespace
}  // namespace berth::manager

// What the master of a network list remembers: durable when the call returns, old or new after a power loss at any
// byte.
#include "berth/manager/list_store.hpp"

#include <gtest/gtest.h>
#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

namespace berth::manager::list_store_tests {
namespace {

class Memory final : public ListMemory {
 public:
  [[nodiscard]] std::size_t size() const noexcept override { return bytes.size(); }
  void read(std::size_t at, std::span<std::uint8_t> into) const noexcept override {
    for (std::size_t i = 0; i < into.size(); ++i) into[i] = at + i < bytes.size() ? bytes[at + i] : 0xFF;
  }
  bool write(std::size_t at, std::span<const std::uint8_t> data) noexcept override {
    for (std::size_t i = 0; i < data.size(); ++i) {
      if (left && *left == 0) {
        if (torn) bytes[at + i] = *torn;
        return false;
      }
      bytes[at + i] = data[i];
      if (left) --*left;
    }
    written += data.size();
    return true;
  }
  std::vector<std::uint8_t> bytes = std::vector<std::uint8_t>(ListStore::footprint, 0xFF);
  std::optional<std::uint64_t> left;  // bytes until the power is lost
  std::optional<std::uint8_t> torn;
  std::size_t written = 0;
};

LssAddress device(std::uint32_t serial) { return {1, 2, 3, serial}; }

struct Facts {
  std::vector<places::SlotRecord> slots;
  std::vector<places::UnfinishedBlank> formers;
};

Facts facts(ListStore& store) {
  places::SlotStore& rows = store;
  Facts all{*rows.load(std::string_view()), *rows.unfinished_blanks()};
  std::erase_if(all.slots, [](const auto& r) { return !r.device(); });
  return all;
}

bool equal(const Facts& a, const Facts& b) {
  const auto same = [](const places::SlotRecord& x, const places::SlotRecord& y) {
    return x.slot == y.slot && x.intended == y.intended && x.confirmed == y.confirmed;
  };
  return std::ranges::equal(a.slots, b.slots, same) && a.formers == b.formers;
}

// The third of three devices comes in the place of the first.
constexpr unsigned calls = 9;
Result<void> call(ListStore& store, unsigned number) {
  const auto slot = ListStore::slot_of(NodeId(5));
  const auto other = ListStore::slot_of(NodeId(126));
  switch (number) {
    case 0: return store.ask(slot, {device(1), NodeId(5)}, "");
    case 1: return store.confirm(slot, {device(1), NodeId(5)}, "");
    case 2: return store.ask(other, {device(2), NodeId(126)}, "");
    case 3: return store.confirm(other, {device(2), NodeId(126)}, "");
    case 4: return store.give_away(slot, "");
    case 5: return store.ask(slot, {device(3), NodeId(5)}, "");
    case 6: return store.confirm(slot, {device(3), NodeId(5)}, "");
    case 7: return store.ask(other, {device(2), NodeId(126)}, "");  // once more
    default: return store.confirm_blank({device(1), {}}, "");
  }
}

}  // namespace

TEST(ListStore, WhatWasWrittenIsThereAfterAPowerLossAtAnyLaterTime) {
  Memory memory;
  ListStore store(&memory);
  for (unsigned number = 0; number < calls; ++number) {
    ASSERT_TRUE(call(store, number)) << number;
    ListStore later(&memory);
    EXPECT_TRUE(equal(facts(later), facts(store))) << number;
  }
  EXPECT_EQ(store.writes(), calls);
}

// One without a serial number is its node-ID's, and what it does not say is unknown and not 0, after a power loss too.
TEST(ListStore, WhatIsUnknownOfADeviceIsNotZeroLater) {
  Memory memory;
  {
    ListStore store(&memory);
    for (const std::uint8_t id : {std::uint8_t{5}, std::uint8_t{6}, std::uint8_t{7}}) {
      Identity device(1, 7, 0, 0);
      if (id == 7) device.unknown = 0xC;
      const places::Assignment seat{device.with(NodeId(id)), NodeId(id)};
      ASSERT_TRUE(store.ask(ListStore::slot_of(seat.id), seat, ""));
      ASSERT_TRUE(store.confirm(ListStore::slot_of(seat.id), seat, ""));
    }
    ASSERT_TRUE(store.give_away(ListStore::slot_of(NodeId(6)), ""));
  }
  ListStore later(&memory);
  places::SlotStore& store = later;
  const auto confirmed = [&](std::uint8_t id) { return store.load(ListStore::slot_of(NodeId(id))).value().confirmed; };
  EXPECT_EQ(confirmed(5)->device, Identity(1, 7, 0, 0).with(NodeId(5)));
  EXPECT_FALSE(confirmed(6));
  Identity partly(1, 7, 0, 0);
  partly.unknown = 0xC;
  EXPECT_EQ(confirmed(7)->device, partly.with(NodeId(7)));
  ASSERT_EQ(later.unfinished_blanks().value().size(), 1U);
  EXPECT_EQ(later.unfinished_blanks().value().front().device, Identity(1, 7, 0, 0).with(NodeId(6)));
}

TEST(ListStore, APowerLossAtAnyByteLeavesOldOrNew) {
  for (unsigned number = 0; number < calls; ++number) {
    Memory before;
    ListStore until(&before);
    for (unsigned n = 0; n < number; ++n) ASSERT_TRUE(call(until, n));
    const Facts old = facts(until);
    Memory whole = before;
    ListStore after(&whole);
    whole.written = 0;
    ASSERT_TRUE(call(after, number));
    const Facts now = facts(after);
    for (std::size_t byte = 0; byte < whole.written; ++byte) {
      for (const std::optional<std::uint8_t> torn : {std::optional<std::uint8_t>(), {0x00}, {0xFF}, {0x5A}}) {
        Memory cut = before;
        ListStore dies(&cut);
        cut.left = byte;
        cut.torn = torn;
        EXPECT_FALSE(call(dies, number));
        EXPECT_TRUE(equal(facts(dies), old)) << "a call that failed has changed nothing";
        ListStore next(&cut);
        EXPECT_TRUE(equal(facts(next), old) || equal(facts(next), now)) << number << ", " << byte;
        // And goes on from there.
        cut.left.reset();
        const bool again = equal(facts(next), old);
        EXPECT_TRUE(!again || call(next, number)) << number << ", " << byte;
        ListStore last(&cut);
        EXPECT_TRUE(equal(facts(last), now)) << number << ", " << byte;
      }
    }
  }
}

TEST(ListStore, ADeviceOfAnotherSlotIsRefused) {
  ListStore store;
  ASSERT_TRUE(store.ask(ListStore::slot_of(NodeId(5)), {device(1), NodeId(5)}, ""));
  EXPECT_EQ(store.ask(ListStore::slot_of(NodeId(6)), {device(1), NodeId(6)}, "").error().code, Errc::duplicate);
  EXPECT_EQ(store.ask(ListStore::slot_of(NodeId(5)), {device(2), NodeId(5)}, "").error().code, Errc::duplicate);
}

// The longest list that there can be, and more devices that were given away than are remembered.
TEST(ListStore, TheLongestListFits) {
  Memory memory;
  ListStore store(&memory);
  const auto slot = ListStore::slot_of(NodeId(1));
  std::uint32_t serial = 1000;
  for (unsigned n = 0; n < ListStore::most_former + 5; ++n) {
    const places::Assignment seat{device(++serial), NodeId(1)};
    ASSERT_TRUE(store.ask(slot, seat, ""));
    ASSERT_TRUE(store.confirm(slot, seat, ""));
    ASSERT_TRUE(store.give_away(slot, ""));
  }
  for (std::uint8_t node = 1; node <= 126; ++node) {
    const places::Assignment seat{device(node), NodeId(node)};
    ASSERT_TRUE(store.ask(ListStore::slot_of(NodeId(node)), seat, ""));
    ASSERT_TRUE(store.confirm(ListStore::slot_of(NodeId(node)), seat, ""));
    ASSERT_TRUE(store.ask(ListStore::slot_of(NodeId(node)), seat, "")) << unsigned{node};
  }
  ListStore later(&memory);
  EXPECT_TRUE(equal(facts(later), facts(store)));
  const auto formers = facts(later).formers;
  ASSERT_EQ(formers.size(), ListStore::most_former);
  EXPECT_EQ(formers.front().device, device(1006)) << "the oldest were forgotten";
  EXPECT_EQ(formers.back().device, device(serial));
}

TEST(ListStore, AMemoryThatIsTooSmallRefuses) {
  Memory memory;
  memory.bytes.resize(56);  // one row in each copy
  ListStore store(&memory);
  ASSERT_TRUE(store.ask(ListStore::slot_of(NodeId(5)), {device(1), NodeId(5)}, ""));
  EXPECT_EQ(store.ask(ListStore::slot_of(NodeId(6)), {device(2), NodeId(6)}, "").error().code, Errc::io);
  EXPECT_EQ(facts(store).slots.size(), 1U) << "what is not in the memory counts for nothing";
}

// Whatever stands in the memory: it is read, and never believed where its checksum is wrong.
TEST(ListStore, ReadsAnything) {
  std::uint32_t random = 1;
  for (int round = 0; round < 2000; ++round) {
    Memory memory;
    ListStore store(&memory);
    for (unsigned n = 0; n < 4; ++n) ASSERT_TRUE(call(store, n));
    for (int flips = 0; flips < 1 + round % 40; ++flips) {
      random = random * 1664525 + 1013904223;
      memory.bytes[(random >> 8) % 400 + (random % 2) * memory.bytes.size() / 2] =
          static_cast<std::uint8_t>(random >> 24);
    }
    ListStore later(&memory);
    EXPECT_LE(facts(later).slots.size(), 2U);
  }
}

}  // namespace berth::manager::list_store_tests

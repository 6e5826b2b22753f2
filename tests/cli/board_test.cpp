// The live slot table by itself: whatever the slots and the terminal, it fits, and what needs a person is seen first.
#include "apps/berth/board.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cstdint>
#include <string>
#include <vector>

#include <algorithm>

#include "berth/text/columns.hpp"

namespace berth::cli {
namespace {

using places::SlotState;

BoardSlot slot(std::uint8_t id, const std::string& name, SlotState state, const std::string& reason = "") {
  BoardSlot s;
  s.slot = {"line", NodeId(id), name, {1, 1}, LssAddress{1, 1, 1, id}, state, rt::Time(), reason};
  return s;
}

std::size_t line_with(const std::vector<BoardLine>& lines, const std::string& text) {
  const auto it = std::ranges::find_if(lines, [&](const auto& l) { return l.text.find(text) != std::string::npos; });
  return static_cast<std::size_t>(it - lines.begin());
}

TEST(Board, WhatNeedsAPersonStandsFirstWithItsReasonWhole) {
  BoardContent content{"plant", {}, {}};
  content.slots = {slot(1, "left", SlotState::operational), slot(2, "right", SlotState::binding),
                   slot(3, "drive", SlotState::absent, "heartbeat lost; switch the device on"),
                   slot(4, "lift", SlotState::absent, "heartbeat lost; switch the device on")};
  const auto lines = Board().draw(content, {80, 24});
  EXPECT_EQ(lines.at(1).text, "line: 4 slots, 2 absent, 1 binding, 1 operational");
  EXPECT_LT(line_with(lines, "drive"), line_with(lines, "right"));
  EXPECT_LT(line_with(lines, "right"), line_with(lines, "left"));
  const auto reason = line_with(lines, "drive, lift: absent: heartbeat lost; switch the device on");
  ASSERT_LT(reason, lines.size()) << "one fact, told once";
  EXPECT_TRUE(lines[reason].urgent);
  EXPECT_EQ(lines.size(), 8U);
}

TEST(Board, AnOptionalSlotThatIsEmptyIsNoTrouble) {
  BoardContent content{"plant", {slot(1, "left", SlotState::empty)}, {}};
  EXPECT_TRUE(needs_a_person(content.slots[0]));
  content.slots[0].optional = true;
  EXPECT_FALSE(needs_a_person(content.slots[0]));
}

TEST(Board, StateStandsBeforeTypeSoThatANarrowTerminalShowsIt) {
  const BoardContent content{"plant", {slot(1, "left", SlotState::operational)}, {}};
  const auto lines = Board().draw(content, {50, 24});
  EXPECT_NE(lines.at(3).text.find("operational"), std::string::npos) << lines.at(3).text;
}

TEST(Board, ALongNameIsCutAndTheStateStays) {
  const BoardContent content{"plant", {slot(1, std::string(60, 'x'), SlotState::operational)}, {}};
  const auto lines = Board().draw(content, {60, 24});
  EXPECT_NE(lines.at(3).text.find("xx~  operational"), std::string::npos) << lines.at(3).text;
}

TEST(Board, ManyBusesHaveOneSummary) {
  BoardContent content{"plant", {}, {}};
  for (std::uint8_t i = 1; i < 10; ++i) {
    content.slots.push_back(slot(i, "slot " + std::to_string(i), SlotState::operational));
    content.slots.back().slot.bus = "bus " + std::to_string(i);
  }
  EXPECT_EQ(Board().draw(content, {80, 24}).at(1).text, "9 buses: 9 slots, 9 operational");
  EXPECT_EQ(Board().draw(content, {80, 60}).at(1).text, "bus 1: 1 slot, 1 operational");
}

BoardSlot any_slot(int number) {
  auto s = slot(static_cast<std::uint8_t>(number % 127 + 1), "slot " + std::to_string(number) + ";",
                static_cast<SlotState>(*rc::gen::inRange(0, static_cast<int>(SlotState::wrong_type) + 1)));
  s.slot.bus = *rc::gen::element<std::string>("line", "rechts", "\xE5\xB7\xA6");
  s.slot.reason = *rc::gen::element<std::string>(
      "", "heartbeat lost; switch the device on, or `berth replace` it",
      "\xF0\x9F\x94\xA7 \xF0\x9F\x94\xA7\xF0\x9F\x94\xA7\xF0\x9F\x94\xA7 no\tspace\x1b[2J", std::string(300, 'w'));
  return s;
}

RC_GTEST_PROP(Board, FitsEveryTerminalAndShowsEverySlotByScrolling, ()) {
  BoardContent content{"a machine with a name", {}, {"which of 50 devices belongs where? " + std::string(200, 'q')}};
  const int slots = *rc::gen::inRange(0, 130);
  for (int i = 0; i < slots; ++i) content.slots.push_back(any_slot(i));
  const BoardSize size{*rc::gen::inRange<std::size_t>(1, 200), *rc::gen::inRange<std::size_t>(0, 60)};
  Board board;
  std::string seen;
  for (int page = 0; page < 1500; ++page) {
    const auto lines = board.draw(content, size);
    RC_ASSERT(lines.size() <= size.rows);
    for (const auto& line : lines) {
      RC_ASSERT(text::columns(line.text) <= size.columns);
      RC_ASSERT(line.text.find('\x1b') == std::string::npos);
      seen += line.text + "\n";
    }
    if (!board.partial()) break;
    const auto before = lines;
    board.scroll(static_cast<std::ptrdiff_t>(board.page()));
    if (board.draw(content, size) == before) break;
  }
  if (size.columns < 50 || size.rows < 12) return;
  for (int i = 0; i < slots; ++i) RC_ASSERT(seen.find("slot " + std::to_string(i) + ";") != std::string::npos);
}

TEST(Board, EndAndBeginningByOneKeyEach) {
  BoardContent content{"plant", {}, {}};
  for (std::uint8_t i = 1; i < 121; ++i)
    content.slots.push_back(slot(i, "slot " + std::to_string(i), SlotState::operational));
  Board board;
  EXPECT_EQ(line_with(board.draw(content, {80, 10}), "slot 120"), 10U) << "not in view";
  board.to_end();
  EXPECT_LT(line_with(board.draw(content, {80, 10}), "slot 120"), 10U);
  board.scroll(-1);
  EXPECT_EQ(line_with(board.draw(content, {80, 10}), "slot 120"), 10U) << "from the end, not from far beyond it";
  board.to_begin();
  EXPECT_LT(line_with(board.draw(content, {80, 10}), "slot 1 "), 10U);
}

}  // namespace
}  // namespace berth::cli

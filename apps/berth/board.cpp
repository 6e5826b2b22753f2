#include "board.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <map>

#include "berth/base/counted.hpp"
#include "berth/operate/slot_rows.hpp"
#include "berth/text/columns.hpp"
#include "berth/text/printable.hpp"

namespace berth::cli {
namespace {

using places::SlotState;

constexpr std::size_t widest_name = 24;  // longer ones are cut, so that the state stays in view

/// First the slots that need the user, then those in progress, then those that are well.
int rank(const BoardSlot& s) noexcept {
  if (needs_a_person(s)) return 0;
  const bool well = s.slot.state == SlotState::operational || s.slot.state == SlotState::empty;
  return well ? 2 : 1;
}

std::string summary(const std::string& name, const std::vector<const BoardSlot*>& slots) {
  std::map<std::pair<int, SlotState>, std::size_t> count;
  for (const auto* const s : slots) ++count[{rank(*s), s->slot.state}];
  std::string states;
  for (const auto& [state, n] : count) states += fmt::format(", {} {}", n, places::name(state.second));
  return fmt::format("{}: {}{}", name, counted(slots.size(), "slot"), states);
}

/// One line per bus; a single line for all if there are more than `most`.
std::vector<std::string> summaries(const BoardContent& content, std::size_t most) {
  std::map<std::string, std::vector<const BoardSlot*>> of_bus;
  std::vector<const BoardSlot*> all;
  for (const auto& s : content.slots) {
    of_bus[s.slot.bus].push_back(&s);
    all.push_back(&s);
  }
  if (of_bus.size() > most) return {summary(fmt::format("{} buses", of_bus.size()), all)};
  std::vector<std::string> lines;
  for (const auto& [bus, slots] : of_bus) lines.push_back(summary(bus, slots));
  return lines;
}

void add_wrapped(std::vector<BoardLine>& lines, const std::string& text, std::size_t width) {
  constexpr std::size_t indent = 4;
  const std::size_t room = width > 2 * indent ? width - indent : width;
  for (const auto& part : text::wrapped(text::one_line(text), room)) {
    lines.push_back({std::string(width - room, ' ') + part, true});
  }
}

/// The slots that need the user, with the reasons; then the others.
std::vector<BoardLine> body(const BoardContent& content, std::size_t width) {
  std::vector<BoardLine> lines;
  for (const auto& question : content.questions) add_wrapped(lines, question, width);
  if (content.slots.empty()) return lines;
  std::vector<operate::SlotReport> all;
  for (const auto& s : content.slots) all.push_back(s.slot);
  const operate::SlotRows rows(all, {.width = width, .bus = false, .widest_name = widest_name});
  lines.push_back({rows.heading(), false});
  std::vector<operate::SlotReport> urgent;
  for (const int wanted : {0, 1, 2}) {
    for (const auto& s : content.slots) {
      if (rank(s) != wanted) continue;
      if (wanted == 0) urgent.push_back(s.slot);
      lines.push_back({rows.row(s.slot), wanted == 0});
    }
    if (wanted != 0) continue;
    for (const auto& reason : operate::reasons_of(urgent)) add_wrapped(lines, reason, width);
  }
  return lines;
}

}  // namespace

bool needs_a_person(const BoardSlot& s) noexcept {
  switch (s.slot.state) {
    case SlotState::operational:
    case SlotState::present:
    case SlotState::binding:
    case SlotState::configuring: return false;
    case SlotState::unknown: return !s.slot.reason.empty();  // with a reason: its port sends no frames
    case SlotState::empty: return !s.optional;
    default: return true;
  }
}

void Board::to_end() noexcept { first_ = std::numeric_limits<std::ptrdiff_t>::max() / 2; }

std::vector<BoardLine> Board::draw(const BoardContent& content, BoardSize size) {
  std::vector<BoardLine> lines;
  partial_ = true;
  if (size.rows == 0 || size.columns == 0) return lines;
  lines.push_back({content.headline, false});
  const std::size_t most_buses = size.rows / 4;
  if (most_buses > 0) {
    for (auto& line : summaries(content, most_buses)) lines.push_back({std::move(line), false});
  }
  const std::size_t most_values = size.rows / 2;
  for (std::size_t i = 0; i < std::min(content.values.size(), most_values); ++i) lines.push_back(content.values[i]);
  std::vector<BoardLine> slots = body(content, size.columns);
  const std::size_t room = size.rows > lines.size() ? size.rows - lines.size() : 0;
  partial_ = slots.size() > room;
  page_ = partial_ ? std::max<std::size_t>(room, 2) - 1 : slots.size();
  const auto last = partial_ ? static_cast<std::ptrdiff_t>(slots.size() - std::min(page_, slots.size())) : 0;
  first_ = std::clamp<std::ptrdiff_t>(first_, 0, last);
  const auto from = static_cast<std::size_t>(first_);
  const std::size_t to = std::min(slots.size(), from + page_);
  if (room > 1 || !partial_)
    std::move(slots.begin() + first_, slots.begin() + static_cast<std::ptrdiff_t>(to), std::back_inserter(lines));
  if (partial_ && room > 0) {
    lines.push_back({fmt::format("lines {} to {} of {}: Page Up, Page Down", from + 1, to, slots.size()), false});
  }
  for (auto& line : lines) line.text = text::cut(text::one_line(line.text), size.columns);
  return lines;
}

}  // namespace berth::cli

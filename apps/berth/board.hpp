/// The slot table of a run on a terminal. It fits any terminal size; what needs the user comes first. Pure: the drawing
/// depends on the arguments alone.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "berth/operate/report.hpp"

namespace berth::cli {

struct BoardSize {
  std::size_t columns = 80;
  std::size_t rows = 24;
};

struct BoardSlot {
  operate::SlotReport slot;
  bool optional = false;  ///< may be empty without being in trouble
};

struct BoardLine {
  std::string text;
  bool urgent = false;  ///< about a slot that needs a person
  friend bool operator==(const BoardLine&, const BoardLine&) = default;
};

struct BoardContent {
  std::string headline;
  std::vector<BoardSlot> slots;
  std::vector<std::string> questions;  ///< that are open
  std::vector<BoardLine> values = {};  ///< watched values, with their heading (watch_rows.hpp)
};

/// The user has to do something: the slot is absent, failed, a question, empty though not optional, ...
[[nodiscard]] bool needs_a_person(const BoardSlot& slot) noexcept;

/// Draws, in this order: headline, a summary line for each bus, watched values (in at most half of the lines), open
/// questions, slots that need the user with their full reasons, the other slots. At most `size.rows` lines, none wider
/// than `size.columns`.
class Board {
 public:
  [[nodiscard]] std::vector<BoardLine> draw(const BoardContent& content, BoardSize size);
  /// Scrolls down, or up when negative; the next `draw` stops at the ends.
  void scroll(std::ptrdiff_t lines) noexcept { first_ += lines; }
  void to_begin() noexcept { first_ = 0; }
  void to_end() noexcept;
  /// How many lines of slots the last drawing showed.
  [[nodiscard]] std::size_t page() const noexcept { return page_; }
  /// The last drawing left lines out.
  [[nodiscard]] bool partial() const noexcept { return partial_; }

 private:
  std::ptrdiff_t first_ = 0;  // of the lines of slots
  std::size_t page_ = 1;
  bool partial_ = false;
};

}  // namespace berth::cli

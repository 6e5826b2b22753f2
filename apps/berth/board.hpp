/// The slot table of a run as it stands on a terminal: it fits, whatever the terminal's size, and what needs a person
/// stands first. Pure: what is drawn follows from what is given.
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
  bool optional = false;  ///< that it is empty is no trouble
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
  std::vector<BoardLine> values = {};  ///< watched ones, with their heading (watch_rows.hpp)
};

/// A person has to do something: it is absent, failed, a question, empty though it is not optional, ...
[[nodiscard]] bool needs_a_person(const BoardSlot& slot) noexcept;

/// Headline, a summary line for each bus, watched values (in half of the lines at most), open questions, slots that
/// need a person with their reasons whole, then the others. Each line is no wider than `size.columns`, and there are no
/// more than `size.rows` of them.
class Board {
 public:
  [[nodiscard]] std::vector<BoardLine> draw(const BoardContent& content, BoardSize size);
  /// Lines down, or up when negative; the next `draw` stops at the ends.
  void scroll(std::ptrdiff_t lines) noexcept { first_ += lines; }
  void to_begin() noexcept { first_ = 0; }
  void to_end() noexcept;
  /// How many lines of slots the last drawing showed at once.
  [[nodiscard]] std::size_t page() const noexcept { return page_; }
  /// The last drawing left lines out.
  [[nodiscard]] bool partial() const noexcept { return partial_; }

 private:
  std::ptrdiff_t first_ = 0;  // of the lines of slots
  std::size_t page_ = 1;
  bool partial_ = false;
};

}  // namespace berth::cli

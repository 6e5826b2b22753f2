/// Lines at the bottom of a terminal that are drawn anew in place, below what stays.
#pragma once

#include <string>
#include <vector>

#include "board.hpp"

namespace berth::cli {

/// Standard output is a terminal on which a cursor can be moved (TERM is set, and not "dumb").
[[nodiscard]] bool can_draw() noexcept;
/// Another process group has the terminal at standard output.
[[nodiscard]] bool in_background() noexcept;
/// Of the terminal at standard output; 80 by 24 where it is not told.
[[nodiscard]] BoardSize terminal_size() noexcept;

class Redraw {
 public:
  Redraw();
  /// `lines` in the place of those before, and `above` over them, which stays; only what changed is written.
  /// `size`: of the terminal now. Each line is one of the terminal's, and filtered (`text::one_line`).
  void draw(const std::vector<std::string>& above, std::vector<BoardLine> lines, BoardSize size);
  /// Nothing of it is on the terminal any more: `erased`, or what is there stays, and what comes goes below it.
  void erase();
  void keep() noexcept { drawn_.clear(); }

 private:
  [[nodiscard]] std::string written(const BoardLine& line) const;
  void erase(std::string& out);
  void draw_changes(std::string& out, std::vector<BoardLine> lines);

  bool colours_;
  BoardSize size_{};              // of the terminal when it was drawn
  std::vector<BoardLine> drawn_;  // what is on the terminal now, the cursor below it
};

}  // namespace berth::cli

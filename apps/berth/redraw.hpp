/// Redraws lines in place at the bottom of a terminal, below permanent lines.
#pragma once

#include <string>
#include <vector>

#include "board.hpp"

namespace berth::cli {

/// Standard output is a terminal that can move its cursor (TERM is set, and not "dumb").
[[nodiscard]] bool can_draw() noexcept;
/// Another process group owns the terminal at standard output.
[[nodiscard]] bool in_background() noexcept;
/// Of the terminal at standard output; 80 by 24 if unknown.
[[nodiscard]] BoardSize terminal_size() noexcept;

class Redraw {
 public:
  Redraw();
  /// Draws `lines` over the last ones, and `above` over them, permanently; writes only what changed. `size`: the
  /// terminal's current one. Each line fits one line of the terminal and is filtered (`text::one_line`).
  void draw(const std::vector<std::string>& above, std::vector<BoardLine> lines, BoardSize size);
  /// Forgets the drawn lines: `erase` removes them from the terminal, `keep` leaves them there, and later lines go
  /// below.
  void erase();
  void keep() noexcept { drawn_.clear(); }

 private:
  [[nodiscard]] std::string written(const BoardLine& line) const;
  void erase(std::string& out);
  void draw_changes(std::string& out, std::vector<BoardLine> lines);

  bool colours_;
  BoardSize size_{};              // of the terminal at the last drawing
  std::vector<BoardLine> drawn_;  // the lines on the terminal; the cursor is below them
};

}  // namespace berth::cli

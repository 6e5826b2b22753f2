/// The lines of a run: plain, or on a terminal above a live slot table (`Board`) that is drawn anew in place.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "berth/tree/session.hpp"
#include "board.hpp"
#include "event_lines.hpp"
#include "keyboard.hpp"

namespace berth::cli {

/// Standard output is a terminal on which a cursor can be moved (TERM is set, and not "dumb").
[[nodiscard]] bool can_draw() noexcept;

struct ScreenOptions {
  bool live = false;        ///< draws the table; needs `can_draw`
  bool quiet = false;       ///< prints nothing
  bool events = false;      ///< though quiet: every event as a line of JSON
  bool wall_clock = false;  ///< events have the time of day too: the buses are real
  /// What is said behind an event when it is seen for the first time; empty: nothing.
  std::function<std::string(const operate::Event&)> comment{};
};

class Screen {
 public:
  Screen(tree::Session& session, ScreenOptions options);
  /// From now on keys move the table, and a line that is typed goes to `line`. Live screens only; `loop` must stay.
  void listen(io::Loop& loop, std::function<void(const std::string&)> line);

  [[nodiscard]] bool live() const noexcept { return options_.live; }
  void line(const std::string& text);
  void event(const operate::Event& event);
  /// Draws what changed, at most ten times a second, and the time once a second.
  void refresh(bool now = false);
  /// What is drawn stays, whole: a table that did not fit is printed once. What comes goes below it.
  void keep();

 private:
  void put(const std::vector<std::string>& lines);
  [[nodiscard]] BoardContent content() const;
  [[nodiscard]] std::vector<BoardLine> drawing(BoardSize size);
  [[nodiscard]] std::string written(const BoardLine& line) const;
  void erase(std::string& out);
  void draw_all(std::string& out, std::vector<BoardLine> lines);
  void draw_changes(std::string& out, std::vector<BoardLine> lines);
  void moved(Key key);

  tree::Session* session_;
  ScreenOptions options_;
  bool colours_;
  EventLines events_;
  Board board_;
  std::set<std::pair<std::string, NodeId>> optional_;  // slots, by bus and node-ID
  bool dirty_ = true;
  BoardSize size_{};              // of the terminal when it was drawn
  std::vector<BoardLine> drawn_;  // what is on the terminal now, the cursor below it
  std::vector<std::string> waiting_;
  std::chrono::steady_clock::time_point last_{};
  std::unique_ptr<Keyboard> keyboard_;
};

}  // namespace berth::cli

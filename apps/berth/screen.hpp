/// The lines of a run: plain, or on a terminal above a live slot table (`Board`) that is drawn anew in place.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "berth/tree/session.hpp"
#include "board.hpp"
#include "event_lines.hpp"
#include "keyboard.hpp"
#include "output.hpp"
#include "redraw.hpp"

namespace berth::cli {

struct ScreenOptions {
  bool live = false;        ///< draws the table; needs `can_draw`
  bool quiet = false;       ///< prints nothing
  bool events = false;      ///< though quiet: every event as a line of JSON
  bool wall_clock = false;  ///< events have the time of day too: the buses are real
  /// What is said after an event when it is seen for the first time; empty: nothing.
  std::function<std::string(const operate::Event&)> comment{};
};

class Screen {
 public:
  Screen(tree::Session& session, ScreenOptions options);
  /// What was said and not drawn is printed: a run that failed before its first drawing says why.
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;
  /// From now on keys move the table, and a line that is typed goes to `line`; a key at its beginning
  /// may be one by itself (`alone`). Live screens only; `loop` must stay.
  void listen(io::Loop& loop, std::function<void(const std::string&)> line, std::function<bool(char)> alone);

  /// Its word stands in the heading while it is not empty: "paused", such as.
  void show_time(std::function<std::string()> word) { time_ = std::move(word); }
  /// Values for the table: lines with their heading, for so many columns.
  void show_values(std::function<std::vector<BoardLine>(std::size_t columns)> values) { values_ = std::move(values); }

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
  void moved(Key key);

  tree::Session* session_;
  ScreenOptions options_;
  EventLines events_;
  Board board_;
  std::function<std::vector<BoardLine>(std::size_t)> values_;  // may be empty
  std::function<std::string()> time_;                          // may be empty
  std::set<std::pair<std::string, NodeId>> optional_;          // slots, by bus and node-ID
  bool dirty_ = true;
  Redraw redraw_;
  std::vector<std::string> waiting_;
  std::chrono::steady_clock::time_point last_{};
  std::unique_ptr<Keyboard> keyboard_;
  std::optional<ErrorLines> errors_;  // while the table is drawn
};

}  // namespace berth::cli

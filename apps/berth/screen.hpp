/// The lines of a run: plain, or on a terminal above a live slot table (`Board`) that is redrawn in place.
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
#include "log_level.hpp"
#include "output.hpp"
#include "redraw.hpp"

namespace berth::cli {

struct ScreenOptions {
  bool live = false;    ///< draws the table; needs `can_draw`
  bool quiet = false;   ///< prints nothing
  bool events = false;  ///< even if quiet: every event as a line of JSON
  EventLines::Head head = EventLines::Head::bus_time;
  LogLevel level = LogLevel::debug;  ///< less urgent events are not printed
  /// Text after an event that is seen for the first time; empty: none.
  std::function<std::string(const operate::Event&)> comment{};
};

class Screen {
 public:
  Screen(tree::Session& session, ScreenOptions options);
  /// Prints lines that were not drawn yet: a run that failed before its first drawing shows why.
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;
  /// From now on keys scroll the table, and `line` gets each typed line; `alone` may take a key at the beginning of a
  /// line. Live screens only; `loop` must outlive it.
  void listen(io::Loop& loop, std::function<void(const std::string&)> line, std::function<bool(char)> alone);

  /// Shows `word`'s text in the heading while it is not empty, such as "paused".
  void show_time(std::function<std::string()> word) { time_ = std::move(word); }
  /// Values for the table: lines with their heading, for this number of columns.
  void show_values(std::function<std::vector<BoardLine>(std::size_t columns)> values) { values_ = std::move(values); }

  [[nodiscard]] bool live() const noexcept { return options_.live; }
  void line(const std::string& text);
  void event(const operate::Event& event);
  /// Draws changes at most ten times a second, and the time once a second.
  void refresh(bool now = false);
  /// Leaves the last table on the terminal, printing it whole if it did not fit. Later lines go below it.
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

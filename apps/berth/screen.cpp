#include "screen.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/operate/slot_rows.hpp"
#include "berth/text/columns.hpp"
#include "berth/text/printable.hpp"
#include "output.hpp"

namespace berth::cli {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

namespace {

/// Leaves room for some lines above the table, and for the cursor's line below it.
BoardSize room_in(BoardSize terminal) noexcept {
  const std::size_t above = terminal.rows / 4;
  return {terminal.columns, terminal.rows - std::min(terminal.rows, above + 1)};
}

}  // namespace

Screen::Screen(tree::Session& session, ScreenOptions options)
    : session_(&session), options_(std::move(options)), events_(options_.head) {
  for (const auto& slot : session.machine().slots) {
    if (slot.spec.optional) optional_.insert({slot.spec.name.bus, slot.spec.id});
  }
  if (options_.live && !options_.quiet) errors_.emplace([this](const std::string& text) { line(text); });
}

Screen::~Screen() {
  errors_.reset();
  print_lines(waiting_);
}

void Screen::listen(io::Loop& loop, std::function<void(const std::string&)> line, std::function<bool(char)> alone) {
  if (!options_.live) return;
  keyboard_ = std::make_unique<Keyboard>(
      loop, [this](Key key) { moved(key); }, std::move(line), [this] { dirty_ = true; }, std::move(alone));
}

void Screen::line(const std::string& text) {
  put(events_.rest());
  const bool levels = options_.head == EventLines::Head::level;
  put({(levels ? prefix_of(LogLevel::notice) : "") + text});
}

void Screen::event(const operate::Event& event) {
  dirty_ = true;
  if (level_of(event) > options_.level) return;
  if (options_.events) print_line(operate::to_json(event));
  if (options_.quiet) return;
  put(events_.add(event));
  const std::string said = options_.comment ? options_.comment(event) : "";
  if (!said.empty()) line(said);
}

void Screen::put(const std::vector<std::string>& lines) {
  if (lines.empty()) return;
  dirty_ = true;
  if (options_.quiet) return;
  if (options_.live) {
    std::ranges::copy(lines, std::back_inserter(waiting_));
  } else {
    print_lines(lines);
  }
}

void Screen::moved(Key key) {
  const auto page = static_cast<std::ptrdiff_t>(board_.page());
  switch (key) {
    case Key::up: return board_.scroll(-1);
    case Key::down: return board_.scroll(1);
    case Key::page_up: return board_.scroll(-page);
    case Key::page_down: return board_.scroll(page);
    case Key::home: return board_.to_begin();
    case Key::end: return board_.to_end();
  }
}

BoardContent Screen::content() const {
  BoardContent content;
  const std::string word = time_ ? time_() : "";
  // The answer to an open question may begin with q.
  const char* const end = tree::questions_of(*session_).empty() ? "q" : "Ctrl-C";
  content.headline = fmt::format("{}  {:.1f} s on the bus{}  {} ends it, ? helps", session_->machine().name,
                                 operate::seconds(session_->executor().now()), word.empty() ? "" : ", " + word, end);
  for (auto& slot : session_->slots()) {
    const bool optional = optional_.contains({slot.bus, slot.id});
    content.slots.push_back({std::move(slot), optional});
  }
  for (const auto& network : session_->networks()) {
    for (const auto& question : network->planning().plan().questions) content.questions.push_back(question.text);
  }
  return content;
}

std::vector<BoardLine> Screen::drawing(BoardSize size) {
  BoardSize room = room_in(size);
  const bool types = keyboard_ != nullptr && !keyboard_->typed().empty() && room.rows > 1;
  if (types) --room.rows;
  BoardContent now = content();
  if (values_) now.values = values_(size.columns);
  auto lines = board_.draw(now, room);
  if (types) {
    // Of a long line, the end is shown, where the user is typing.
    std::string typed = text::one_line(keyboard_->typed());
    while (text::columns(typed) + 3 > size.columns && !typed.empty()) typed.erase(0, 1);
    lines.push_back({text::cut("> " + typed + "_", size.columns), false});
  }
  return lines;
}

void Screen::refresh(bool now) {
  if (const auto rest = events_.rest(); !rest.empty()) put(rest);
  if (!options_.live || options_.quiet) return;
  const auto since = Clock::now() - last_;
  if (!now && since < (dirty_ ? 100ms : 1000ms)) return;
  last_ = Clock::now();
  dirty_ = false;
  // In the background (Ctrl-Z, `bg`), the shell uses the terminal: print only lines, no table over its prompt.
  if (in_background()) {
    redraw_.keep();
    print_lines(std::exchange(waiting_, {}));
    return;
  }
  const BoardSize size = terminal_size();
  // After Ctrl-Z, the shell has written below the table.
  if (keyboard_ != nullptr && keyboard_->take_again()) redraw_.keep();
  redraw_.draw(std::exchange(waiting_, {}), drawing(size), size);
}

void Screen::keep() {
  refresh(true);
  if (!options_.live) return;
  keyboard_.reset();
  errors_.reset();
  if (board_.partial()) {
    redraw_.erase();
    print_lines(operate::to_table(session_->slots()));
  }
  redraw_.keep();
  options_.live = false;
}

}  // namespace berth::cli

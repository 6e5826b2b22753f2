#include "screen.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "berth/text/columns.hpp"
#include "berth/text/printable.hpp"
#include "output.hpp"

namespace berth::cli {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

namespace {

std::string_view variable(const char* name) noexcept {
  const char* const value = std::getenv(name);
  return value == nullptr ? std::string_view() : std::string_view(value);
}

BoardSize terminal_size() noexcept {
  winsize size{};
  const bool known = ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 && size.ws_row > 0;
  return known ? BoardSize{size.ws_col, size.ws_row} : BoardSize{};
}

/// Some lines above the table stay in view, and the cursor's own is below it.
BoardSize room_in(BoardSize terminal) noexcept {
  const std::size_t above = terminal.rows / 4;
  return {terminal.columns, terminal.rows - std::min(terminal.rows, above + 1)};
}

}  // namespace

bool can_draw() noexcept {
  const auto terminal = variable("TERM");
  return on_terminal() && !terminal.empty() && terminal != "dumb";
}

Screen::Screen(tree::Session& session, ScreenOptions options)
    : session_(&session),
      options_(std::move(options)),
      colours_(variable("NO_COLOR").empty()),
      events_(options_.wall_clock) {
  for (const auto& slot : session.machine().slots) {
    if (slot.spec.optional) optional_.insert({slot.spec.name.bus, slot.spec.id});
  }
}

void Screen::listen(io::Loop& loop, std::function<void(const std::string&)> line) {
  if (!options_.live) return;
  keyboard_ = std::make_unique<Keyboard>(
      loop, [this](Key key) { moved(key); }, std::move(line), [this] { dirty_ = true; });
}

void Screen::line(const std::string& text) {
  put(events_.rest());
  put({text});
}

void Screen::event(const operate::Event& event) {
  dirty_ = true;
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
  content.headline = fmt::format("{}  {:.1f} s on the bus  Ctrl-C ends it", session_->machine().name,
                                 operate::seconds(session_->executor().now()));
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
  auto lines = board_.draw(content(), room);
  if (types) {
    // The end of a long one is what is being typed.
    std::string typed = text::one_line(keyboard_->typed());
    while (text::columns(typed) + 3 > size.columns && !typed.empty()) typed.erase(0, 1);
    lines.push_back({text::cut("> " + typed + "_", size.columns), false});
  }
  return lines;
}

std::string Screen::written(const BoardLine& line) const {
  return line.urgent && colours_ ? "\x1b[33m" + line.text + "\x1b[0m" : line.text;
}

void Screen::erase(std::string& out) {
  if (!drawn_.empty()) out += fmt::format("\x1b[{}A", drawn_.size());
  out += "\r\x1b[J";
  drawn_.clear();
}

void Screen::draw_all(std::string& out, std::vector<BoardLine> lines) {
  for (const auto& line : lines) out += written(line) + "\n";
  drawn_ = std::move(lines);
}

// As many lines as before: each that differs is written over.
void Screen::draw_changes(std::string& out, std::vector<BoardLine> lines) {
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i] == drawn_[i]) continue;
    const std::size_t up = lines.size() - i;
    out += fmt::format("\x1b[{}A\r{}\x1b[K\x1b[{}B\r", up, written(lines[i]), up);
  }
  drawn_ = std::move(lines);
}

void Screen::refresh(bool now) {
  if (const auto rest = events_.rest(); !rest.empty()) put(rest);
  if (!options_.live || options_.quiet) return;
  const auto since = Clock::now() - last_;
  if (!now && since < (dirty_ ? 100ms : 1000ms)) return;
  last_ = Clock::now();
  dirty_ = false;
  const BoardSize size = terminal_size();
  const bool returned = keyboard_ != nullptr && keyboard_->take_again();
  const bool other_size = size.columns != size_.columns || size.rows != size_.rows;
  size_ = size;
  auto lines = drawing(size);
  std::string out;
  if (returned) drawn_.clear();  // the shell has written below it
  if (waiting_.empty() && !other_size && !returned && lines.size() == drawn_.size()) {
    draw_changes(out, std::move(lines));
  } else {
    erase(out);
    for (const auto& line : waiting_) out += text::one_line(line) + "\n";
    waiting_.clear();
    draw_all(out, std::move(lines));
  }
  write_text(out);
}

void Screen::keep() {
  refresh(true);
  if (!options_.live) return;
  keyboard_.reset();
  if (board_.partial()) {
    std::string out;
    erase(out);
    write_text(out);
    print_lines(operate::to_table(session_->slots()));
  }
  drawn_.clear();
  options_.live = false;
}

}  // namespace berth::cli

#include "redraw.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdlib>
#include <sstream>
#include <string_view>
#include <utility>

#include "berth/text/columns.hpp"
#include "berth/text/printable.hpp"
#include "output.hpp"

namespace berth::cli {
namespace {

std::string_view variable(const char* name) noexcept {
  const char* const value = std::getenv(name);
  return value == nullptr ? std::string_view() : std::string_view(value);
}

// Wraps at spaces, since a terminal itself wraps anywhere.
std::string broken_at_spaces(const std::string& line, std::size_t width) {
  constexpr std::size_t indent = 4;
  if (width <= 2 * indent || text::columns(line) <= width) return line + "\n";
  // A word wider than the terminal, such as an address, is not wrapped here, so that it can be copied whole.
  std::istringstream words(line);
  for (std::string word; words >> word;) {
    if (text::columns(word) > width - indent) return line + "\n";
  }
  std::string out;
  for (const auto& part : text::wrapped(line, width - indent))
    out += (out.empty() ? "" : std::string(indent, ' ')) + part + "\n";
  return out;
}

}  // namespace

BoardSize terminal_size() noexcept {
  winsize size{};
  const bool known = ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 && size.ws_row > 0;
  return known ? BoardSize{size.ws_col, size.ws_row} : BoardSize{};
}

// False also for a terminal of another session, whose foreground process the system does not report.
bool in_background() noexcept {
  const pid_t foreground = ::tcgetpgrp(STDOUT_FILENO);
  return foreground > 0 && foreground != ::getpgrp();
}

bool can_draw() noexcept {
  const auto terminal = variable("TERM");
  return on_terminal() && !terminal.empty() && terminal != "dumb";
}

Redraw::Redraw() : colours_(coloured()) {}

std::string Redraw::written(const BoardLine& line) const {
  return line.urgent && colours_ ? "\x1b[33m" + line.text + "\x1b[0m" : line.text;
}

void Redraw::erase(std::string& out) {
  if (!drawn_.empty()) out += fmt::format("\x1b[{}A", drawn_.size());
  out += "\r\x1b[J";
  drawn_.clear();
}

void Redraw::erase() {
  std::string out;
  erase(out);
  write_text(out);
}

// For as many lines as before: overwrites each line that differs.
void Redraw::draw_changes(std::string& out, std::vector<BoardLine> lines) {
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i] == drawn_[i]) continue;
    const std::size_t up = lines.size() - i;
    out += fmt::format("\x1b[{}A\r{}\x1b[K\x1b[{}B\r", up, written(lines[i]), up);
  }
  drawn_ = std::move(lines);
}

void Redraw::draw(const std::vector<std::string>& above, std::vector<BoardLine> lines, BoardSize size) {
  const bool other_size = size.columns != size_.columns || size.rows != size_.rows;
  size_ = size;
  std::string out;
  if (above.empty() && !other_size && lines.size() == drawn_.size()) {
    draw_changes(out, std::move(lines));
  } else {
    erase(out);
    for (const auto& line : above) out += broken_at_spaces(text::one_line(line), size.columns);
    for (const auto& line : lines) out += written(line) + "\n";
    drawn_ = std::move(lines);
  }
  write_text(out);
}

}  // namespace berth::cli

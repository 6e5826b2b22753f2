#include "watch_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <string_view>

#include "berth/base/words.hpp"
#include "berth/operate/slot_rows.hpp"
#include "berth/text/columns.hpp"
#include "berth/text/printable.hpp"

namespace berth::cli {
namespace {

constexpr std::size_t gap = 2;
constexpr std::size_t widest_slot = 20;
constexpr std::size_t widest_object = 28;
constexpr std::size_t widest_value = 24;
constexpr std::size_t shortest_name = 8;
constexpr std::size_t age_width = 6;
constexpr std::size_t longest_plot = 32;
constexpr std::size_t shortest_plot = 8;

struct Widths {
  std::size_t slot = 4;
  std::size_t object = 6;
  std::size_t value = 8;
  std::size_t age = age_width;      // 0: left out
  std::size_t plot = longest_plot;  // 0: left out
  [[nodiscard]] std::size_t all() const noexcept {
    std::size_t sum = slot + gap + object + gap + value;
    for (const std::size_t column : {age, plot}) sum += column == 0 ? 0 : gap + column;
    return sum;
  }
};

// Narrows `column` by the excess width of the rows, but not below `least`.
void shrink(Widths& widths, std::size_t& column, std::size_t least, std::size_t width) {
  if (widths.all() <= width || column <= least) return;
  column -= std::min(column - least, widths.all() - width);
}

Widths widths_of(const std::vector<WatchRow>& rows, std::size_t width) {
  Widths widths;
  for (const auto& row : rows) {
    widths.slot = std::max(widths.slot, std::min(widest_slot, text::columns(text::one_line(row.slot))));
    widths.object = std::max(widths.object, std::min(widest_object, text::columns(text::one_line(row.object))));
    widths.value = std::max(widths.value, std::min(widest_value, text::columns(text::one_line(row.value))));
  }
  shrink(widths, widths.plot, shortest_plot, width);
  shrink(widths, widths.value, widest_value - 8, width);
  if (widths.all() > width) widths.plot = 0;
  if (widths.all() > width) widths.age = 0;
  shrink(widths, widths.object, shortest_name, width);
  shrink(widths, widths.slot, shortest_name, width);
  return widths;
}

std::string fitted(const std::string& words, std::size_t width) {
  const std::string shown = text::one_line(words);
  return text::columns(shown) > width ? text::cut(shown, width - 1) + "~" : shown;
}

std::string to_right(const std::string& words, std::size_t width) {
  const std::string shown = fitted(words, width);
  return std::string(width - std::min(width, text::columns(shown)), ' ') + shown;
}

std::string line_of(const WatchRow& row, const Widths& widths, rt::Time now, bool utf8) {
  const bool failed = !row.trouble.empty();
  // The problem is shown in place of the plot; if there is no room, in place of the value.
  const bool no_room = failed && (widths.plot == 0 || row.value.empty());
  std::string line = text::padded(fitted(row.slot, widths.slot), widths.slot + gap) +
                     text::padded(fitted(row.object, widths.object), widths.object + gap);
  if (no_room) return line + text::one_line(row.trouble);
  line += to_right(row.value, widths.value);
  if (widths.age > 0)
    line += std::string(gap, ' ') +
            to_right(row.read_at ? operate::age_cell(now - *row.read_at) : std::string(), widths.age);
  if (widths.plot > 0) line += std::string(gap, ' ');
  if (failed) return line + text::one_line(row.trouble);
  return widths.plot > 0 ? line + sparkline(row.past, widths.plot, utf8) : line;
}

std::string heading_of(const Widths& widths) {
  std::string line = text::padded("slot", widths.slot + gap) + text::padded("object", widths.object + gap) +
                     to_right("value", widths.value);
  if (widths.age > 0) line += std::string(gap, ' ') + to_right("age", widths.age);
  if (widths.plot > 0) line += std::string(gap, ' ') + fitted("last values", widths.plot);
  return line;
}

}  // namespace

std::string sparkline(const std::deque<std::optional<double>>& past, std::size_t width, bool utf8) {
  static constexpr std::array<std::string_view, 8> blocks{"▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
  static constexpr std::string_view ascii = ".:-=+*#@";
  const std::size_t from = past.size() - std::min(past.size(), width);
  std::optional<double> low;
  std::optional<double> high;
  for (std::size_t i = from; i < past.size(); ++i) {
    if (!past[i]) continue;
    low = std::min(low.value_or(*past[i]), *past[i]);
    high = std::max(high.value_or(*past[i]), *past[i]);
  }
  std::string line;
  for (std::size_t i = from; i < past.size(); ++i) {
    if (!past[i]) {
      line += ' ';
      continue;
    }
    const double share = *high > *low ? (*past[i] - *low) / (*high - *low) : 0;
    const auto level = static_cast<std::size_t>(share * 7 + 0.5);
    if (utf8) {
      line += blocks[level];
    } else {
      line += ascii[level];
    }
  }
  return line;
}

std::vector<BoardLine> watch_lines(const std::vector<WatchRow>& rows, std::size_t width, rt::Time now, bool utf8) {
  const Widths widths = widths_of(rows, width);
  std::vector<BoardLine> lines{{heading_of(widths), false}};
  for (const auto& row : rows) lines.push_back({line_of(row, widths, now, utf8), !row.trouble.empty()});
  for (auto& line : lines) {
    line.text = text::cut(line.text, width);
    line.text.erase(line.text.find_last_not_of(' ') + 1);
  }
  return lines;
}

bool terminal_has_utf8() noexcept {
  for (const char* const name : {"LC_ALL", "LC_CTYPE", "LANG"}) {
    const char* const value = std::getenv(name);
    if (value == nullptr || *value == '\0') continue;
    const std::string_view words(value);
    return std::ranges::any_of(std::array<std::string_view, 4>{"UTF-8", "utf8", "utf-8", "UTF8"},
                               [&](std::string_view one) { return words.find(one) != std::string_view::npos; });
  }
  return false;
}

}  // namespace berth::cli

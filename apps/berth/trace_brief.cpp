#include "trace_brief.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "berth/text/columns.hpp"
#include "berth/text/printable.hpp"

namespace berth::cli {
namespace {

/// The words in alternating parts: fixed text, then a name that may be shortened, and so on; fixed text comes last.
struct Parts {
  std::vector<std::string> fixed;
  std::vector<std::string> names;

  [[nodiscard]] std::string text() const {
    std::string all;
    for (std::size_t i = 0; i < names.size(); ++i) all += fixed[i] + names[i];
    return all + fixed.back();
  }
  [[nodiscard]] std::size_t columns() const { return text::columns(text()); }
};

// Where the name that ends at `end` begins: after the object ("1018h:01 "), or after the separator of a PDO's signals.
std::size_t name_begin(std::string_view words, std::size_t from, std::size_t end) {
  constexpr std::string_view digits = "0123456789ABCDEF";
  std::size_t begin = from;
  for (std::size_t i = from; i < end; ++i) {
    const bool parts = i + 1 < end && words[i + 1] == ' ' && (words[i] == ':' || words[i] == ',');
    if (parts) begin = i + 2;
    const bool object = i >= 4 && words[i] == 'h' && words.substr(i - 4, 4).find_first_not_of(digits) == words.npos;
    const auto space = object ? words.find(' ', i) : words.npos;
    if (space < end && space <= i + 4) begin = space + 1;
  }
  return begin;
}

Parts parts_of(std::string_view words) {
  constexpr std::string_view value = " = ";
  constexpr std::string_view abort = ": abort by ";
  Parts parts;
  std::size_t done = 0;
  for (std::size_t from = 0;;) {
    const std::size_t end = std::min(words.find(value, from), words.find(abort, from));
    if (end == words.npos) break;
    const std::size_t begin = name_begin(words, from, end);
    parts.fixed.emplace_back(words.substr(done, begin - done));
    parts.names.emplace_back(words.substr(begin, end - begin));
    done = end;
    from = end + value.size();
  }
  parts.fixed.emplace_back(words.substr(done));
  return parts;
}

void drop_type(std::string& head) {
  const auto begin = head.find(" [");
  const auto end = begin == head.npos ? head.npos : head.find(']', begin);
  if (end != head.npos) head.erase(begin, end + 1 - begin);
}

void drop_first_part(std::string& name) {
  const auto dot = name.rfind('.');
  if (dot != name.npos && dot + 1 < name.size()) name.erase(0, dot + 1);
}

// Shortens `words` to `room` columns, as far as the names can be shortened.
std::string narrowed(std::string_view words, std::size_t room) {
  constexpr std::size_t shortest = 4;
  Parts parts = parts_of(words);
  drop_type(parts.fixed.front());
  if (parts.columns() > room) std::ranges::for_each(parts.names, drop_first_part);
  std::size_t longest = shortest;
  for (const auto& name : parts.names) longest = std::max(longest, text::columns(name));
  while (parts.columns() > room && longest > shortest) {
    --longest;
    for (auto& name : parts.names) {
      if (text::columns(name) > longest) name = text::cut(name, longest - 1) + "~";
    }
  }
  return parts.text();
}

}  // namespace

std::string brief_line(rt::Duration at, std::string_view bus, std::string_view frame, std::string_view words,
                       const BriefStyle& style) {
  constexpr std::size_t shortest_bus = 4;
  constexpr std::size_t shortest_id = 3;
  const auto mark = frame.find('#');
  const std::string_view data = mark == std::string_view::npos ? std::string_view() : frame.substr(mark + 1);
  std::string line = fmt::format("{:10.4f} ", std::chrono::duration<double>(at).count());
  if (style.bus) line += text::padded(text::one_line(bus), shortest_bus) + " ";
  line += text::padded(frame.substr(0, mark), shortest_id) + "  ";
  const std::size_t before = text::columns(line);
  std::string said = text::one_line(words);
  if (style.width > before && before + text::columns(said) > style.width) said = narrowed(said, style.width - before);
  line += said;
  const std::size_t used = text::columns(line);
  if (used > style.width) return style.width == 0 ? std::string() : text::cut(line, style.width - 1) + "~";
  if (data.empty() || used + 2 + data.size() > style.width) return line;
  return text::padded(line, style.width - data.size()) + std::string(data);
}

}  // namespace berth::cli

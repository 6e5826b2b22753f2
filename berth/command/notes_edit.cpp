#include "berth/command/notes_edit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>
#include <vector>

#include "berth/base/part_file.hpp"
#include "berth/base/read_files.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/toml.hpp"

namespace berth::command {
namespace {

using text::Member;
using text::Value;

constexpr std::array<std::string_view, 5> keys{"text", "unit", "scale", "values", "bits"};

template <class Map>
std::string table_of(const Map& names) {
  std::string made;
  for (const auto& [number, name] : names) {
    made += fmt::format("{}{} = {}", made.empty() ? "{ " : ", ", number, text::quoted(name));
  }
  return made.empty() ? made : made + " }";
}

// The key's value in TOML; empty: the note has none.
std::string rendered(const Note& note, std::string_view key) {
  if (key == "text") return note.text.empty() ? std::string() : text::quoted(note.text);
  if (key == "unit") return note.unit.empty() ? std::string() : text::quoted(note.unit);
  if (key == "scale") return note.scale == 1 ? std::string() : fmt::format("{}", note.scale);
  return key == "values" ? table_of(note.values) : table_of(note.bits);
}

/// Replaces a range of bytes by other bytes.
struct Change {
  std::size_t begin = 0;
  std::size_t end = 0;
  std::string bytes{};
};

std::string changed(std::string_view text, std::vector<Change> changes) {
  // An insertion comes before a replacement that begins at the same place.
  std::ranges::stable_sort(changes, {}, [](const Change& c) { return std::pair(c.begin, c.end); });
  std::string made;
  std::size_t at = 0;
  for (const Change& change : changes) {
    if (change.begin < at) return {};  // overlap: only in a file that no person would write
    made += text.substr(at, change.begin - at);
    made += change.bytes;
    at = change.end;
  }
  made += text.substr(at);
  return made;
}

std::string_view newline_of(std::string_view text) noexcept {
  const auto at = text.find('\n');
  return at != std::string_view::npos && at > 0 && text[at - 1] == '\r' ? "\r\n" : "\n";
}

std::size_t next_line(std::string_view text, std::size_t at) noexcept {
  const auto newline = text.find('\n', at);
  return newline == std::string_view::npos ? text.size() : newline + 1;
}

/// The place after the last character of the value and of everything in it.
text::Place end_of(const Value& value) noexcept {
  text::Place end = std::max(value.begin, value.end);
  for (const auto& item : value.items) end = std::max(end, end_of(item));
  for (const auto& member : value.members) end = std::max({end, member.place, end_of(member.value)});
  return end;
}

/// Edits one file.
class Edit {
 public:
  Edit(std::string_view text, ObjectRef object, const Note& before, const Note& note)
      : text_(text), object_(object), before_(before), note_(note) {}

  /// `member`: the object's table; null: it has none.
  std::string run(const Member* member) {
    if (member == nullptr) return appended();
    const bool in_line = member->value.in_line;
    if (note_.empty()) {
      erase_lines(in_line ? member->place : member->value.begin, end_of(member->value));
    } else if (in_line) {
      changes_.push_back({at(member->value.begin), at(member->value.end), in_one_line()});
    } else {
      for (const auto key : keys) change_key(member->value, key);
      insert(member->value);
    }
    return changed(text_, std::move(changes_));
  }

 private:
  [[nodiscard]] std::size_t at(text::Place place) const noexcept { return text::offset_of(text_, place); }

  std::string appended() const {
    const std::string newline(newline_of(text_));
    std::string made(text_);
    if (!made.empty() && made.back() != '\n') made += newline;
    if (!made.empty()) made += newline;
    made += fmt::format("[\"{}\"]{}", od::write_object(object_), newline);
    for (const auto key : keys) {
      const std::string value = rendered(note_, key);
      if (!value.empty()) made += fmt::format("{} = {}{}", key, value, newline);
    }
    return made;
  }

  std::string in_one_line() const {
    std::string made;
    for (const auto key : keys) {
      const std::string value = rendered(note_, key);
      if (!value.empty()) made += fmt::format("{}{} = {}", made.empty() ? "{ " : ", ", key, value);
    }
    return made + " }";
  }

  // Erases whole lines if nothing else but a comment is on them.
  void erase_lines(text::Place from, text::Place to) {
    std::size_t begin = at(from);
    std::size_t end = at(to);
    const auto newline = begin == 0 ? std::string_view::npos : text_.rfind('\n', begin - 1);
    const std::size_t line = newline == std::string_view::npos ? 0 : newline + 1;
    const std::size_t next = next_line(text_, end);
    const auto before = text_.substr(line, begin - line);
    const auto first = text_.substr(end, next - end).find_first_not_of(" \t\r\n");
    const bool alone = before.find_first_not_of(" \t") == std::string_view::npos &&
                       (first == std::string_view::npos || text_[end + first] == '#');
    if (alone) begin = line, end = next;
    changes_.push_back({begin, end, {}});
  }

  void change_key(const Value& table, std::string_view key) {
    const std::string value = rendered(note_, key);
    const auto member = std::ranges::find(table.members, key, &Member::key);
    const bool there = member != table.members.end();
    if (there && rendered(before_, key) == value) return;
    const bool header = there && member->value.kind == Value::Kind::table && !member->value.in_line;
    if (there && !header && !value.empty()) {
      changes_.push_back({at(member->value.begin), at(member->value.end), value});
      return;
    }
    if (there) erase_lines(header ? member->value.begin : member->place, end_of(member->value));
    if (!value.empty()) fresh_ += fmt::format("{} = {}{}", key, value, newline_of(text_));
  }

  // Inserts after the last line of the table itself, before its sub-tables with headers.
  void insert(const Value& table) {
    if (fresh_.empty()) return;
    text::Place last = table.begin;
    for (const auto& member : table.members) {
      const bool header = member.value.kind == Value::Kind::table && !member.value.in_line;
      if (!header) last = std::max(last, end_of(member.value));
    }
    const std::size_t place = next_line(text_, at(last));
    const bool ends = place > 0 && text_[place - 1] == '\n';
    changes_.push_back({place, place, (ends ? "" : std::string(newline_of(text_))) + fresh_});
  }

  std::string_view text_;
  ObjectRef object_;
  const Note& before_;
  const Note& note_;
  std::vector<Change> changes_;
  std::string fresh_;
};

// The last one counts, as when the file is read.
const Member* table_of_object(const Value& root, ObjectRef object) noexcept {
  const Member* found = nullptr;
  for (const auto& member : root.members) {
    const bool is_it = od::parse_object(member.key) == object && member.value.kind == Value::Kind::table;
    if (is_it) found = &member;
  }
  return found;
}

// Everything else in the file is still there, unchanged.
bool others_stay(const Value& before, const Value& after, ObjectRef object) {
  const auto others = [&](const Value& root) {
    std::vector<const Member*> all;
    for (const auto& member : root.members) {
      if (od::parse_object(member.key) != object) all.push_back(&member);
    }
    return all;
  };
  return std::ranges::equal(others(before), others(after), [](const Member* a, const Member* b) {
    return a->key == b->key && text::same(a->value, b->value);
  });
}

std::string by_hand(const std::string& file, const std::string& why) {
  return fmt::format("{}: {}; nothing was written: edit the file by hand", file, why);
}

}  // namespace

Checked<std::string> with_note(std::string_view text, const std::string& file, ObjectRef object, const Note& note) {
  Findings findings;
  const auto root = text::parse_toml(text, file, findings);
  if (!root) return tl::unexpected(to_string(findings.front()) + "; nothing was written");
  const auto before = read_notes(text, file);
  const Member* const member = table_of_object(*root, object);
  if (member == nullptr && note.empty()) {
    return tl::unexpected(fmt::format("{} has no note of {}", file, od::write_object(object)));
  }
  const auto held = before.notes.find(object);
  const Note none;
  std::string made = Edit(text, object, held == before.notes.end() ? none : held->second, note).run(member);
  if (made.size() > longest_notes) {
    return tl::unexpected(by_hand(file, fmt::format("it would have more than {} bytes", longest_notes)));
  }
  Notes expected = before.notes;
  expected.erase(object);
  if (!note.empty()) expected[object] = note;
  Findings more;
  const auto again = text::parse_toml(made, file, more);
  const auto after = read_notes(made, file);
  const bool good = again && after.notes == expected && after.findings.size() <= before.findings.size() &&
                    others_stay(*root, *again, object);
  if (good) return made;
  return tl::unexpected(
      by_hand(file, fmt::format("the note of {} cannot be changed there without changing others, or would not be read "
                                "back as it is",
                                od::write_object(object))));
}

Checked<void> write_note(const std::string& file, ObjectRef object, const Note& note) {
  if (was_read(file)) return tl::unexpected(file + " is a file that Berth reads as something else: no notes go there");
  std::string problem;
  const std::string before = notes_text(file, problem);
  if (!problem.empty()) return tl::unexpected(problem + "; nothing was written");
  auto made = with_note(before, file, object, note);
  if (!made) return tl::unexpected(made.error());
  PartFile part(file);
  part.keep_permissions();
  int error = part.write(*made);
  if (error == 0) error = part.replace();
  if (error == 0) return {};
  return tl::unexpected(fmt::format("{}: {}; the notes are unchanged", file, std::strerror(error)));
}

}  // namespace berth::command

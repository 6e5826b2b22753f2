// Changes of single keys. They are kept apart from the text and inserted when the text is asked for.
#include <algorithm>

#include "berth/eds/lines_parts.hpp"
#include "berth/eds/text.hpp"
#include "berth/eds/write.hpp"

namespace berth::eds {
namespace {

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + ('a' - 'A')) : c;
  return out;
}

bool fits_a_name(std::string_view name) noexcept {
  return !name.empty() && fits_a_line(name) && name.find_first_of("=[]#") == std::string_view::npos;
}

/// The lines of a text, found from any place in it.
class Lines {
 public:
  explicit Lines(std::string_view text) : text_(text) {}

  [[nodiscard]] std::size_t begin(std::size_t at) const noexcept {
    const std::size_t found = at == 0 ? std::string_view::npos : text_.find_last_of("\r\n", at - 1);
    const std::size_t start = found == std::string_view::npos ? 0 : found + 1;
    return start == 0 && text_.starts_with("\xEF\xBB\xBF") ? 3 : start;
  }
  /// After the line's end.
  [[nodiscard]] std::size_t next(std::size_t at) const noexcept {
    const std::size_t found = text_.find_first_of("\r\n", at);
    if (found == std::string_view::npos) return text_.size();
    return text_.substr(found).starts_with("\r\n") ? found + 2 : found + 1;
  }
  /// How the line at `at` ends. If it has no end, the first line's counts; if there is none, LF.
  [[nodiscard]] std::string_view end_of(std::size_t at) const noexcept {
    for (const std::size_t from : {at, std::size_t{0}}) {
      const std::size_t found = text_.find_first_of("\r\n", from);
      if (found != std::string_view::npos) return text_.substr(found, next(from) - found);
    }
    return "\n";
  }
  [[nodiscard]] bool ended(std::size_t at) const noexcept { return at == 0 || line_break(text_[at - 1]); }

 private:
  std::string_view text_;
};

}  // namespace

Editor::Editor(const Document& document) : document_(document), encoding_(document.encoding()) {
  const auto sections = document.sections();
  for (std::uint32_t i = 0; i < sections.size(); ++i)
    sections_[lower(document.utf8(document.name(sections[i])))].push_back(i);
}

std::optional<std::uint32_t> Editor::last(std::string_view section) const {
  const auto found = sections_.find(lower(section));
  if (found == sections_.end()) return std::nullopt;
  for (auto at = found->second.rbegin(); at != found->second.rend(); ++at) {
    const auto place = places_.find(*at);
    if (place == places_.end() || !place->second.removed) return *at;
  }
  return std::nullopt;
}

bool Editor::is(const Entry& entry, std::string_view key) const {
  const std::string_view raw = document_.key(entry);
  return document_.encoding() == Encoding::windows_1252 ? same_word(document_.utf8(raw), key) : same_word(raw, key);
}

std::string Editor::in_file(std::string_view name) const {
  return encoding_ == Encoding::windows_1252 ? to_windows_1252(name).value_or("") : std::string(name);
}

const Editor::Fresh* Editor::fresh(std::string_view section) const {
  const auto found =
      std::ranges::find_if(fresh_, [section](const Fresh& each) { return same_word(each.name, section); });
  return found == fresh_.end() ? nullptr : &*found;
}
Editor::Fresh* Editor::fresh(std::string_view section) {
  const auto found =
      std::ranges::find_if(fresh_, [section](const Fresh& each) { return same_word(each.name, section); });
  return found == fresh_.end() ? nullptr : &*found;
}

Result<std::string> Editor::encoded(std::string_view text) {
  const Encoding of_text = encoding_of(text);
  if (of_text == Encoding::ascii) return std::string(text);
  if (of_text == Encoding::windows_1252) return fail(Errc::invalid, "the text is not UTF-8");
  if (encoding_ == Encoding::windows_1252) {
    auto made = to_windows_1252(text);
    if (!made) return fail(Errc::invalid, "the file's Windows-1252 does not have one of the characters");
    return std::move(*made);
  }
  encoding_ = Encoding::utf8;
  return std::string(text);
}

Result<void> Editor::set(std::string_view section, std::string_view key, std::string_view value) {
  auto bytes = encoded(value);
  if (!bytes) return fail(bytes.error());
  return put(section, key, *bytes);
}

Result<void> Editor::set_raw(std::string_view section, std::string_view key, std::string_view value) {
  const Encoding of_value = encoding_of(value);
  if (encoding_ == Encoding::ascii) encoding_ = of_value;
  if (of_value == Encoding::windows_1252 && encoding_ == Encoding::utf8) {
    return fail(Errc::invalid, "the file is UTF-8 and these bytes are not");
  }
  return put(section, key, value);
}

Result<void> Editor::put(std::string_view section, std::string_view key, std::string_view value) {
  if (!fits_a_line(value)) return fail(Errc::invalid, "a line of an EDS cannot carry this value");
  if (!fits_a_name(key) || key.front() == ';') return fail(Errc::invalid, "this cannot be a key");
  if (const auto name = encoded(key); !name) return fail(name.error());
  const auto place = last(section);
  if (!place) {
    if (const auto added = add_section(section); !added) return added;
    std::vector<Line>& lines = fresh(section)->lines;
    const auto found = std::ranges::find_if(lines, [&](const Line& each) { return same_word(each.key, key); });
    if (found == lines.end()) {
      lines.push_back({std::string(key), std::string(value)});
    } else {
      found->value = value;
    }
    return {};
  }
  Place& changes = places_[*place];
  const auto entries = document_.entries(document_.sections()[*place]);
  for (std::size_t i = entries.size(); i-- > 0;) {
    if (!is(entries[i], key)) continue;
    const auto position = static_cast<std::uint32_t>(i);
    const auto changed = changes.changed.find(position);
    if (changed != changes.changed.end() && !changed->second) continue;  // removed before
    if (document_.value(entries[i]) == value) {
      changes.changed.erase(position);
    } else {
      changes.changed.insert_or_assign(position, std::string(value));
    }
    return {};
  }
  const auto found = std::ranges::find_if(changes.added, [&](const Line& each) { return same_word(each.key, key); });
  if (found == changes.added.end()) {
    changes.added.push_back({std::string(key), std::string(value)});
  } else {
    found->value = value;
  }
  return {};
}

Result<void> Editor::add_section(std::string_view name, std::string_view after) {
  if (has_section(name)) return {};
  if (!fits_a_name(name)) return fail(Errc::invalid, "this cannot be a section's name");
  if (const auto bytes = encoded(name); !bytes) return fail(bytes.error());
  const auto sections = static_cast<std::uint32_t>(document_.sections().size());
  const Fresh* const other = after.empty() ? nullptr : fresh(after);
  const std::uint32_t behind = other != nullptr ? other->after : last(after).value_or(sections);
  Fresh made{std::string(name), behind, {}};
  if (other != nullptr) {
    fresh_.insert(fresh_.begin() + (other - fresh_.data()) + 1, std::move(made));
  } else {
    fresh_.push_back(std::move(made));
  }
  return {};
}

void Editor::remove(std::string_view section, std::string_view key) {
  if (Fresh* const added = fresh(section)) {
    std::erase_if(added->lines, [key](const Line& each) { return same_word(each.key, key); });
  }
  const auto found = sections_.find(lower(section));
  if (found == sections_.end()) return;
  for (const std::uint32_t position : found->second) {
    const auto entries = document_.entries(document_.sections()[position]);
    for (std::uint32_t i = 0; i < entries.size(); ++i) {
      if (is(entries[i], key)) places_[position].changed.insert_or_assign(i, std::nullopt);
    }
    const auto place = places_.find(position);
    if (place == places_.end()) continue;
    std::erase_if(place->second.added, [key](const Line& each) { return same_word(each.key, key); });
  }
}

void Editor::remove_section(std::string_view section) {
  std::erase_if(fresh_, [section](const Fresh& each) { return same_word(each.name, section); });
  const auto found = sections_.find(lower(section));
  if (found == sections_.end()) return;
  for (const std::uint32_t position : found->second) places_[position].removed = true;
}

std::optional<std::string> Editor::value(std::string_view section, std::string_view key) const {
  const auto in = [&](const std::vector<Line>& lines) -> std::optional<std::string> {
    const auto line = std::ranges::find_if(lines, [key](const Line& each) { return same_word(each.key, key); });
    if (line == lines.end()) return std::nullopt;
    return document_.utf8(line->value);
  };
  const auto position = last(section);
  if (!position) {
    const Fresh* const added = fresh(section);
    return added == nullptr ? std::nullopt : in(added->lines);
  }
  const auto place = places_.find(*position);
  if (place != places_.end()) {
    if (auto added = in(place->second.added)) return added;
  }
  const auto entries = document_.entries(document_.sections()[*position]);
  for (std::size_t i = entries.size(); i-- > 0;) {
    if (!is(entries[i], key)) continue;
    if (place == places_.end()) return document_.utf8(document_.value(entries[i]));
    const auto changed = place->second.changed.find(static_cast<std::uint32_t>(i));
    if (changed == place->second.changed.end()) return document_.utf8(document_.value(entries[i]));
    if (changed->second) return document_.utf8(*changed->second);
  }
  return std::nullopt;
}

bool Editor::has_section(std::string_view section) const { return last(section) || fresh(section) != nullptr; }

namespace {

/// Replaces parts of a text, which come in ascending order and do not overlap.
class Weaver {
 public:
  explicit Weaver(std::string_view text) : text_(text) {}
  void replace(std::size_t begin, std::size_t end, std::string_view with) {
    if (begin > done_) out_.append(text_.substr(done_, begin - done_));
    out_.append(with);
    done_ = std::max(done_, end);
  }
  void insert(std::size_t at, std::string_view what) { replace(at, at, what); }
  /// Ends the last line, so that another line can follow.
  void end_line(std::size_t at, std::string_view line_end) {
    insert(at, "");
    if (!empty() && !line_break(out_.back())) out_.append(line_end);
  }
  /// The text so far is empty but for a byte order mark.
  [[nodiscard]] bool empty() const noexcept { return out_.empty() || out_ == "\xEF\xBB\xBF"; }
  std::string finish() {
    replace(text_.size(), text_.size(), "");
    return std::move(out_);
  }

 private:
  std::string_view text_;
  std::size_t done_ = 0;
  std::string out_;
};

}  // namespace

std::string Editor::text() const {
  const std::string_view text = document_.text();
  const Lines lines(text);
  Weaver weaver(text);
  const auto sections = document_.sections();
  const auto put = [&](std::size_t at, std::string_view line_end, const std::vector<Line>& added) {
    if (added.empty()) return;
    weaver.end_line(at, line_end);
    for (const Line& each : added) weaver.insert(at, in_file(each.key) + "=" + each.value + std::string(line_end));
  };
  const auto put_fresh = [&](std::size_t at, std::uint32_t after) {
    for (const Fresh& each : fresh_) {
      if (each.after != after) continue;
      const std::string_view line_end = lines.end_of(at == 0 ? 0 : at - 1);
      weaver.end_line(at, line_end);
      if (!weaver.empty()) weaver.insert(at, line_end);
      weaver.insert(at, "[" + in_file(each.name) + "]" + std::string(line_end));
      put(at, line_end, each.lines);
    }
  };
  for (std::uint32_t position = 0; position < sections.size(); ++position) {
    const Section& section = sections[position];
    const auto entries = document_.entries(section);
    const std::size_t last_at = entries.empty() ? section.name_at : entries.back().key_at;
    const std::size_t end = lines.next(last_at);
    const auto place = places_.find(position);
    if (place != places_.end() && place->second.removed) {
      weaver.replace(lines.begin(section.name_at), end, "");
    } else if (place != places_.end()) {
      for (const auto& [i, value] : place->second.changed) {
        const Entry& entry = entries[i];
        if (!value) {
          weaver.replace(lines.begin(entry.key_at), lines.next(entry.key_at), "");
          continue;
        }
        const std::size_t value_end = entry.value_at + entry.value_length;
        // An empty value may touch the comment after it.
        const bool comment = value_end < text.size() && text[value_end] == ';';
        weaver.replace(entry.value_at, value_end, comment && !value->empty() ? *value + " " : *value);
      }
      put(end, lines.end_of(last_at), place->second.added);
    }
    put_fresh(end, position);
  }
  put_fresh(text.size(), static_cast<std::uint32_t>(sections.size()));
  return weaver.finish();
}

}  // namespace berth::eds

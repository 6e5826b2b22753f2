#include "berth/eds/document.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <tuple>

#include "berth/eds/lines_parts.hpp"

namespace berth::eds {
namespace {

using Severity = Finding::Severity;

/// The characters 80h..9Fh of Windows-1252; the five that are not defined keep their numbers.
constexpr std::array<std::uint16_t, 32> windows_1252{0x20AC, 0x81,   0x201A, 0x0192, 0x201E, 0x2026, 0x2020, 0x2021,
                                                     0x02C6, 0x2030, 0x0160, 0x2039, 0x0152, 0x8D,   0x017D, 0x8F,
                                                     0x90,   0x2018, 0x2019, 0x201C, 0x201D, 0x2022, 0x2013, 0x2014,
                                                     0x02DC, 0x2122, 0x0161, 0x203A, 0x0153, 0x9D,   0x017E, 0x0178};

void append_utf8(std::string& out, std::uint32_t point) {
  const auto push = [&out](std::uint32_t byte) { out.push_back(static_cast<char>(byte)); };
  if (point < 0x80) {
    push(point);
  } else if (point < 0x800) {
    push(0xC0 | (point >> 6U));
    push(0x80 | (point & 0x3FU));
  } else {
    push(0xE0 | (point >> 12U));
    push(0x80 | ((point >> 6U) & 0x3FU));
    push(0x80 | (point & 0x3FU));
  }
}

}  // namespace

std::size_t utf8_sequence(std::string_view text, std::size_t at) noexcept {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<std::uint8_t>(text[i]) : 0U; };
  const auto lead = byte(at);
  const std::size_t length = lead < 0x80                   ? 1
                             : lead >= 0xC2 && lead < 0xE0 ? 2
                             : lead >= 0xE0 && lead < 0xF0 ? 3
                             : lead >= 0xF0 && lead < 0xF5 ? 4
                                                           : 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xC0U) != 0x80) return 0;
  }
  return length;
}

Encoding encoding_of(std::string_view text) noexcept {
  std::size_t at = 0;
  bool only_ascii = true;
  while (at < text.size()) {
    std::uint64_t eight = 0;
    if (at + 8 <= text.size()) {
      std::memcpy(&eight, text.data() + at, 8);
      if ((eight & 0x8080'8080'8080'8080ULL) == 0) {
        at += 8;
        continue;
      }
    }
    const std::size_t length = utf8_sequence(text, at);
    if (length == 0) return Encoding::windows_1252;
    only_ascii = only_ascii && length == 1;
    at += length;
  }
  return only_ascii ? Encoding::ascii : Encoding::utf8;
}

std::optional<std::string> to_windows_1252(std::string_view utf8) {
  std::string out;
  out.reserve(utf8.size());
  for (std::size_t at = 0; at < utf8.size();) {
    const std::size_t length = utf8_sequence(utf8, at);
    if (length == 0 || length > 3) return std::nullopt;
    const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(utf8[at + i]); };
    std::uint32_t point = byte(0);
    if (length == 2) point = (point & 0x1FU) << 6U | (byte(1) & 0x3FU);
    if (length == 3) point = (point & 0x0FU) << 12U | (byte(1) & 0x3FU) << 6U | (byte(2) & 0x3FU);
    at += length;
    const auto* const found = std::ranges::find(windows_1252, point);
    if (found != windows_1252.end()) point = 0x80U + static_cast<std::uint32_t>(found - windows_1252.begin());
    if (found == windows_1252.end() && (point > 0xFF || (point >= 0x80 && point < 0xA0))) return std::nullopt;
    out.push_back(static_cast<char>(point));
  }
  return out;
}

void Report::add(Severity severity, std::uint32_t line, std::uint32_t column, std::string key, std::string message,
                 std::string fix) {
  const bool first_error = severity == Severity::error && !error_;
  error_ = error_ || severity == Severity::error;
  // The first error is always reported: it is the reason why the file is refused.
  if (findings_.size() >= most_ && !first_error) {
    ++dropped_;
    return;
  }
  findings_.push_back({severity, file_, static_cast<int>(line), static_cast<int>(column), std::move(key),
                       std::move(message), std::move(fix)});
}

Findings Report::take() {
  std::ranges::sort(findings_, {},
                    [](const Finding& each) { return std::tie(each.line, each.column, each.key, each.message); });
  const auto rest = std::ranges::unique(findings_);
  findings_.erase(rest.begin(), rest.end());
  if (dropped_ != 0) {
    findings_.push_back({Severity::note, file_, 0, 0, "", fmt::format("{} more findings are not shown", dropped_), ""});
  }
  return std::move(findings_);
}

/// Reads the text once, line by line.
class LineReader {
 public:
  LineReader(Document& document, Report& report) : document_(document), report_(report), text_(document.text_) {}

  void run() {
    std::size_t at = 0;
    if (text_.substr(0, 3) == "\xEF\xBB\xBF") at = 3;
    while (at < text_.size()) at = physical_line(at);
    close_section();
    tell_once(lone_cr_, "a lone CR ends the line", "use LF or CRLF");
    tell_once(hash_, "a comment begins with #", "use ; in column 1");
    tell_once(inline_comment_, "a comment follows a value; it is left out", "put comments on lines of their own");
    tell_once(nul_, "the text contains NUL bytes; they are read as blanks", "");
    tell_once(long_line_, "the line is longer than 255 characters", "");
  }

 private:
  /// An LF ends a line; a CR inside one (not at its end) ends a line, too.
  std::size_t physical_line(std::size_t begin) {
    const std::size_t found = text_.find('\n', begin);
    const std::size_t next = found == std::string_view::npos ? text_.size() : found + 1;
    std::size_t end = found == std::string_view::npos ? text_.size() : found;
    if (end > begin && text_[end - 1] == '\r') --end;
    for (;;) {
      const std::size_t cr = text_.substr(begin, end - begin).find('\r');
      ++line_;
      if (cr == std::string_view::npos) break;
      if (lone_cr_ == 0) lone_cr_ = line_;
      logical_line(begin, begin + cr);
      begin += cr + 1;
    }
    logical_line(begin, end);
    return next;
  }

  void logical_line(std::size_t begin, std::size_t end) {
    if (end - begin > longest_line && long_line_ == 0) long_line_ = line_;
    trim(begin, end);
    if (begin == end) return;
    const char first = text_[begin];
    if (first == ';') return;
    if (first == '#') {
      if (hash_ == 0) hash_ = line_;
      return;
    }
    if (first == '[') {
      section(begin, end);
    } else {
      entry(begin, end);
    }
  }

  void trim(std::size_t& begin, std::size_t& end) {
    while (begin < end && blank(text_[begin])) see_nul(begin++);
    while (begin < end && blank(text_[end - 1])) see_nul(--end);
  }
  void see_nul(std::size_t at) {
    if (text_[at] == '\0' && nul_ == 0) nul_ = line_;
  }

  void section(std::size_t begin, std::size_t end) {
    close_section();
    const std::size_t bracket = text_.substr(begin, end - begin).rfind(']');
    std::size_t name_begin = begin + 1;
    std::size_t name_end = bracket == std::string_view::npos ? end : begin + text_.substr(begin, end - begin).find(']');
    if (bracket == std::string_view::npos) {
      warn(begin, std::string(text_.substr(begin, std::min<std::size_t>(end - begin, 40))),
           "the section's ] is missing", "write [name]");
    } else {
      std::size_t rest = name_end + 1;
      std::size_t rest_end = end;
      trim(rest, rest_end);
      if (rest < rest_end && text_[rest] != ';') warn(rest, "", "text after the section's name is left out", "");
    }
    trim(name_begin, name_end);
    open_ = true;
    document_.sections_.push_back(
        {u32(name_begin), u32(name_end - name_begin), line_, u32(document_.entries_.size()), 0});
  }

  void entry(std::size_t begin, std::size_t end) {
    const std::size_t equals = text_.substr(begin, end - begin).find('=');
    if (equals == std::string_view::npos) {
      warn(begin, std::string(text_.substr(begin, std::min<std::size_t>(end - begin, 40))),
           "neither a section nor key=value; the line is left out", "begin comments with ;");
      return;
    }
    std::size_t key_end = begin + equals;
    std::size_t key_begin = begin;
    trim(key_begin, key_end);
    if (key_begin == key_end) {
      warn(begin, "", "no key before =; the line is left out", "");
      return;
    }
    if (!open_) {
      warn(begin, std::string(text_.substr(key_begin, key_end - key_begin)),
           "is before the first section; the line is left out", "");
      return;
    }
    std::size_t value_begin = begin + equals + 1;
    std::size_t value_end = without_comment(value_begin, end);
    trim(value_begin, value_end);
    document_.entries_.push_back(
        {u32(key_begin), u32(key_end - key_begin), u32(value_begin), u32(value_end - value_begin), line_});
  }

  /// A ; after a blank, or in place of the value, begins a comment; inside a word it is text.
  std::size_t without_comment(std::size_t begin, std::size_t end) {
    const std::string_view line = text_.substr(0, end);
    for (std::size_t at = line.find(';', begin); at != std::string_view::npos; at = line.find(';', at + 1)) {
      if (at != begin && !blank(line[at - 1])) continue;
      if (inline_comment_ == 0) inline_comment_ = line_;
      return at;
    }
    return end;
  }

  void close_section() {
    if (document_.sections_.empty()) return;
    Section& last = document_.sections_.back();
    last.count = u32(document_.entries_.size()) - last.first;
  }

  void warn(std::size_t at, std::string key, std::string message, std::string fix) {
    report_.add(Severity::warning, line_, document_.column(u32(at)), std::move(key), std::move(message),
                std::move(fix));
  }
  void tell_once(std::uint32_t line, const char* message, const char* fix) {
    if (line != 0) report_.add(Severity::note, line, 1, "", message, fix);
  }
  static std::uint32_t u32(std::size_t value) noexcept { return static_cast<std::uint32_t>(value); }

  Document& document_;
  Report& report_;
  std::string_view text_;
  std::uint32_t line_ = 0;
  bool open_ = false;
  // The line where each of these was seen first; 0 = never.
  std::uint32_t lone_cr_ = 0;
  std::uint32_t hash_ = 0;
  std::uint32_t inline_comment_ = 0;
  std::uint32_t nul_ = 0;
  std::uint32_t long_line_ = 0;
};

Document Document::parse(std::string text, Report& report) {
  Document document;
  document.text_ = std::move(text);
  const std::string_view start = std::string_view(document.text_).substr(0, 2);
  if (start == "\xFF\xFE" || start == "\xFE\xFF") {
    report.add(Severity::error, 1, 1, "", "the file is UTF-16", "save it as UTF-8");
    return document;
  }
  document.encoding_ = encoding_of(document.text_);
  if (document.encoding_ == Encoding::windows_1252) {
    report.add(Severity::note, 0, 0, "", "the text is not UTF-8; read as Windows-1252", "save it as UTF-8");
  }
  document.entries_.reserve(document.text_.size() / 24);
  document.sections_.reserve(document.text_.size() / 160);
  LineReader(document, report).run();
  return document;
}

const Section* Document::find(std::string_view section) const noexcept {
  for (auto at = sections_.rbegin(); at != sections_.rend(); ++at) {
    if (same_word(name(*at), section)) return &*at;
  }
  return nullptr;
}

const Entry* Document::find(const Section& section, std::string_view wanted) const noexcept {
  const auto all = entries(section);
  for (auto at = all.rbegin(); at != all.rend(); ++at) {
    if (same_word(key(*at), wanted)) return &*at;
  }
  return nullptr;
}

std::uint32_t Document::column(std::uint32_t at) const noexcept {
  const std::string_view before = std::string_view(text_).substr(0, at);
  const std::size_t line_end = before.find_last_of("\r\n");
  std::size_t begin = line_end == std::string_view::npos ? 0 : line_end + 1;
  if (begin == 0 && before.starts_with("\xEF\xBB\xBF")) begin = 3;
  return at - static_cast<std::uint32_t>(begin) + 1;
}

std::string Document::utf8(std::string_view raw) const {
  if (encoding_ != Encoding::windows_1252) return std::string(raw);
  std::string out;
  out.reserve(raw.size() + raw.size() / 8);
  for (const char c : raw) {
    const auto byte = static_cast<std::uint8_t>(c);
    append_utf8(out, byte >= 0x80 && byte < 0xA0 ? windows_1252[byte - 0x80U] : byte);
  }
  return out;
}

std::optional<std::string> Document::encoded(std::string_view text) const {
  if (encoding_ == Encoding::windows_1252) return to_windows_1252(text);
  if (encoding_of(text) == Encoding::windows_1252) return std::nullopt;
  return std::string(text);
}

}  // namespace berth::eds

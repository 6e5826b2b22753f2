/// The text of an EDS or DCF (CiA 306 §4.2) as sections and `key=value` lines, each with its place in the text. The
/// text itself is kept byte for byte: later changes are inserted at these places, so comments, order and line ends
/// stay. `eds::read` interprets the keys.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/base/words.hpp"

namespace berth::eds {

/// One `key=value` line. Offsets are into `Document::text()`; the value is trimmed and without an inline comment.
struct Entry {
  std::uint32_t key_at = 0;
  std::uint32_t key_length = 0;
  std::uint32_t value_at = 0;
  std::uint32_t value_length = 0;
  std::uint32_t line = 0;  ///< from 1
};

/// One `[name]` line and the entries up to the next one.
struct Section {
  std::uint32_t name_at = 0;
  std::uint32_t name_length = 0;
  std::uint32_t line = 0;
  std::uint32_t first = 0;  ///< position of its first entry
  std::uint32_t count = 0;
};

/// Collects remarks about one file; stops collecting (and reports that) when a hostile file causes too many.
class Report {
 public:
  Report(std::string file, std::size_t most) : file_(std::move(file)), most_(most) {}
  void add(Finding::Severity severity, std::uint32_t line, std::uint32_t column, std::string key, std::string message,
           std::string fix = {});
  [[nodiscard]] bool has_error() const noexcept { return error_; }
  /// In the order of the file's lines.
  [[nodiscard]] Findings take();

 private:
  std::string file_;
  std::size_t most_;
  std::size_t dropped_ = 0;
  bool error_ = false;
  Findings findings_;
};

enum class Encoding : std::uint8_t { ascii, utf8, windows_1252 };

class Document {
 public:
  Document() = default;
  /// Never fails: lines that do not belong in an EDS are reported and skipped. Accepted silently: UTF-8 BOM, CRLF,
  /// blanks around `=` and at line ends, `;` comments, no newline at the end. Accepted with a note: lone CR as line
  /// end, `#` comments, `;` comments after a value, Windows-1252 text, NUL bytes, over-long lines.
  [[nodiscard]] static Document parse(std::string text, Report& report);

  [[nodiscard]] const std::string& text() const noexcept { return text_; }
  [[nodiscard]] Encoding encoding() const noexcept { return encoding_; }
  /// In file order; a repeated section is there twice.
  [[nodiscard]] std::span<const Section> sections() const noexcept { return sections_; }
  [[nodiscard]] std::span<const Entry> entries() const noexcept { return entries_; }
  [[nodiscard]] std::span<const Entry> entries(const Section& section) const noexcept {
    return std::span(entries_).subspan(section.first, section.count);
  }
  [[nodiscard]] std::string_view name(const Section& section) const noexcept {
    return view(section.name_at, section.name_length);
  }
  [[nodiscard]] std::string_view key(const Entry& entry) const noexcept { return view(entry.key_at, entry.key_length); }
  [[nodiscard]] std::string_view value(const Entry& entry) const noexcept {
    return view(entry.value_at, entry.value_length);
  }
  /// The last section of this name and the last entry of this key in it; ignores case. Linear.
  [[nodiscard]] const Section* find(std::string_view section) const noexcept;
  [[nodiscard]] const Entry* find(const Section& section, std::string_view key) const noexcept;
  /// Column from 1, in bytes, of an offset into the text.
  [[nodiscard]] std::uint32_t column(std::uint32_t at) const noexcept;
  /// Text of the file as UTF-8, whatever the file's encoding.
  [[nodiscard]] std::string utf8(std::string_view raw) const;
  /// The reverse: UTF-8 text in this file's encoding; empty when its Windows-1252 lacks a character, or for bytes that
  /// are not UTF-8.
  [[nodiscard]] std::optional<std::string> encoded(std::string_view text) const;

 private:
  friend class LineReader;
  [[nodiscard]] std::string_view view(std::uint32_t at, std::uint32_t length) const noexcept {
    return std::string_view(text_).substr(at, length);
  }
  std::string text_;
  std::vector<Section> sections_;
  std::vector<Entry> entries_;
  Encoding encoding_ = Encoding::ascii;
};

/// The encoding of a text: if it is not UTF-8, it counts as Windows-1252.
[[nodiscard]] Encoding encoding_of(std::string_view text) noexcept;
[[nodiscard]] std::optional<std::string> to_windows_1252(std::string_view utf8);

/// Length of the UTF-8 sequence at `at`; 0 when there is none.
[[nodiscard]] std::size_t utf8_sequence(std::string_view text, std::size_t at) noexcept;

}  // namespace berth::eds

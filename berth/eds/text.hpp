/// Shared by the writers of EDS, DCF and CPJ: lines that can be read back unchanged. Internal to room `eds`.
#pragma once

#include <fmt/format.h>

#include <string>
#include <string_view>

#include "berth/base/finding.hpp"
#include "berth/eds/document.hpp"

namespace berth::eds {

/// False for blanks at the ends, line breaks and a `;` that begins a comment: reading would lose them.
[[nodiscard]] bool fits_a_line(std::string_view value) noexcept;
/// The nearest text that fits a line.
[[nodiscard]] std::string fitted(std::string_view value);

/// Builds a file's text, section by section.
class TextBuilder {
 public:
  TextBuilder(std::string_view line_end, Encoding encoding) : line_end_(line_end), encoding_(encoding) {}

  void section(std::string_view name);
  /// UTF-8, written in the file's encoding. Unsupported characters are replaced and reported.
  void text(std::string_view key, std::string_view value);
  /// Unchanged bytes (VISIBLE_STRING).
  void raw(std::string_view key, std::string_view value);
  /// ASCII made by the writer, which needs no check.
  void plain(std::string_view key, std::string_view value);
  void flag(std::string_view key, bool value) { plain(key, value ? "1" : "0"); }
  void number(std::string_view key, std::uint64_t value) { plain(key, std::to_string(value)); }
  void tell(std::string_view key, std::string message, Finding::Severity severity = Finding::Severity::warning);

  [[nodiscard]] std::string take_text() { return std::move(text_); }
  [[nodiscard]] Findings take_findings() { return std::move(findings_); }

 private:
  std::string text_;
  std::string section_;
  std::string_view line_end_;
  Encoding encoding_;
  Findings findings_;
};

}  // namespace berth::eds

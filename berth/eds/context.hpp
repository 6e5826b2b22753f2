/// Shared by the readers of the single sections: the document, the report, and functions that read a number or a text
/// from an entry. Internal to room `eds`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "berth/eds/document.hpp"
#include "berth/od/data_type.hpp"

namespace berth::eds {

class Context {
 public:
  using Severity = Finding::Severity;

  Context(const Document& document, Report& report) : document_(document), report_(report) {}

  [[nodiscard]] const Document& document() const noexcept { return document_; }
  [[nodiscard]] Report& report() noexcept { return report_; }

  /// A remark about an entry (`at`: offset into its value), or about the section when `entry` is null.
  void tell(Severity severity, const Section& section, const Entry* entry, std::string message, std::string fix = {},
            std::size_t at = 0);
  void warn(const Section& section, const Entry* entry, std::string message, std::string fix = {}) {
    tell(Severity::warning, section, entry, std::move(message), std::move(fix));
  }

  /// The value's text; "" for a null entry: a missing key and an empty value mean the same (CiA 306 §4.3).
  [[nodiscard]] std::string_view raw(const Entry* entry) const noexcept {
    return entry == nullptr ? std::string_view{} : document_.value(*entry);
  }
  [[nodiscard]] std::string text(const Entry* entry) const { return document_.utf8(raw(entry)); }
  /// A number from 0 to `most`; empty if missing, or if unreadable, which is reported with `severity`.
  [[nodiscard]] std::optional<std::uint64_t> number(const Section& section, const Entry* entry, std::uint64_t most,
                                                    Severity severity);
  /// A number that means yes or no; anything but 0 and 1 is reported and counts as yes.
  [[nodiscard]] bool flag(const Section& section, const Entry* entry);
  /// Reports oddities of a value that could be read.
  void tell_notes(const Section& section, const Entry& entry, od::Notes notes, od::DataType type);

 private:
  const Document& document_;
  Report& report_;
};

/// A key that is a plain number ("12", as in object lists), or empty.
[[nodiscard]] std::optional<std::uint32_t> number_key(std::string_view key) noexcept;

/// A file's bytes, at most `max_bytes` plus one; or why it cannot be read.
[[nodiscard]] tl::expected<std::string, std::string> read_text_file(const std::filesystem::path& path,
                                                                    std::size_t max_bytes);

}  // namespace berth::eds

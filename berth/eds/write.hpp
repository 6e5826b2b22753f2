/// Writes EDS and DCF (CiA 306): changes an existing file without touching the rest of it, or makes a new one.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/base/result.hpp"
#include "berth/eds/file.hpp"

namespace berth::eds {

/// Changes single keys of a text and leaves every other byte unchanged: comments, order, line ends, encoding, unknown
/// sections. Names are found regardless of case. Texts are passed as UTF-8 and are written in the file's encoding.
/// encoding.
/// If a section is repeated, the last one counts and is changed. Errors (`Errc::invalid`): a value that a line cannot
/// contain (line breaks, blanks at its ends, a `;` that would begin a comment), a name with `=`, `[`, `]`, and a
/// character that the file's Windows-1252 lacks. Nothing is changed then.
class Editor {
 public:
  /// `document` must outlive the editor.
  explicit Editor(const Document& document);

  /// Sets the key's value. A new key goes below the section's last one; a new section to the end of the file.
  [[nodiscard]] Result<void> set(std::string_view section, std::string_view key, std::string_view value);
  /// The same with bytes in the file's encoding.
  [[nodiscard]] Result<void> set_raw(std::string_view section, std::string_view key, std::string_view value);
  /// A new, empty section after `after` (its last one), or at the end. Does nothing if it exists.
  [[nodiscard]] Result<void> add_section(std::string_view name, std::string_view after = {});
  /// Removes the key's line, wherever it occurs; does nothing if there is none.
  void remove(std::string_view section, std::string_view key);
  /// Removes a section and its lines, wherever it occurs. Comments below its last key stay.
  void remove_section(std::string_view section);

  /// The value as read from the changed text; empty when there is no such key.
  [[nodiscard]] std::optional<std::string> value(std::string_view section, std::string_view key) const;
  [[nodiscard]] bool has_section(std::string_view section) const;
  /// The text with all changes.
  [[nodiscard]] std::string text() const;

 private:
  struct Line {
    std::string key;    ///< as UTF-8
    std::string value;  ///< in the file's encoding
  };
  struct Place {
    std::map<std::uint32_t, std::optional<std::string>> changed;  ///< by position of the entry; empty = removed
    std::vector<Line> added;
    bool removed = false;
  };
  struct Fresh {
    std::string name;         ///< as UTF-8
    std::uint32_t after = 0;  ///< position of the section before it
    std::vector<Line> lines;
  };
  [[nodiscard]] std::optional<std::uint32_t> last(std::string_view section) const;
  [[nodiscard]] Fresh* fresh(std::string_view section);
  [[nodiscard]] const Fresh* fresh(std::string_view section) const;
  [[nodiscard]] bool is(const Entry& entry, std::string_view key) const;
  [[nodiscard]] std::string in_file(std::string_view name) const;
  [[nodiscard]] Result<std::string> encoded(std::string_view text);
  [[nodiscard]] Result<void> put(std::string_view section, std::string_view key, std::string_view value);

  const Document& document_;
  Encoding encoding_;                                                        ///< of the text with the changes so far
  std::map<std::string, std::vector<std::uint32_t>, std::less<>> sections_;  ///< positions by lower-case name
  std::map<std::uint32_t, Place> places_;
  std::vector<Fresh> fresh_;
};

enum class Form : std::uint8_t { eds, dcf };

struct WriteOptions {
  Form form = Form::eds;  ///< eds: without values, commissioning and file references
  std::string_view line_end = "\r\n";
};

struct Written {
  std::string text;
  /// Warnings: parts that the format cannot express, and what was written instead. Notes: lines beyond 255 characters;
  /// DataTypes of RECORDs. A finding with a line but without a file refers to the file that was read.
  Findings findings;
};

/// Writes a whole file from `file`, ignoring `file.document`. EDSVersion 4.0 if none is given; all mandatory keys;
/// lists and sections ascending. Reading it back gives an equal `file`, except for: names of VAR objects (a VAR has one
/// name, that of its value), the capacity of strings, an empty string as default (the same as none).
[[nodiscard]] Written write(const File& file, const WriteOptions& options = {});

/// A value's text: `$NODEID+0x180`, decimal or `hex` numbers, else as `od::print`.
[[nodiscard]] std::string text_of(const od::Literal& value, od::DataType type, bool hex);
/// True for objects whose numbers are usually read in hex: COB-IDs, mapping entries, identities, device types.
[[nodiscard]] bool usually_hex(ObjectRef object, od::DataType type) noexcept;

}  // namespace berth::eds

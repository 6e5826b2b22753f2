/// Notes about objects, for users: an object's meaning, its unit and scale, names of its values and bits. The most
/// common objects of CiA 301, 302, 401 and 402 have built-in notes. Units and names of values in a description
/// (od::Meaning, of an XDD) take precedence over these, and a file beside the description, `drive.notes` beside
/// `drive.eds`, over both. Each field of a note is taken separately: a file that gives the unit leaves the names of
/// values as they are. The file is TOML (notes_edit.hpp writes it):
///
///     ["6041h"]
///     text   = "State of the drive"
///     bits   = { 0 = "ready to switch on", 3 = "fault" }
///     ["2001h:02"]
///     unit   = "°C"
///     scale  = 0.1
///     values = { 0 = "off", 0x7FFF = "sensor broken" }
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "berth/base/finding.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/reply.hpp"
#include "berth/decode/value_words.hpp"

namespace berth::command {

struct Note {
  std::string text;                              ///< for users, one line
  std::string unit;                              ///< "°C"; empty: not known
  double scale = 1;                              ///< units per count
  std::map<std::int64_t, std::string> values{};  ///< names of values
  std::map<unsigned, std::string> bits{};        ///< names of bits, 0 to 63
  [[nodiscard]] bool empty() const noexcept { return text.empty() && unit.empty() && values.empty() && bits.empty(); }
  friend bool operator==(const Note&, const Note&) = default;
};
using Notes = std::map<ObjectRef, Note>;

/// Built in. `profile`: the device profile, lower word of 1000h; 0: none. Empty: there is no note.
[[nodiscard]] Note standard_note(std::uint16_t profile, ObjectRef object);

struct NotesRead {
  Notes notes;
  Findings findings;  ///< errors: what could not be read; the other notes are present
};
[[nodiscard]] NotesRead read_notes(std::string_view text, const std::string& file);
inline constexpr std::size_t longest_notes = std::size_t{1} << 20U;  ///< bytes of a file

/// The file's text. Empty: there is no such file; or it cannot be read, is no plain file or is too long, which
/// `problem` then says.
[[nodiscard]] std::string notes_text(const std::string& file, std::string& problem);

/// "eds/drive.notes".
[[nodiscard]] std::string notes_file(const std::string& description);

/// "12", "0x7FFF", "-1": a number in the form used by a file of notes.
[[nodiscard]] std::optional<std::int64_t> note_number(std::string_view text);

/// The notes of one device: its file's, then its description's, then the built-in ones.
class NoteBook {
 public:
  /// `description`: null: not known; `file`: the one it was read from, or empty.
  NoteBook(std::shared_ptr<const od::Description> description, const std::string& file);
  NoteBook(const design::Machine& machine, const NodeArgument& node);
  [[nodiscard]] Note of(ObjectRef object) const;
  /// The file's note alone; empty: none.
  [[nodiscard]] Note own(ObjectRef object) const;
  /// The object for printing values: without the description's unit and names if the file has others.
  [[nodiscard]] KnownObject shown(const KnownObject& object) const;
  /// Empty: the file has no errors, or there is none.
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }
  /// Empty: the device has no description file, so that there is no place for one.
  [[nodiscard]] const std::string& file() const noexcept { return file_; }

 private:
  std::shared_ptr<const od::Description> description_;
  std::uint16_t profile_ = 0;
  std::string file_;
  std::string problem_;
  Notes notes_;
};

/// The notes of one device for readers of a trace. For one thread: lookups are cached.
class NoteWords final : public decode::ValueWords {
 public:
  explicit NoteWords(NoteBook book) : book_(std::move(book)) {}
  [[nodiscard]] bool knows(ObjectRef object) const override { return !note(object).empty(); }
  [[nodiscard]] std::string words(ObjectRef object, od::DataType type,
                                  std::span<const std::uint8_t> bytes) const override;

 private:
  [[nodiscard]] const Note& note(ObjectRef object) const;
  NoteBook book_;
  mutable std::map<ObjectRef, Note> found_;
};

/// {"text", "unit", "scale", "values", "bits"}, as far as it has them.
[[nodiscard]] Json note_json(const Note& note);
/// Adds "note", and from it "quantity" and "meaning", unless `put_value` added them.
void put_note(Json& json, const Note& note, od::DataType type, std::span<const std::uint8_t> bytes);
/// What the note adds to `value_text`: " = ready to switch on, fault", " = 23.5 °C"; empty: nothing for this value.
[[nodiscard]] std::string note_text(const Note& note, const KnownObject& object, std::span<const std::uint8_t> bytes);
/// Its unit and the names of values of this type, in the form of a description.
[[nodiscard]] od::Meaning meaning_of(const Note& note, od::DataType type);
/// One line: "Temperature, 0.1 °C; 0 = off, 32767 = sensor broken; bit 3 = fault".
[[nodiscard]] std::string line_of(const Note& note);

}  // namespace berth::command

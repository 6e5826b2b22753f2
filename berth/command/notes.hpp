/// Notes about objects, for people: what an object is, its unit and scale, names of its values and bits. The most usual
/// objects of CiA 301, 302, 401 and 402 have one built in; a file beside a description, `drive.notes` beside
/// `drive.eds`, adds others and counts first. The file is TOML:
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

namespace berth::command {

struct Note {
  std::string text;                              ///< for people, one line
  std::string unit;                              ///< "°C"; empty: not known
  double scale = 1;                              ///< one count is so many units
  std::map<std::int64_t, std::string> values{};  ///< names of values
  std::map<unsigned, std::string> bits{};        ///< names of bits, 0 to 63
  [[nodiscard]] bool empty() const noexcept { return text.empty() && unit.empty() && values.empty() && bits.empty(); }
  friend bool operator==(const Note&, const Note&) = default;
};
using Notes = std::map<ObjectRef, Note>;

/// Built in. `profile`: the device profile, lower word of 1000h; 0: none. Empty: there is none.
[[nodiscard]] Note standard_note(std::uint16_t profile, ObjectRef object);

struct NotesRead {
  Notes notes;
  Findings findings;  ///< errors: what could not be read; the other notes are there
};
[[nodiscard]] NotesRead read_notes(std::string_view text, const std::string& file);
inline constexpr std::size_t longest_notes = std::size_t{1} << 20U;  ///< bytes of a file

/// "eds/drive.notes".
[[nodiscard]] std::string notes_file(const std::string& description);

/// The notes of one device: its file's, else those that are built in.
class NoteBook {
 public:
  NoteBook(const design::Machine& machine, const NodeArgument& node);
  [[nodiscard]] Note of(ObjectRef object) const;
  /// Empty: nothing is wrong with the file, or there is none.
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }
  /// Empty: the device has no description that one could stand beside.
  [[nodiscard]] const std::string& file() const noexcept { return file_; }

 private:
  std::uint16_t profile_ = 0;
  std::string file_;
  std::string problem_;
  Notes notes_;
};

/// Adds "note" ({"text", "unit", "scale", "values", "bits"}), and what it makes of the value: "quantity", "meaning",
/// where the description says none.
void put_note(Json& json, const Note& note, od::DataType type, std::span<const std::uint8_t> bytes);
/// " = ready to switch on, fault", " = 23.5 °C"; empty: it says nothing of this value.
[[nodiscard]] std::string note_text(const Note& note, od::DataType type, std::span<const std::uint8_t> bytes);

}  // namespace berth::command

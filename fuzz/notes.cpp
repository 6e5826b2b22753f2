// A file of notes: the reader ends with notes or findings, and a note that is written into it is read again, with the
// others as they were.
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "berth/command/notes_edit.hpp"

namespace notes_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  using command::Note;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto read = command::read_notes(text, "fuzz.notes");
  for (const auto& finding : read.findings) (void)to_string(finding);
  for (const auto& [object, note] : read.notes) {
    if (note.empty() || !(note.scale > 0)) std::abort();
    (void)command::line_of(note);
    for (const auto type : {od::DataType::unsigned8, od::DataType::integer64}) (void)command::meaning_of(note, type);
  }
  const ObjectRef object = read.notes.empty() ? ObjectRef{0x2001, 2} : read.notes.begin()->first;
  const Note fresh{.text = "a \"note\"", .unit = "°C", .scale = 0.1, .values = {{-1, "x"}}, .bits = {{63, "y"}}};
  const auto made = command::with_note(text, "fuzz.notes", object, fresh);
  if (!made) return 0;
  auto expected = read.notes;
  expected[object] = fresh;
  if (command::read_notes(*made, "fuzz.notes").notes != expected) std::abort();
  const auto gone = command::with_note(*made, "fuzz.notes", object, {});
  expected.erase(object);
  if (gone && command::read_notes(*gone, "fuzz.notes").notes != expected) std::abort();
  return 0;
}

}  // namespace notes_target

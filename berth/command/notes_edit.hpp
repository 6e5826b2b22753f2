/// Changes to a file of notes (notes.hpp) as text. The file is a person's: other notes, comments, order and line ends
/// stay. After each change the text is read again, and is refused when it does not give what it should.
#pragma once

#include <string>
#include <string_view>

#include "berth/command/arguments.hpp"
#include "berth/command/notes.hpp"

namespace berth::command {

/// The text with `note` as that of `object`, in place of the one that it has, else at its end; an empty note: without
/// any. Keys of a note that stay as they are, and what stands after them, are not touched. `file`: for messages. What
/// is wrong is for people.
[[nodiscard]] Checked<std::string> with_note(std::string_view text, const std::string& file, ObjectRef object,
                                             const Note& note);

/// Reads the file, changes it, and puts the new one in its place whole; a file without any note left stays, empty or
/// with what else stands in it. A process that dies meanwhile leaves `FILE.PID.part`. What is wrong is for people, and
/// then the file is as it was.
[[nodiscard]] Checked<void> write_note(const std::string& file, ObjectRef object, const Note& note);

}  // namespace berth::command

/// Changes to a file of notes (notes.hpp) as text. The file belongs to a user: other notes, comments, order and line
/// ends stay. After each change the text is read again, and the change is refused if the result is not as intended.
#pragma once

#include <string>
#include <string_view>

#include "berth/command/arguments.hpp"
#include "berth/command/notes.hpp"

namespace berth::command {

/// The text with `note` for `object`, in place of its present one, else at the end; an empty note removes it. Unchanged
/// keys of a note, and what follows them, are not touched. `file`: for messages. Errors are for users.
[[nodiscard]] Checked<std::string> with_note(std::string_view text, const std::string& file, ObjectRef object,
                                             const Note& note);

/// Reads the file, changes it, and replaces it as a whole; a file without notes stays, empty or with its other content.
/// A process that dies meanwhile leaves `FILE.PID.part`. Errors are for users; then the file is unchanged.
[[nodiscard]] Checked<void> write_note(const std::string& file, ObjectRef object, const Note& note);

}  // namespace berth::command

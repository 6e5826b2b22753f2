// `berth note`: what is known of an object, and the user's notes about it.
#include <memory>

#include "request_verb.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

// No bus is needed, and nothing is sent.
constexpr RequestWords of_notes{
    .up = false, .alone = false, .machine = {.confirms = false, .sends = false, .stores = false}};

using Words = std::vector<std::string>;

struct NoteWords {
  std::string object;
  Words values;
  Words bits;
};

void note_verb(const Verb& note, Options& options, const std::string& name, const std::string& examples) {
  const auto words = std::make_shared<NoteWords>();
  const RequestVerb verb(
      note, options, name, "note " + name,
      [words](command::Request& request) {
        request.arguments["object"] = words->object;
        if (!words->values.empty()) request.arguments["values"] = one_a_line(words->values);
        if (!words->bits.empty()) request.arguments["bits"] = one_a_line(words->bits);
        return std::string();
      },
      of_notes);
  verb.verb().word("object", words->object, "2001h:02, 0x2001:2, or its name").required().shown("OBJECT");
  if (name == "write") {
    verb.verb()
        .word("--value", words->values, "name of a value: 3=fault; \"3=\" takes it away")
        .one_each()
        .shown("N=NAME");
    verb.verb().word("--bit", words->bits, "name of a bit, 0 to 63").one_each().shown("N=NAME");
  }
  verb.footer(examples);
}

}  // namespace

void add_note(Verb& berth, Options& options) {
  const Verb note = berth.group("note", "notes of objects: text, unit, scale, names of values and bits");
  note.footer(
      "Examples:\n"
      "  berth note read drive 6041h machine.toml\n"
      "  berth help note write\n"
      "docs/commands.md says where notes are stored and which commands show them.");
  note_verb(note, options, "read", "Example:\n  berth note read drive 6041h machine.toml");
  note_verb(note, options, "write",
            "Examples:\n  berth note write drive 2001h:02 --text Bearing --unit °C --scale 0.1\n"
            "  berth note write drive 2002h --value 0=off --value 1=on --bit 7=fault");
  note_verb(note, options, "remove", "Example:\n  berth note remove drive 2001h:02");
}

}  // namespace berth::cli

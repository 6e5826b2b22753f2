// note read, note write, note remove: what is known of an object, and the user's note about it in the file beside the
// description. No device is asked.
#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "berth/command/notes_edit.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/command/stored.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

/// The arguments of a request, resolved.
struct NoteArguments {
  NodeArgument node;
  std::string bus;          ///< the node's bus
  std::string description;  ///< file of the node's description; empty: its slot has none, or it is in no slot
  KnownObject object;
};

// `arguments` keeps the problem, if there is one.
std::optional<NoteArguments> note_arguments(Arguments& arguments, const design::Machine& machine) {
  NoteArguments wanted;
  wanted.node = node_argument(arguments, machine);
  const std::string word = arguments.required("object");
  if (!arguments.good()) return std::nullopt;
  const auto bus = known_bus_of(machine, wanted.node);
  const auto object = find_object(wanted.node.description.get(), word);
  if (!bus || !object) {
    arguments.wrong(bus ? object.error() : bus.error());
    return std::nullopt;
  }
  wanted.bus = (*bus)->name;
  wanted.object = *object;
  const auto* const slot = machine.slot(wanted.bus, wanted.node.node);
  if (slot != nullptr) wanted.description = slot->eds_path;
  return wanted;
}

constexpr std::size_t longest_text = 1000;

// Accepts only text that one line of a page or a terminal can show.
Checked<std::string> word_of(const std::string& what, const std::string& text) {
  if (text.size() > longest_text) {
    return tl::unexpected(fmt::format("{} has more than {} bytes: a note is one sentence", what, longest_text));
  }
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7F) {
      return tl::unexpected(fmt::format("{} {} has a control character: a note is one line", what, text::quoted(text)));
    }
  }
  return text;
}

Checked<double> scale_of(const std::string& text) {
  std::size_t end = 0;
  double scale = 0;
  try {
    scale = std::stod(text, &end);
  } catch (const std::exception&) {
    end = 0;
  }
  if (end != 0 && end == text.size() && std::isfinite(scale) && scale > 0) return scale;
  return tl::unexpected(
      fmt::format("scale {} is not a number greater than 0; it is the value of one count in the unit, such as 0.1",
                  text::quoted(text)));
}

// Takes number and name from "3=fault"; an empty name removes the number.
template <class Map>
Checked<void> take_names(const std::string& what, const std::string& lines, std::int64_t low, std::int64_t high,
                         Map& into) {
  for (const std::string& line : lines_of(lines)) {
    if (line.empty()) continue;
    const auto equals = line.find('=');
    const auto number = equals == std::string::npos ? std::nullopt : note_number(line.substr(0, equals));
    if (!number || *number < low || *number > high) {
      const std::string range = high == 63 ? ", with a number from 0 to 63" : ", with a number such as 3, 0x10 or -1";
      return tl::unexpected(fmt::format("{} {} is not N=NAME{}", what, text::quoted(line), range));
    }
    const auto name = word_of(what, line.substr(equals + 1));
    if (!name) return tl::unexpected(name.error());
    const auto key = static_cast<typename Map::key_type>(*number);
    if (name->empty()) {
      into.erase(key);
    } else {
      into[key] = *name;
    }
  }
  return {};
}

// `note` with the request's changes.
Checked<Note> changed(Note note, const Arguments& arguments) {
  if (arguments.has("anew")) note = {};
  for (const auto& [key, into] : {std::pair("text", &note.text), std::pair("unit", &note.unit)}) {
    if (!arguments.has(key)) continue;
    auto word = word_of(key, arguments.text(key));
    if (!word) return tl::unexpected(word.error());
    *into = std::move(*word);
  }
  if (arguments.has("scale")) {
    const auto scale = scale_of(arguments.text("scale"));
    if (!scale) return tl::unexpected(scale.error());
    note.scale = *scale;
  }
  constexpr auto any = std::numeric_limits<std::int64_t>{};
  auto good = take_names("value", arguments.text("values"), any.min(), any.max(), note.values);
  if (good) good = take_names("bit", arguments.text("bits"), 0, 63, note.bits);
  if (!good) return tl::unexpected(good.error());
  if (note.unit.empty() && arguments.has("scale")) {
    return tl::unexpected(std::string("a scale needs a unit, such as unit = °C"));
  }
  if (note.unit.empty()) note.scale = 1;
  if (note.empty())
    return tl::unexpected(std::string("the note would be empty: give a text, a unit or names, or remove it"));
  return note;
}

void tell(const NoteArguments& wanted, const NoteBook& book, bool wrote, Reply& reply) {
  const KnownObject& object = wanted.object;
  const Note note = book.of(object.ref);
  const Note own = book.own(object.ref);
  Json json{{"bus", wanted.bus}, {"node", wanted.node.node.value()}};
  if (!wanted.node.gateways.empty()) json["path"] = wanted.node.text();
  json["index"] = hex(object.ref.index, 4);
  json["sub"] = object.ref.sub;
  json["name"] = object.name;
  if (!book.file().empty()) json["file"] = book.file();
  if (!note.empty()) json["note"] = note_json(note);
  if (!own.empty()) json["own"] = note_json(own);
  if (!book.problem().empty()) json["problem"] = book.problem();
  std::vector<std::string> lines;
  const std::string what = note.empty() ? "nothing is noted" : line_of(note);
  lines.push_back(fmt::format("{}  {}: {}", od::write_object(object.ref), object.name, what));
  if (wrote) lines.push_back(fmt::format("wrote {}", book.file()));
  if (!wrote && !own.empty()) lines.push_back(fmt::format("{} says: {}", book.file(), line_of(own)));
  if (!book.problem().empty()) lines.push_back(book.problem());
  give(reply, json, std::move(lines));
}

void write(const NoteArguments& wanted, const Note& note, Reply& reply) {
  const auto written = write_note(notes_file(wanted.description), wanted.object.ref, note);
  if (!written) return refuse(reply, 3, written.error());
  tell(wanted, NoteBook(wanted.node.description, wanted.description), true, reply);
}

}  // namespace

void tell_note(const design::Machine& machine, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const auto wanted = note_arguments(arguments, machine);
  if (!wanted) return refuse(reply, 2, arguments.problem());
  const NoteBook book(wanted->node.description, wanted->description);
  if (request.verb == "note read") return tell(*wanted, book, false, reply);
  if (book.file().empty()) {
    return refuse(
        reply, 1,
        fmt::format("node {} has no description, and notes are stored beside the description", wanted->node.text()),
        "give its slot one: eds = \"drive.eds\"");
  }
  if (request.verb == "note remove") return write(*wanted, Note(), reply);
  const auto note = changed(book.own(wanted->object.ref), arguments);
  if (!note) return refuse(reply, 2, note.error());
  write(*wanted, *note, reply);
}

rt::Task<void> note_command(Session& session, const Request& request, Reply& reply) {
  tell_note(session.machine(), request, reply);
  co_return;
}

}  // namespace berth::command

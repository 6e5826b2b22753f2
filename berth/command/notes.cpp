#include "berth/command/notes.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <system_error>

#include "berth/command/values.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/toml.hpp"

namespace berth::command {
namespace {

namespace fs = std::filesystem;
constexpr std::size_t longest_word = 1000;

// "12", "0x7FFF", "-1".
std::optional<std::int64_t> number_of(std::string_view text) {
  const bool negative = text.starts_with('-');
  if (negative) text.remove_prefix(1);
  const bool is_hex = text.starts_with("0x") || text.starts_with("0X");
  if (is_hex) text.remove_prefix(2);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, is_hex ? 16 : 10);
  if (text.empty() || error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return negative ? -value : value;
}

/// One table of the file.
class Reader {
 public:
  Reader(const text::Value& value, const std::string& path, const std::string& file, Findings& findings)
      : table_(value, path, file, findings) {}

  Note read() {
    Note note;
    note.text = word("text");
    note.unit = word("unit");
    scale(note);
    each("values", [&](std::int64_t number, const std::string& name) { note.values[number] = name; });
    each("bits", [&](std::int64_t number, const std::string& name) {
      if (number < 0 || number > 63) return table_.error("bits", "bits have the numbers 0 to 63", "");
      note.bits[static_cast<unsigned>(number)] = name;
    });
    table_.finish();
    return note;
  }

 private:
  std::string word(std::string_view key) {
    auto text = table_.string(key).value_or(std::string());
    if (text.size() <= longest_word) return text;
    table_.error(key, fmt::format("has more than {} bytes", longest_word), "a note is one sentence");
    return {};
  }

  void scale(Note& note) {
    const auto* const value = table_.get("scale");
    if (value == nullptr) return;
    using Kind = text::Value::Kind;
    const double scale = value->kind == Kind::real      ? value->real
                         : value->kind == Kind::integer ? static_cast<double>(value->integer)
                                                        : 0;
    if (std::isfinite(scale) && scale > 0) {
      note.scale = scale;
    } else {
      table_.error("scale", "is a number greater than 0", "one count is so many units: scale = 0.1");
    }
  }

  template <class Take>
  void each(std::string_view key, Take take) {
    const auto* const value = table_.get(key);
    if (value == nullptr) return;
    if (value->kind != text::Value::Kind::table) return table_.error(key, "is a table", "write { 0 = \"off\" }");
    for (const auto& member : value->members) {
      const auto number = number_of(member.key);
      const bool good =
          number && member.value.kind == text::Value::Kind::string && member.value.string.size() <= longest_word;
      if (!good) {
        table_.error(key, fmt::format("{} names no number by a text", text::quoted(member.key)),
                     "write { 0 = \"off\", 0x10 = \"on\" }");
      } else {
        take(*number, member.value.string);
      }
    }
  }

  text::Table table_;
};

std::uint16_t profile_of(const od::Description* description) {
  const auto* const sub = description == nullptr ? nullptr : description->find(ObjectRef{0x1000, 0});
  return sub == nullptr ? std::uint16_t{0} : static_cast<std::uint16_t>(description->default_of(*sub).raw);
}

// Empty: there is none that could be read; a file that is too long, or is none, is a problem.
std::string contents_of(const std::string& path, std::string& problem) {
  std::error_code error;
  const auto size = fs::is_regular_file(path, error) ? fs::file_size(path, error) : 0;
  if (error || size == 0) return {};
  if (size > longest_notes) {
    problem = fmt::format("{}: a file of notes has at most {} bytes", path, longest_notes);
    return {};
  }
  std::ifstream in(path, std::ios::binary);
  std::string text((std::istreambuf_iterator<char>(in)), {});
  if (in.bad()) problem = path + ": it cannot be read";
  return text;
}

}  // namespace

NotesRead read_notes(std::string_view text, const std::string& file) {
  NotesRead read;
  const auto root = text::parse_toml(text, file, read.findings);
  if (!root) return read;
  for (const auto& member : root->members) {
    const auto object = od::parse_object(member.key);
    if (!object || member.value.kind != text::Value::Kind::table) {
      Finding finding;
      finding.file = file;
      finding.line = member.place.line;
      finding.column = member.place.column;
      finding.message = fmt::format("{} is no table of an object", text::quoted(member.key));
      finding.fix = "write [\"1017h\"] or [\"1018h:04\"]";
      read.findings.push_back(std::move(finding));
      continue;
    }
    auto note = Reader(member.value, member.key, file, read.findings).read();
    if (!note.empty()) read.notes[*object] = std::move(note);
  }
  return read;
}

std::string notes_file(const std::string& description) {
  return description.empty() ? std::string() : fs::path(description).replace_extension(".notes").string();
}

NoteBook::NoteBook(const design::Machine& machine, const NodeArgument& node)
    : profile_(profile_of(node.description.get())) {
  const auto* const bus = bus_of(machine, node);
  const auto* const slot = bus == nullptr ? nullptr : machine.slot(bus->name, node.node);
  if (slot == nullptr) return;
  file_ = notes_file(slot->eds_path);
  if (file_.empty()) return;
  auto read = read_notes(contents_of(file_, problem_), file_);
  notes_ = std::move(read.notes);
  if (has_errors(read.findings) && problem_.empty()) problem_ = to_string(read.findings.front());
}

Note NoteBook::of(ObjectRef object) const {
  const auto it = notes_.find(object);
  Note note = standard_note(profile_, object);
  if (it == notes_.end()) return note;
  const Note& own = it->second;
  if (!own.text.empty()) note.text = own.text;
  if (!own.unit.empty()) note.unit = own.unit, note.scale = own.scale;
  if (!own.values.empty()) note.values = own.values;
  if (!own.bits.empty()) note.bits = own.bits;
  return note;
}

// ---- what a note makes of a value ----

namespace {

std::string quantity_of(const Note& note, od::DataType type, std::span<const std::uint8_t> bytes) {
  if (note.unit.empty() || !od::is_integer(type)) return {};
  const std::uint64_t raw = od::load(type, bytes.data());
  const double count =
      od::is_signed(type) ? static_cast<double>(static_cast<std::int64_t>(raw)) : static_cast<double>(raw);
  return fmt::format("{:.10g} {}", count * note.scale, note.unit);
}

std::string meaning_of(const Note& note, od::DataType type, std::span<const std::uint8_t> bytes) {
  if (!od::is_integer(type)) return {};
  const std::uint64_t raw = od::load(type, bytes.data());
  const auto named = note.values.find(static_cast<std::int64_t>(raw));
  if (named != note.values.end()) return named->second;
  std::string names;
  for (const auto& [bit, name] : note.bits) {
    if ((raw >> bit & 1U) != 0) names += (names.empty() ? "" : ", ") + name;
  }
  return names;
}

template <class Map>
Json names_json(const Map& names) {
  Json json = Json::object();
  for (const auto& [number, name] : names) json[std::to_string(number)] = name;
  return json;
}

}  // namespace

void put_note(Json& json, const Note& note, od::DataType type, std::span<const std::uint8_t> bytes) {
  if (note.empty()) return;
  Json told = Json::object();
  if (!note.text.empty()) told["text"] = note.text;
  if (!note.unit.empty()) told["unit"] = note.unit, told["scale"] = note.scale;
  if (!note.values.empty()) told["values"] = names_json(note.values);
  if (!note.bits.empty()) told["bits"] = names_json(note.bits);
  json["note"] = std::move(told);
  if (type == od::DataType::none || !fits(type, bytes) || bytes.empty()) return;
  const std::string quantity = quantity_of(note, type, bytes);
  const std::string meaning = meaning_of(note, type, bytes);
  if (!quantity.empty() && !json.contains("quantity")) json["quantity"] = quantity;
  if (!meaning.empty() && !json.contains("meaning")) json["meaning"] = meaning;
}

std::string note_text(const Note& note, od::DataType type, std::span<const std::uint8_t> bytes) {
  if (note.empty() || type == od::DataType::none || !fits(type, bytes) || bytes.empty()) return {};
  const std::string meaning = meaning_of(note, type, bytes);
  // Times of communication objects have their unit already ("500 ms").
  const bool counts_time = note.unit == "ms" || note.unit == "µs";
  const std::string quantity = counts_time ? std::string() : quantity_of(note, type, bytes);
  return (quantity.empty() ? "" : " = " + quantity) + (meaning.empty() ? "" : " = " + meaning);
}

}  // namespace berth::command

#include "berth/command/notes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <system_error>

#include "berth/command/meanings.hpp"
#include "berth/command/values.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/toml.hpp"

namespace berth::command {
namespace {

namespace fs = std::filesystem;
constexpr std::size_t longest_word = 1000;

/// Reads one table of the file.
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
      table_.error("scale", "is a number greater than 0", "it is the value of one count in the unit: scale = 0.1");
    }
  }

  template <class Take>
  void each(std::string_view key, Take take) {
    const auto* const value = table_.get(key);
    if (value == nullptr) return;
    if (value->kind != text::Value::Kind::table) return table_.error(key, "is a table", "write { 0 = \"off\" }");
    for (const auto& member : value->members) {
      const auto number = note_number(member.key);
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

}  // namespace

std::optional<std::int64_t> note_number(std::string_view text) {
  const bool negative = text.starts_with('-');
  if (negative) text.remove_prefix(1);
  const bool is_hex = text.starts_with("0x") || text.starts_with("0X");
  if (is_hex) text.remove_prefix(2);
  const bool digits = !text.empty() && text.front() != '-';
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, is_hex ? 16 : 10);
  if (!digits || error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return negative ? -value : value;
}

std::string notes_text(const std::string& file, std::string& problem) {
  std::error_code error;
  const auto kind = fs::status(file, error).type();
  if (kind == fs::file_type::not_found) return {};
  if (kind != fs::file_type::regular) {
    problem = file + ": it is not a plain file, or the system does not let it be looked at";
    return {};
  }
  const auto size = fs::file_size(file, error);
  if (!error && size > longest_notes) {
    problem = fmt::format("{}: a file of notes has at most {} bytes", file, longest_notes);
    return {};
  }
  std::ifstream in(file, std::ios::binary);
  std::string text((std::istreambuf_iterator<char>(in)), {});
  if (error || !in.is_open() || in.bad()) problem = file + ": it cannot be read";
  return text;
}

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
      finding.message = fmt::format("{} is not a table of an object", text::quoted(member.key));
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

namespace {

// Empty: the node is in no slot, or its slot has no description.
std::string description_file(const design::Machine& machine, const NodeArgument& node) {
  const auto* const bus = bus_of(machine, node);
  const auto* const slot = bus == nullptr ? nullptr : machine.slot(bus->name, node.node);
  return slot == nullptr ? std::string() : slot->eds_path;
}

// What `over` says replaces what `note` says.
void lay_over(Note& note, const Note& over) {
  if (!over.text.empty()) note.text = over.text;
  if (!over.unit.empty()) note.unit = over.unit, note.scale = over.scale;
  if (!over.values.empty()) note.values = over.values;
  if (!over.bits.empty()) note.bits = over.bits;
}

Note note_of(const od::Meaning& meaning) {
  Note note;
  note.text = meaning.text;
  note.unit = meaning.unit;
  note.scale = static_cast<double>(meaning.number) * std::pow(10.0, meaning.exponent);
  for (const auto& value : meaning.values) {
    if (!value.name.empty()) note.values[static_cast<std::int64_t>(value.raw)] = value.name;
  }
  return note;
}

}  // namespace

NoteBook::NoteBook(std::shared_ptr<const od::Description> description, const std::string& file)
    : description_(std::move(description)), profile_(profile_of(description_.get())), file_(notes_file(file)) {
  if (file_.empty()) return;
  auto read = read_notes(notes_text(file_, problem_), file_);
  notes_ = std::move(read.notes);
  if (has_errors(read.findings) && problem_.empty()) problem_ = to_string(read.findings.front());
}

NoteBook::NoteBook(const design::Machine& machine, const NodeArgument& node)
    : NoteBook(node.description, description_file(machine, node)) {}

Note NoteBook::own(ObjectRef object) const {
  const auto it = notes_.find(object);
  return it == notes_.end() ? Note() : it->second;
}

Note NoteBook::of(ObjectRef object) const {
  Note note = standard_note(profile_, object);
  const auto* const meaning = description_ == nullptr ? nullptr : description_->meaning(object);
  if (meaning != nullptr) lay_over(note, note_of(*meaning));
  if (const auto it = notes_.find(object); it != notes_.end()) lay_over(note, it->second);
  return note;
}

KnownObject NoteBook::shown(const KnownObject& object) const {
  KnownObject made = object;
  const auto it = notes_.find(object.ref);
  if (it != notes_.end() && (!it->second.unit.empty() || !it->second.values.empty())) made.meaning = nullptr;
  return made;
}

// ---- a value, as its note explains it ----

namespace {

bool says_of(const Note& note, od::DataType type, std::span<const std::uint8_t> bytes) {
  return !note.empty() && type != od::DataType::none && fits(type, bytes) && !bytes.empty();
}

std::string quantity_of(const Note& note, od::DataType type, std::span<const std::uint8_t> bytes) {
  if (note.unit.empty()) return {};
  if (od::is_real(type))
    return fmt::format("{:.10g} {}", od::real_of(type, od::load(type, bytes.data())) * note.scale, note.unit);
  if (!od::is_integer(type)) return {};
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

template <class Map>
std::string names_text(const Map& names, const char* before) {
  std::string text;
  for (const auto& [number, name] : names)
    text += fmt::format("{}{}{} = {}", text.empty() ? "" : ", ", before, number, name);
  return text;
}

/// A scale as in a description: a whole number and a power of ten; empty: too large, too small, or too many digits.
std::optional<std::pair<std::int64_t, std::int8_t>> decimal_of(double scale) {
  const std::string text = fmt::format("{}", scale);  // the shortest text of this number: "0.1", "2.5e-05"
  const auto e = text.find('e');
  int exponent = e == std::string::npos ? 0 : std::stoi(text.substr(e + 1));
  std::string digits;
  bool behind_point = false;
  for (const char c : std::string_view(text).substr(0, e)) {
    if (c == '.') {
      behind_point = true;
      continue;
    }
    if (c != '0' || !digits.empty()) digits += c;
    if (behind_point) --exponent;
  }
  for (; digits.size() > 1 && digits.back() == '0'; ++exponent) digits.pop_back();
  if (digits.empty() || digits.size() > 17 || exponent < -18 || exponent > 18) return std::nullopt;
  return std::pair(std::stoll(digits), static_cast<std::int8_t>(exponent));
}

}  // namespace

Json note_json(const Note& note) {
  Json told = Json::object();
  if (!note.text.empty()) told["text"] = note.text;
  if (!note.unit.empty()) told["unit"] = note.unit, told["scale"] = note.scale;
  if (!note.values.empty()) told["values"] = names_json(note.values);
  if (!note.bits.empty()) told["bits"] = names_json(note.bits);
  return told;
}

void put_note(Json& json, const Note& note, od::DataType type, std::span<const std::uint8_t> bytes) {
  if (note.empty()) return;
  json["note"] = note_json(note);
  if (!says_of(note, type, bytes)) return;
  const std::string quantity = quantity_of(note, type, bytes);
  const std::string meaning = meaning_of(note, type, bytes);
  if (!quantity.empty() && !json.contains("quantity")) json["quantity"] = quantity;
  if (!meaning.empty() && !json.contains("meaning")) json["meaning"] = meaning;
}

std::string note_text(const Note& note, const KnownObject& object, std::span<const std::uint8_t> bytes) {
  if (!says_of(note, object.type, bytes)) return {};
  std::string text;
  // The value's text may have a unit already, as times of communication objects do ("500 ms").
  const bool has_quantity = !unit_text(object, bytes).empty() || !quantity_text(object, bytes).empty();
  const std::string quantity = has_quantity ? std::string() : quantity_of(note, object.type, bytes);
  const std::string meaning = value_name(object, bytes).empty() ? meaning_of(note, object.type, bytes) : std::string();
  if (!quantity.empty()) text += " = " + quantity;
  if (!meaning.empty()) text += " = " + meaning;
  return text;
}

od::Meaning meaning_of(const Note& note, od::DataType type) {
  od::Meaning meaning;
  const auto scale = decimal_of(note.scale);
  if (scale && !note.unit.empty()) {
    meaning.unit = note.unit;
    meaning.number = scale->first;
    meaning.exponent = scale->second;
  }
  if (!od::is_integer(type)) return meaning;
  for (const auto& [value, name] : note.values) {
    const auto raw = static_cast<std::uint64_t>(value);
    if (od::wrap(type, raw) == raw) meaning.values.push_back({raw, name});
  }
  std::ranges::sort(meaning.values, {}, &od::NamedValue::raw);
  return meaning;
}

std::string line_of(const Note& note) {
  std::string line = note.text;
  const auto add = [&line](const char* between, const std::string& more) {
    if (!more.empty()) line += (line.empty() ? "" : between) + more;
  };
  add(", ", note.scale == 1 || note.unit.empty() ? note.unit : fmt::format("{} {}", note.scale, note.unit));
  add("; ", names_text(note.values, ""));
  add("; ", names_text(note.bits, "bit "));
  return line;
}

const Note& NoteWords::note(ObjectRef object) const {
  const auto it = found_.find(object);
  return it != found_.end() ? it->second : found_.emplace(object, book_.of(object)).first->second;
}

std::string NoteWords::words(ObjectRef object, od::DataType type, std::span<const std::uint8_t> bytes) const {
  const Note& known = note(object);
  if (!says_of(known, type, bytes)) return {};
  std::string text = quantity_of(known, type, bytes);
  const std::string meaning = meaning_of(known, type, bytes);
  return text.empty() || meaning.empty() ? text + meaning : text + ", " + meaning;
}

}  // namespace berth::command

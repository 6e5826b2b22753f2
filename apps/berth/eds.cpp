// `berth eds check` and `berth eds show`.
#include "eds.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/command/meanings.hpp"
#include "berth/eds/cpj.hpp"
#include "berth/eds/review.hpp"
#include "berth/eds/write.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/od/names.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/file.hpp"
#include "berth/text/quantity.hpp"

namespace berth::cli {

using Json = nlohmann::ordered_json;
using Severity = Finding::Severity;

Described describe_file(const std::string& name) {
  Described file{name, {}, {}, {}};
  file.reading.file.description = od::DescriptionBuilder().build();
  auto text = text::read_file(name, file.reading.findings);
  if (!text) return file;
  file.text = *text;
  file.reading = eds::read_any(std::move(*text), name);
  const eds::File& read = file.reading.file;
  const bool configured = read.commissioning.has_value() || !read.parameters.empty();
  file.format = eds::is_xml(file.text) ? (configured ? "XDC" : "XDD") : (configured ? "DCF" : "EDS");
  return file;
}

Failure unusable(const Described& file) { return failure(file.reading.findings); }

namespace {

std::string json_text(const Json& json) { return json.dump(2, ' ', false, Json::error_handler_t::replace); }

const char* name(Severity severity) {
  return severity == Severity::error ? "error" : severity == Severity::warning ? "warning" : "note";
}

std::size_t count(const Findings& findings, Severity severity) {
  return static_cast<std::size_t>(std::ranges::count(findings, severity, &Finding::severity));
}

std::string plural(std::size_t number, const char* what) { return counted(number, what); }

// A file in one line: "EDS of Demo device (vendor 00000000h, product 00000001h), 47 objects".
std::string summary(const Described& file) {
  const eds::File& read = file.reading.file;
  const TypeCode type = read.type_code();
  return fmt::format("{} of {} (vendor {:08X}h, product {:08X}h), {}", file.format,
                     read.device.product_name.empty() ? "an unnamed device" : read.device.product_name, type.vendor,
                     type.product, plural(read.description->objects().size(), "object"));
}

Json json_of(const Finding& finding) {
  Json json;
  json["severity"] = name(finding.severity);
  json["line"] = finding.line;
  json["column"] = finding.column;
  json["key"] = finding.key;
  json["message"] = finding.message;
  if (!finding.fix.empty()) json["fix"] = finding.fix;
  return json;
}

// The findings of the reader and of the review, by line; if both report the same of one place, once.
Findings all_findings(const Described& file) {
  Findings findings = file.reading.findings;
  if (file.readable()) {
    const bool xml = eds::is_xml(file.text);
    const Findings more =
        eds::review(file.reading.file, file.name, xml ? std::string_view(file.text) : std::string_view{});
    findings.insert(findings.end(), more.begin(), more.end());
  }
  std::ranges::stable_sort(findings, {}, [](const Finding& each) { return std::pair(each.line, each.column); });
  return findings;
}

}  // namespace

namespace {

/// The result of `check` for one file.
struct Checked {
  std::string name;
  bool readable = false;
  std::string summary;  ///< the file in one line
  Json json;            ///< the summary as JSON
  Findings findings;
  std::vector<std::string> further;  ///< for a project: the files of its nodes
};

Checked check_description(const std::string& name) {
  const Described file = describe_file(name);
  Checked made{name, file.readable(), "no device description", {}, all_findings(file), {}};
  if (!made.readable) return made;
  made.summary = summary(file);
  made.json["format"] = file.format;
  made.json["objects"] = file.reading.file.description->objects().size();
  return made;
}

// Checks a nodelist project (CiA 306-3), and lists the DCF of each node that is present.
Checked check_project(const std::string& name) {
  const eds::ProjectReading reading = eds::read_cpj_file(name);
  Checked made{name, !reading.project.topologies.empty(), "no nodelist project", {}, reading.findings, {}};
  if (!made.readable) return made;
  std::size_t nodes = 0;
  for (const eds::Topology& topology : reading.project.topologies) {
    for (const eds::ProjectNode& node : topology.nodes) {
      if (!node.present) continue;
      ++nodes;
      const auto path = eds::dcf_path(name, topology, node);
      const auto say = [&](Severity severity, std::string message, std::string fix) {
        made.findings.push_back({severity, name, static_cast<int>(node.line), node.line == 0 ? 0 : 1,
                                 fmt::format("node {}", node.node_id), std::move(message), std::move(fix)});
      };
      if (path) {
        made.further.push_back(path->string());
      } else if (path.error().code == Errc::not_found) {
        say(Severity::note, "names no DCF", fmt::format("write Node{}DCFName=", node.node_id));
      } else {
        say(Severity::warning, fmt::format("{}: {}", text::quoted(node.dcf_name), path.error().text),
            "name a file in the project's folder");
      }
    }
  }
  made.summary =
      fmt::format("project of {} with {}", plural(reading.project.topologies.size(), "network"), plural(nodes, "node"));
  made.json["format"] = "CPJ";
  made.json["nodes"] = nodes;
  return made;
}

bool is_project(const std::string& name) {
  std::string extension = std::filesystem::path(name).extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".cpj";
}

void print_checked(const Checked& checked, const Findings& shown) {
  for (const Finding& finding : shown) print_line(to_string(finding));
  print_line(fmt::format("{}: {}: {}, {}, {}", checked.name, checked.summary,
                         plural(count(checked.findings, Severity::error), "error"),
                         plural(count(checked.findings, Severity::warning), "warning"),
                         plural(count(checked.findings, Severity::note), "note")));
}

}  // namespace

int run_eds_check(const Options& options, const EdsOptions& asked) {
  Json all;
  all["files"] = Json::array();
  int status = Exit::done;
  std::size_t errors = 0;
  std::size_t warnings = 0;
  std::vector<std::string> names = asked.files;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string name = names[i];
    const Checked checked = is_project(name) ? check_project(name) : check_description(name);
    names.insert(names.end(), checked.further.begin(), checked.further.end());
    const std::size_t bad = count(checked.findings, Severity::error);
    const std::size_t odd = count(checked.findings, Severity::warning);
    errors += bad;
    warnings += odd;
    const bool refused = bad != 0 || (asked.strict && odd != 0);
    status = std::max<int>(status, !checked.readable ? Exit::usage : refused ? Exit::no : Exit::done);
    Findings shown = checked.findings;
    if (asked.quiet) std::erase_if(shown, [](const Finding& each) { return each.severity == Severity::note; });
    if (!options.json) print_checked(checked, shown);
    Json json;
    json["file"] = name;
    json["readable"] = checked.readable;
    if (checked.json.is_object()) json.update(checked.json);
    json["errors"] = bad;
    json["warnings"] = odd;
    json["notes"] = count(checked.findings, Severity::note);
    json["findings"] = Json::array();
    for (const Finding& finding : shown) json["findings"].push_back(json_of(finding));
    all["files"].push_back(std::move(json));
  }
  if (options.json) {
    all["errors"] = errors;
    all["warnings"] = warnings;
    print_text(json_text(all));
  }
  return status;
}

// ---- show ----

namespace {

/// All that the file says about one value, as text; "" = nothing.
struct Row {
  ObjectRef ref;
  std::string name;
  std::string type;
  std::string access;
  std::string mapping;
  std::string value;    ///< the value that the file sets
  std::string initial;  ///< the default
  std::string low;
  std::string high;
};

const eds::Parameter* of(const std::vector<eds::Parameter>& list, ObjectRef ref) {
  const auto found = std::ranges::lower_bound(list, ref, {}, &eds::Parameter::object);
  return found == list.end() || found->object != ref ? nullptr : &*found;
}

Row row_of(const eds::File& file, std::uint16_t index, const od::SubObject& sub) {
  const ObjectRef ref{index, sub.sub};
  const auto text = [&](const od::Literal& literal) {
    return literal.present() ? eds::text_of(literal, sub.type, eds::usually_hex(ref, sub.type)) : std::string();
  };
  Row row{ref,
          std::string(file.description->name(sub)),
          std::string(od::name(sub.type)),
          std::string(od::name(sub.access)),
          sub.mappable ? "yes" : "no",
          {},
          {},
          {},
          {}};
  if (row.type.empty()) row.type = fmt::format("type {:04X}h", static_cast<unsigned>(sub.type));
  if (const auto* const set = of(file.parameters, ref)) {
    row.value = text(set->value);
    if (const auto* const given = of(file.defaults, ref)) row.initial = text(given->value);
  } else {
    row.initial = text(file.description->default_of(sub));
  }
  if (const auto* const limits = file.description->limits(sub)) {
    row.low = text(limits->low);
    row.high = text(limits->high);
  }
  return row;
}

Json json_of(const Row& row) {
  Json json;
  json["index"] = fmt::format("0x{:04X}", row.ref.index);
  json["sub"] = row.ref.sub;
  json["name"] = row.name;
  json["type"] = row.type;
  json["access"] = row.access;
  json["mappable"] = row.mapping == "yes";
  for (const auto& [key, text] : {std::pair("default", &row.initial), std::pair("value", &row.value),
                                  std::pair("low", &row.low), std::pair("high", &row.high)}) {
    if (!text->empty()) json[key] = *text;
  }
  return json;
}

// Cuts text to `width` characters as a terminal shows them: in UTF-8, one per lead byte.
std::string fitted_text(const std::string& text, std::size_t width) {
  std::string out;
  std::size_t used = 0;
  std::size_t at = 0;
  for (; at < text.size(); ++at) {
    const bool lead = (static_cast<unsigned char>(text[at]) & 0xC0U) != 0x80;
    if (lead && used == width) break;
    if (lead) ++used;
    out.push_back(static_cast<unsigned char>(text[at]) < 0x20 ? ' ' : text[at]);
  }
  if (at < text.size() && width > 1) {
    while (!out.empty() && (static_cast<unsigned char>(out.back()) & 0xC0U) == 0x80) out.pop_back();
    if (!out.empty()) out.back() = '~';
    used = width;
  }
  return out + std::string(width - std::min(width, used), ' ');
}

std::string value_column(const Row& row) { return row.value.empty() ? row.initial : row.value + " (set)"; }

void print_table(const eds::File& file) {
  const od::Description& description = *file.description;
  print_line(fmt::format("{:<9} {} {:<14} {:<6} {:<3} {}", "object", fitted_text("name", 36), "type", "access", "PDO",
                         "value"));
  for (const od::Object& object : description.objects()) {
    const auto subs = description.subs(object);
    const bool single = subs.size() == 1 && subs[0].sub == 0 && object.code == od::ObjectCode::var;
    if (!single) {
      print_line(fmt::format("{:04X}h     {} {}", object.index, fitted_text(std::string(description.name(object)), 36),
                             od::name(object.code)));
    }
    for (const od::SubObject& sub : subs) {
      const Row row = row_of(file, object.index, sub);
      const std::string where = single ? fmt::format("{:04X}h", object.index) : fmt::format("  :{:02X}", sub.sub);
      std::string line =
          fmt::format("{:<9} {} {:<14} {:<6} {:<3} {}", where, fitted_text((single ? "" : "  ") + row.name, 36),
                      row.type, row.access, row.mapping, value_column(row));
      while (line.ends_with(' ')) line.pop_back();
      print_line(line);
    }
  }
}

struct ShownObjects {
  std::vector<const od::Object*> objects;
  std::optional<std::uint8_t> sub;
  std::string problem;  // with the word itself; empty: there is no such object
};

std::string lower_word(std::string_view text) {
  std::string out(text);
  std::ranges::transform(out, out.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
}

// The objects with this part in their name, or in a sub-object's name.
std::vector<const od::Object*> named_like(const od::Description& description, const std::string& word) {
  std::vector<const od::Object*> found;
  for (const od::Object& object : description.objects()) {
    bool named = lower_word(description.name(object)).find(lower_word(word)) != std::string::npos;
    for (const od::SubObject& each : description.subs(object))
      named = named || lower_word(description.name(each)).find(lower_word(word)) != std::string::npos;
    if (named) found.push_back(&object);
  }
  return found;
}

ShownObjects wanted_objects(const eds::File& file, const std::string& word) {
  const od::Description& description = *file.description;
  const auto number = od::read_object(word);
  if (number) {
    const auto* const object = description.find(number->index);
    if (object == nullptr || (number->sub && description.find(*object, *number->sub) == nullptr)) return {};
    return {{object}, number->sub, {}};
  }
  if (number.error().kind == od::NoObject::Kind::bare) return {{}, {}, number.error().why};
  ShownObjects wanted{named_like(description, word), {}, {}};
  if (!wanted.objects.empty()) return wanted;
  const auto named = od::find_named(description, word);  // "Identity object/Serial number"
  if (named.size() == 1) return {{description.find(named.front().index)}, named.front().sub, {}};
  if (number.error().kind == od::NoObject::Kind::unmarked) {
    wanted.problem = number.error().why;
  }
  return wanted;
}

std::string number_text(std::uint64_t raw, od::DataType type) {
  std::vector<std::uint8_t> bytes(od::byte_size(type));
  od::store(type, raw, bytes.data());
  return od::print(type, bytes);
}

void print_meaning(const eds::File& file, ObjectRef ref, od::DataType type) {
  const od::Meaning* const meaning = file.description->meaning(ref);
  if (meaning == nullptr) return;
  if (!meaning->unit.empty()) print_line(fmt::format("    {:<12}{}", "unit", command::one_count(*meaning)));
  for (const auto& value : meaning->values) {
    print_line(fmt::format("    {:<12}{} = {}", meaning->only_these ? "allowed" : "named", number_text(value.raw, type),
                           value.name.empty() ? "(no name)" : value.name));
  }
}

void put_meaning(Json& json, const eds::File& file, ObjectRef ref, od::DataType type) {
  const od::Meaning* const meaning = file.description->meaning(ref);
  if (meaning == nullptr) return;
  if (!meaning->unit.empty()) json["unit"] = command::one_count(*meaning);
  if (meaning->values.empty()) return;
  json["only_these"] = meaning->only_these;
  for (const auto& value : meaning->values) {
    json["values"].push_back({{"value", number_text(value.raw, type)}, {"name", value.name}});
  }
}

void print_detail(const eds::File& file, const od::Object& object, std::optional<std::uint8_t> only) {
  print_line(fmt::format("{:04X}h  {}", object.index, file.description->name(object)));
  const std::string type = object.type == od::DataType::none ? "" : fmt::format(" of {}", od::name(object.type));
  print_line(
      fmt::format("  object type   {}{}", od::name(object.code), object.code == od::ObjectCode::var ? "" : type));
  for (const od::SubObject& sub : file.description->subs(object)) {
    if (only && sub.sub != *only) continue;
    const Row row = row_of(file, object.index, sub);
    print_line(fmt::format("  {}  {}", od::write_object(row.ref), row.name));
    const auto fact = [](const char* what, const std::string& text) {
      if (!text.empty()) print_line(fmt::format("    {:<12}{}", what, text));
    };
    fact("type", row.type);
    fact("access", row.access);
    fact("PDO mapping", row.mapping);
    fact("default", row.initial);
    fact("value", row.value);
    fact("low limit", row.low);
    fact("high limit", row.high);
    print_meaning(file, row.ref, sub.type);
    if ((sub.obj_flags & od::refuse_write_on_download) != 0) fact("flag", "not written by a configuration download");
    if ((sub.obj_flags & od::refuse_read_on_scan) != 0) fact("flag", "not read by a scan");
    for (const auto& denotation : file.denotations) {
      if (denotation.object == row.ref) fact("denotation", denotation.text);
    }
    for (const auto& reference : file.file_references) {
      if (reference.object == row.ref) fact(reference.download ? "download" : "upload", reference.name);
    }
  }
}

Json json_of(const eds::File& file, const od::Object& object, std::optional<std::uint8_t> only) {
  Json json;
  json["index"] = fmt::format("0x{:04X}", object.index);
  json["name"] = std::string(file.description->name(object));
  json["object_type"] = std::string(od::name(object.code));
  json["subs"] = Json::array();
  for (const od::SubObject& sub : file.description->subs(object)) {
    if (only && sub.sub != *only) continue;
    json["subs"].push_back(json_of(row_of(file, object.index, sub)));
    put_meaning(json["subs"].back(), file, {object.index, sub.sub}, sub.type);
  }
  return json;
}

}  // namespace

int run_eds_show(const Options& options, const EdsOptions& asked) {
  const Described file = describe_file(asked.files.at(0));
  if (!file.readable()) return tell(unusable(file), options.json);
  const eds::File& read = file.reading.file;
  const ShownObjects wanted = asked.object.empty() ? ShownObjects{} : wanted_objects(read, asked.object);
  if (!wanted.problem.empty()) {
    return tell(failure(Exit::usage, fmt::format("{}: {}", file.name, wanted.problem)), options.json);
  }
  if (!asked.object.empty() && wanted.objects.empty()) {
    return tell(failure(Exit::no, fmt::format("{}: there is no object {}; write an index such as 1018h or 1018h:01, or "
                                              "a part of a name",
                                              file.name, text::quoted(asked.object))),
                options.json);
  }
  if (options.json) {
    Json json;
    json["file"] = file.name;
    json["format"] = file.format;
    json["device"] = {{"vendor", read.device.vendor_name}, {"product", read.device.product_name}};
    json["vendor"] = fmt::format("0x{:08X}", read.type_code().vendor);
    json["product"] = fmt::format("0x{:08X}", read.type_code().product);
    json["objects"] = Json::array();
    if (asked.object.empty()) {
      for (const od::Object& object : read.description->objects()) json["objects"].push_back(json_of(read, object, {}));
    }
    for (const od::Object* const object : wanted.objects) {
      json["objects"].push_back(json_of(read, *object, wanted.sub));
    }
    print_text(json_text(json));
    return Exit::done;
  }
  if (asked.object.empty()) {
    print_line(summary(file));
    print_table(read);
    return Exit::done;
  }
  for (const od::Object* const object : wanted.objects) print_detail(read, *object, wanted.sub);
  return Exit::done;
}

}  // namespace berth::cli

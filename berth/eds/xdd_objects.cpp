// CANopenObjectList: the object dictionary of an XDD, with the parameters of the application process that it refers to.
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "berth/eds/odd_values.hpp"
#include "berth/eds/sub_indices_parts.hpp"
#include "berth/eds/xdd_reader.hpp"

namespace berth::eds::xml {
namespace {

using od::Access;
using od::DataType;

struct Named {
  std::string_view word;
  DataType type;
};
/// CiA 311's names for IEC 61131 types.
constexpr std::array<Named, 19> iec_types{{{"BOOL", DataType::boolean},
                                           {"BYTE", DataType::unsigned8},
                                           {"CHAR", DataType::unsigned8},
                                           {"WORD", DataType::unsigned16},
                                           {"DWORD", DataType::unsigned32},
                                           {"LWORD", DataType::unsigned64},
                                           {"SINT", DataType::integer8},
                                           {"INT", DataType::integer16},
                                           {"DINT", DataType::integer32},
                                           {"LINT", DataType::integer64},
                                           {"USINT", DataType::unsigned8},
                                           {"UINT", DataType::unsigned16},
                                           {"UDINT", DataType::unsigned32},
                                           {"ULINT", DataType::unsigned64},
                                           {"REAL", DataType::real32},
                                           {"LREAL", DataType::real64},
                                           {"STRING", DataType::visible_string},
                                           {"WSTRING", DataType::unicode_string},
                                           {"BITSTRING", DataType::octet_string}}};

struct Word {
  std::string_view word;
  Access access;
};
constexpr std::array<Word, 13> accesses{{{"const", Access::constant},
                                         {"ro", Access::ro},
                                         {"wo", Access::wo},
                                         {"rw", Access::rw},
                                         {"rwr", Access::rwr},
                                         {"rww", Access::rww},
                                         {"read", Access::ro},
                                         {"readOnly", Access::ro},
                                         {"write", Access::wo},
                                         {"writeOnly", Access::wo},
                                         {"readWrite", Access::rw},
                                         {"readWriteInput", Access::rwr},
                                         {"readWriteOutput", Access::rww}}};

bool known_code(std::uint64_t code) noexcept { return code == 0 || code == 2 || (code >= 5 && code <= 9); }

/// An object that the editor of CANopenNode keeps in its file but not in the device.
bool disabled(Node parameter) noexcept {
  return std::ranges::any_of(parameter.children(), [](const Node& each) {
    return local(each) == "property" && attribute(each, "name") == "CO_disabled" && attribute(each, "value") == "true";
  });
}

bool simple(od::ObjectCode code) noexcept {
  return code != od::ObjectCode::array && code != od::ObjectCode::record && code != od::ObjectCode::defstruct;
}

}  // namespace

void ObjectList::learn(Node process) {
  for (const Node list : process.children()) {
    const std::string_view kind = local(list);
    if (kind == "functionTypeList" || kind == "functionInstanceList" || kind == "parameterGroupList") {
      ++left_out_[std::string(kind)];
      continue;
    }
    for (const Node each : list.children()) {
      const std::string_view id = attribute(each, "uniqueID");
      if (id.empty()) continue;
      const auto [at, fresh] = by_id_.try_emplace(id, each);
      if (!fresh) {
        source_.tell(Severity::warning, each, "uniqueID", std::string(local(each)),
                     fmt::format("\"{}\" appears twice; the first one is used", id.substr(0, 40)));
      }
    }
  }
}

bool ObjectList::afford(Node node, std::size_t sub_objects, std::size_t bytes) {
  if (too_much_) return false;
  sub_objects_ += sub_objects;
  bytes_ += bytes;
  if (sub_objects_ <= options_.max_sub_objects && bytes_ <= options_.max_value_bytes) return true;
  too_much_ = true;
  source_.tell(Severity::error, node, {}, "", "the file describes more objects than are read");
  return false;
}

void ObjectList::warn(const Facts& facts, Node node, std::string_view name, std::string message, std::string fix) {
  source_.tell(Severity::warning, node, name, facts.key, std::move(message), std::move(fix));
}

ObjectList::Facts ObjectList::facts(Node own, std::uint16_t index, std::uint8_t sub, bool object) {
  Facts made{own, {}, {}, object ? fmt::format("{:04X}", index) : fmt::format("{:04X}:{:02X}", index, sub), index, sub};
  const std::string_view id = attribute(own, "uniqueIDRef");
  if (id.empty()) return made;
  const auto found = by_id_.find(id);
  if (found == by_id_.end()) {
    warn(made, own, "uniqueIDRef",
         fmt::format("no parameter has the ID \"{}\"; what it says is missing here", id.substr(0, 40)));
    return made;
  }
  made.parameter = found->second;
  count_left_out(made.parameter);
  if (const std::string_view model = attribute(made.parameter, "templateIDRef"); !model.empty()) {
    const auto of = by_id_.find(model);
    if (of != by_id_.end()) made.model = of->second;
  }
  return made;
}

void ObjectList::count_left_out(Node parameter) {
  for (const Node each : parameter.children()) {
    const std::string_view kind = local(each);
    if (kind == "description" || kind == "property" || kind == "substituteValue") ++left_out_[std::string(kind)];
  }
}

void ObjectList::read(Node list) {
  if (any_) source_.tell(Severity::warning, list, {}, "", "a second list of objects; both are taken together");
  any_ = true;
  for (const Node each : list.children()) {
    if (too_much_) return;
    if (each.type() != pugi::node_element) continue;
    if (local(each) == "CANopenObject") {
      read_object(each);
    } else {
      source_.tell(Severity::note, each, {}, std::string(local(each)),
                   "CiA 311 does not know this element here; left out");
    }
  }
}

void ObjectList::read_object(Node object) {
  const auto index = source_.number(object, "index", 0xFFFF, true, "CANopenObject", Severity::error);
  if (!index) {
    if (attribute(object, "index").empty()) {
      source_.tell(Severity::error, object, {}, "CANopenObject", "the object has no index", "write index=\"2000\"");
    }
    return;
  }
  const auto at = static_cast<std::uint16_t>(*index);
  const Facts facts = this->facts(object, at, 0, true);
  if (disabled(facts.parameter)) {
    return source_.tell(Severity::note, object, {}, facts.key,
                        "the object is marked as disabled (CO_disabled); left out");
  }
  if (builder_.has(at)) return warn(facts, object, "index", "the object appears twice; the first one is used");
  const auto number = source_.number(object, "objectType", 0xFF, false, facts.key, Severity::warning);
  const bool has_subs = static_cast<bool>(child(object, "CANopenSubObject"));
  auto code = static_cast<od::ObjectCode>(number.value_or(has_subs ? 9 : 7));
  if (number && !known_code(*number)) {
    warn(facts, object, "objectType",
         fmt::format("{} is not an object code of CiA 301; taken as {}", *number, has_subs ? "RECORD" : "VAR"));
    code = has_subs ? od::ObjectCode::record : od::ObjectCode::var;
  }
  if (!has_subs && simple(code)) return read_simple(facts, code);
  if (simple(code)) {
    warn(facts, object, "objectType", fmt::format("a {} has no sub-objects; taken as RECORD", od::name(code)));
    code = od::ObjectCode::record;
  }
  const DataType element =
      code == od::ObjectCode::array && facts.parameter ? iec_type(facts.parameter, true) : DataType::none;
  read_sub_objects(object, facts, code, element);
}

void ObjectList::read_simple(const Facts& facts, od::ObjectCode code) {
  const od::SubSpec only = spec(facts, code == od::ObjectCode::domain ? DataType::domain : DataType::none);
  if (!afford(facts.own, 1, only.name.size() + only.initial.bytes.size())) return;
  builder_.object(facts.index, code, only.name, only.type, only.obj_flags);
  builder_.sub(facts.index, only);
}

void ObjectList::read_sub_objects(Node object, const Facts& facts, od::ObjectCode code, DataType element) {
  DataType type = element;
  if (const auto given = source_.number(object, "dataType", 0xFFFF, true, facts.key, Severity::error)) {
    type = static_cast<DataType>(*given);
  }
  if (!afford(object, 1, 0)) return;
  const std::string name = object_name(facts);
  // The element type of a referred array is not a data type of the object itself.
  builder_.object(facts.index, code, name, attribute(object, "dataType").empty() ? DataType::none : type, flags(facts));
  std::size_t present = 0;
  std::array<bool, 256> seen{};
  for (const Node each : object.children()) {
    if (too_much_) return;
    if (local(each) != "CANopenSubObject") continue;
    const auto number = source_.number(each, "subIndex", 0xFF, true, facts.key, Severity::error);
    if (!number) {
      if (attribute(each, "subIndex").empty()) {
        source_.tell(Severity::error, each, {}, facts.key, "a sub-object has no subIndex", "write subIndex=\"01\"");
      }
      continue;
    }
    const auto sub = static_cast<std::uint8_t>(*number);
    const Facts of = this->facts(each, facts.index, sub, false);
    if (seen[sub]) {
      warn(of, each, "subIndex", "the sub-object appears twice; the first one is used");
      continue;
    }
    present += sub == 0xFF ? 0 : 1;
    seen[sub] = true;
    const DataType fallback = sub == 0 ? DataType::unsigned8 : code == od::ObjectCode::array ? type : DataType::none;
    const od::SubSpec made = spec(of, fallback);
    if (!afford(each, 1, made.name.size() + made.initial.bytes.size())) return;
    builder_.sub(facts.index, made);
  }
  for (const char* const own : {"defaultValue", "actualValue"}) {
    if (attribute(object, own).empty() || ++own_values_ > most_told) continue;
    warn(facts, object, own, no_own_value(code), "give it to a sub-object");
  }
  const auto promised = source_.number(object, "subNumber", 0xFFFF, false, facts.key, Severity::warning);
  if (promised && *promised != present) {
    warn(facts, object, "subNumber",
         fmt::format("says {}, {} sub-objects are there; all are kept", *promised, present));
  }
}

std::string ObjectList::object_name(const Facts& facts) {
  std::string_view name = attribute(facts.own, "name");
  if (name.empty()) name = words(facts.parameter, "label");
  if (!name.empty()) return std::string(name);
  std::string made = facts.key;
  if (const auto colon = made.find(':'); colon != std::string::npos) made.replace(colon, 1, "sub");
  warn(facts, facts.own, {}, fmt::format("name is missing; taken as \"{}\"", made));
  return made;
}

std::uint8_t ObjectList::flags(const Facts& facts) {
  return static_cast<std::uint8_t>(
      source_.number(facts.own, "objFlags", 0xFFFF'FFFF, true, facts.key, Severity::warning).value_or(0));
}

od::SubSpec ObjectList::spec(const Facts& facts, DataType fallback) {
  od::SubSpec made;
  made.sub = facts.sub;
  made.type = data_type(facts, fallback);
  if (!od::known(made.type)) {
    warn(facts, facts.own, "dataType",
         fmt::format("data type {:04X}h is none of CiA 301; its values are taken as bytes",
                     static_cast<unsigned>(made.type)));
  }
  made.access = access(facts, made.type);
  mapping(facts, made);
  made.obj_flags = flags(facts);
  limits(facts, made);
  values(facts, made);
  meaning(facts, made);
  std::string_view denotation = attribute(facts.own, "denotation");
  if (denotation.empty()) denotation = words(child(facts.parameter, "denotation"), "label");
  if (!denotation.empty()) denotations_.push_back({{facts.index, facts.sub}, std::string(denotation)});
  scratch_ = object_name(facts);
  made.name = scratch_;
  return made;
}

DataType ObjectList::iec_type(Node holder, bool elements) {
  Node at = holder;
  for (unsigned deep = 0; at && deep < deepest_reference; ++deep) {
    Node next;
    for (const Node each : at.children()) {
      const std::string_view word = local(each);
      // The type inside an array or struct is the type of its elements.
      const bool inner = local(at) == "array" || local(at) == "struct";
      for (const Named& known : iec_types) {
        if (word == known.word && (!inner || elements)) return known.type;
      }
      if (word == "dataTypeIDRef") {
        const auto found = by_id_.find(attribute(each, "uniqueIDRef"));
        if (found != by_id_.end()) next = found->second;
      }
    }
    at = next;
  }
  return DataType::none;
}

DataType ObjectList::data_type(const Facts& facts, DataType fallback) {
  if (const auto given = source_.number(facts.own, "dataType", 0xFFFF, true, facts.key, Severity::error)) {
    const auto type = static_cast<DataType>(*given);
    if (fallback == DataType::domain && type != DataType::domain) {
      warn(facts, facts.own, "dataType", "the object is a DOMAIN and the data type is not; taken as DOMAIN");
      return DataType::domain;
    }
    return type;
  }
  const auto code = attribute(facts.own, "objectType");
  if (fallback == DataType::domain || code == "2") return DataType::domain;
  for (const Node holder : {facts.parameter, facts.model}) {
    if (const DataType type = iec_type(holder, false); type != DataType::none) return type;
  }
  if (fallback != DataType::none && (facts.sub == 0 || od::known(fallback))) return fallback;
  warn(facts, facts.own, {}, "dataType is missing; taken as UNSIGNED32");
  return DataType::unsigned32;
}

Access ObjectList::access(const Facts& facts, DataType type) {
  Node at = facts.own;
  std::string_view name = "accessType";
  std::string_view value = attribute(at, name);
  for (const Node holder : {facts.parameter, facts.model}) {
    if (!value.empty() || !holder) continue;
    at = holder;
    name = "access";
    value = attribute(holder, name);
  }
  for (const Word& each : accesses) {
    if (same_word(value, each.word)) return each.access;
  }
  if (same_word(value, "noAccess")) {
    warn(facts, at, name, "there is no such access on the bus; taken as ro");
    return Access::ro;
  }
  if (value.empty() && facts.parameter) return Access::ro;  // the schema's default
  if (value.empty() && type == DataType::domain) return Access::rw;
  const Access taken = facts.sub == 0 && type == DataType::unsigned8 && facts.key.size() > 4 ? Access::ro : Access::rw;
  if (value.empty()) {
    warn(facts, facts.own, {}, fmt::format("accessType is missing; taken as {}", od::name(taken)),
         "write const, ro, wo or rw");
  } else {
    warn(facts, at, name,
         fmt::format("\"{}\" is not an access type; taken as {}", value.substr(0, 20), od::name(taken)),
         "write const, ro, wo or rw");
  }
  return taken;
}

/// Whether rw is an input or an output of the process: an EDS gives this in the access type, CiA 311 in the mapping.
void ObjectList::mapping(const Facts& facts, od::SubSpec& spec) {
  const std::string_view value = attribute(facts.own, "PDOmapping");
  if (value.empty() || same_word(value, "no")) return;
  const bool transmit = same_word(value, "TPDO");
  const bool receive = same_word(value, "RPDO");
  spec.mappable = true;
  if (!transmit && !receive) {
    if (!same_word(value, "default") && !same_word(value, "optional")) {
      warn(facts, facts.own, "PDOmapping",
           fmt::format("\"{}\" is not a word for a mapping; taken as optional", value.substr(0, 20)),
           "write no, default, optional, TPDO or RPDO");
    }
    return;
  }
  if (spec.access == Access::rw) spec.access = transmit ? Access::rwr : Access::rww;
  const bool contradiction = transmit ? spec.access == Access::wo || spec.access == Access::rww
                                      : !od::writable(spec.access) || spec.access == Access::rwr;
  if (contradiction) {
    warn(facts, facts.own, "PDOmapping",
         fmt::format("a {} carries no object whose access is {}", value, od::name(spec.access)));
  }
}

ObjectList::Found ObjectList::value_text(const Facts& facts, std::string_view name) const {
  const Found own{untrimmed(facts.own, name), facts.own, name};
  if (!own.text.empty()) return own;
  for (const Node holder : {facts.parameter, facts.model}) {
    const Node at = child(holder, name);
    const Found found{untrimmed(at, "value"), at, "value"};
    if (!found.text.empty()) return found;
  }
  return {};
}

ObjectList::Found ObjectList::limit_text(const Facts& facts, bool low) {
  const std::string_view name = low ? "lowLimit" : "highLimit";
  const Found own{attribute(facts.own, name), facts.own, name};
  if (!own.text.empty()) return own;
  for (const Node holder : {facts.parameter, facts.model}) {
    const Node range = child(allowed_values(holder, by_id_), "range");
    const Node at = child(range, low ? "minValue" : "maxValue");
    const Found found{attribute(at, "value"), at, "value"};
    if (!found.text.empty()) return found;
  }
  return {};
}

std::optional<od::Literal> ObjectList::literal(const Facts& facts, const Found& found, DataType type, Severity wrong) {
  std::string_view text = type == DataType::visible_string ? found.text : trimmed(found.text);
  if (text.empty()) return std::nullopt;
  if (type == DataType::boolean && same_word(text, "true")) text = "1";
  if (type == DataType::boolean && same_word(text, "false")) text = "0";
  auto [parsed, plain] = understand(type, text);
  if (plain) {
    warn(facts, found.node, found.attribute,
         fmt::format("\"{}\" is not a {} as CiA 311 writes it; taken as {}", text.substr(0, 40), od::name(type),
                     *plain));
  }
  if (!parsed) {
    source_.tell(wrong, found.node, found.attribute, facts.key,
                 fmt::format("\"{}\" is not a {}: {}{}", text.substr(0, 40), od::name(type), parsed.error().what,
                             wrong == Severity::error ? "" : "; left out"));
    return std::nullopt;
  }
  if (!od::known(type) && parsed->notes.has(od::Note::plain_text)) {
    warn(facts, found.node, found.attribute, "a value of a data type that CiA 301 does not know; left out");
    return std::nullopt;
  }
  if (parsed->notes.has(od::Note::octal)) {
    warn(facts, found.node, found.attribute,
         fmt::format("{} has a leading 0 and is read as octal (CiA 306)", text.substr(0, 40)),
         "write it without the 0, or with 0x");
  }
  if (parsed->notes.has(od::Note::node_id_last)) {
    warn(facts, found.node, found.attribute, "$NODEID must be first (CiA 306)", "write $NODEID+number");
  }
  if (parsed->notes.has(od::Note::wrapped)) {
    warn(facts, found.node, found.attribute,
         fmt::format("{} is out of the range of {}; taken by its bits", text.substr(0, 40), od::name(type)));
  }
  return std::move(parsed->value);
}

void ObjectList::limits(const Facts& facts, od::SubSpec& spec) {
  for (const bool low : {true, false}) {
    const Found found = limit_text(facts, low);
    if (found.text.empty()) continue;
    if (od::bit_length(spec.type) == 0) {
      warn(facts, found.node, found.attribute, "a limit of a type that has no order; left out");
      continue;
    }
    const auto parsed = od::parse(spec.type, found.text);
    if (parsed && parsed->notes.has(od::Note::wrapped)) {
      warn(facts, found.node, found.attribute,
           fmt::format("\"{}\" lies outside of {}; there is no {} limit", found.text.substr(0, 40), od::name(spec.type),
                       low ? "low" : "high"));
      continue;
    }
    (low ? spec.low : spec.high) = literal(facts, found, spec.type).value_or(od::Literal{});
  }
  const bool both = spec.low.kind == spec.high.kind && spec.low.present();
  if (both && od::compare(spec.type, spec.low.raw, spec.high.raw) > 0) {
    warn(facts, facts.own, {},
         "the low limit is above the high limit; both are left out, because they would refuse every value");
    spec.low = {};
    spec.high = {};
  }
}

void ObjectList::check_limits(const Facts& facts, const Found& found, const od::SubSpec& spec,
                              const od::Literal& value) {
  if (od::bit_length(spec.type) == 0) return;
  for (const std::uint8_t node : {std::uint8_t{1}, std::uint8_t{127}}) {
    const std::uint64_t raw = value.resolve(spec.type, node);
    const bool low = spec.low.present() && od::compare(spec.type, raw, spec.low.resolve(spec.type, node)) < 0;
    const bool high = spec.high.present() && od::compare(spec.type, raw, spec.high.resolve(spec.type, node)) > 0;
    if (!low && !high) continue;
    return warn(facts, found.node, found.attribute,
                fmt::format("the value lies {} the limits", low ? "below" : "above"));
  }
}

void ObjectList::values(const Facts& facts, od::SubSpec& spec) {
  const ObjectRef ref{facts.index, facts.sub};
  const Found given = value_text(facts, "defaultValue");
  if (auto value = literal(facts, given, spec.type)) {
    check_limits(facts, given, spec, *value);
    spec.initial = std::move(*value);
  }
  const Found actual = value_text(facts, "actualValue");
  if (auto value = literal(facts, actual, spec.type, Severity::error)) {
    check_limits(facts, actual, spec, *value);
    if (spec.initial.present())
      defaults_.push_back({ref, spec.type, std::move(spec.initial), source_.line_of(given.node)});
    parameters_.push_back({ref, spec.type, *value, source_.line_of(actual.node)});
    spec.initial = std::move(*value);
  }
}

void ObjectList::finish(File& file, std::uint32_t dummies) {
  builder_.dummies(dummies);
  file.description = builder_.build();
  if (!any_ || file.description->objects().empty()) {
    source_.report().add(Severity::error, 0, 0, "CANopenObjectList", "the file describes no object");
  }
  if (own_values_ > most_told)
    source_.report().add(Severity::warning, 0, 0, "", more_own_values(own_values_ - most_told));
  const auto settle = [](auto& list) { std::ranges::sort(list, {}, [](const auto& each) { return each.object; }); };
  settle(parameters_);
  settle(defaults_);
  settle(denotations_);
  file.parameters = std::move(parameters_);
  file.defaults = std::move(defaults_);
  file.denotations = std::move(denotations_);
}

}  // namespace berth::eds::xml

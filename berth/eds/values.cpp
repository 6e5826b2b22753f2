// The keys of one object or sub-object: names, types, access, values and limits.
#include <fmt/format.h>

#include <algorithm>

#include "berth/eds/dcf.hpp"
#include "berth/eds/objects.hpp"

namespace berth::eds {
namespace {

using Severity = Finding::Severity;

}  // namespace

bool ObjectReader::afford(const Section* section, std::size_t sub_objects, std::size_t bytes) {
  if (too_much_) return false;
  sub_objects_ += sub_objects;
  bytes_ += bytes;
  if (sub_objects_ <= options_.max_sub_objects && bytes_ <= options_.max_value_bytes) return true;
  too_much_ = true;
  const char* const message = "the file describes more objects than are read";
  if (section != nullptr) {
    context_.tell(Severity::error, *section, nullptr, message);
  } else {
    context_.report().add(Severity::error, 0, 0, "", message);
  }
  return false;
}

void ObjectReader::add(std::uint16_t index, const od::SubSpec& spec, const Section* section) {
  if (afford(section, 1, spec.name.size() + spec.initial.bytes.size())) builder_.sub(index, spec);
}

std::string_view ObjectReader::parameter_name(const Group& group, const Section& section, const Keys& keys,
                                              const Fallback& fallback) {
  if (given(keys, Key::parameter_name)) {
    scratch_ = context_.text(entry(keys, Key::parameter_name));
  } else {
    scratch_ = &keys == &group.keys ? fmt::format("{:04X}", group.index)
                                    : fmt::format("{:04X}sub{:X}", group.index, fallback.sub);
    context_.warn(section, nullptr, fmt::format("ParameterName is missing; taken as \"{}\"", scratch_));
  }
  return scratch_;
}

od::DataType ObjectReader::data_type(const Section& section, const Keys& keys, const Fallback& fallback) {
  using od::DataType;
  const Entry* const key = entry(keys, Key::data_type);
  const std::string_view code = context_.raw(entry(keys, Key::object_type));
  const bool is_domain = code == "2" || same_word(code, "0x2") || same_word(code, "0x02");
  if (context_.raw(key).empty()) {
    if (is_domain) return DataType::domain;
    const DataType taken = fallback.type != DataType::none ? fallback.type : DataType::unsigned32;
    context_.warn(section, key, fmt::format("DataType is missing; taken as {}", od::name(taken)));
    return taken;
  }
  const char first = context_.raw(key).front();
  const bool digit = first >= '0' && first <= '9';
  if (const auto named = digit ? std::nullopt : od::data_type(context_.raw(key))) {
    context_.warn(section, key, "DataType is given by name; CiA 306 wants its number");
    return *named;
  }
  const auto value = context_.number(section, key, 0xFFFF, Severity::error);
  const auto type = static_cast<DataType>(value.value_or(static_cast<std::uint64_t>(DataType::unsigned32)));
  if (is_domain && type != DataType::domain) {
    context_.warn(section, key, "the object is a DOMAIN and the data type is not; taken as DOMAIN");
    return DataType::domain;
  }
  return type;
}

od::Access ObjectReader::access(const Section& section, const Keys& keys, const Fallback& fallback, od::DataType type) {
  using od::Access;
  const Entry* const key = entry(keys, Key::access_type);
  const std::string_view value = context_.raw(key);
  for (const Access each : {Access::ro, Access::wo, Access::rw, Access::rwr, Access::rww, Access::constant}) {
    if (same_word(value, od::name(each))) return each;
  }
  if (value.empty() && type == od::DataType::domain) return Access::rw;
  const Access taken = fallback.sub == 0 && fallback.type == od::DataType::unsigned8 ? Access::ro : Access::rw;
  context_.warn(section, key,
                value.empty() ? fmt::format("AccessType is missing; taken as {}", od::name(taken))
                              : fmt::format("\"{}\" is no access type; taken as {}",
                                            context_.document().utf8(value.substr(0, 20)), od::name(taken)),
                "write ro, wo, rw, rwr, rww or const");
  return taken;
}

od::SubSpec ObjectReader::spec(const Group& group, const Section& section, const Keys& keys, const Fallback& fallback) {
  od::SubSpec made;
  made.sub = fallback.sub;
  made.type = data_type(section, keys, fallback);
  if (!od::known(made.type)) {
    context_.warn(section, entry(keys, Key::data_type),
                  fmt::format("data type {:04X}h is none of CiA 301; its values are taken as bytes",
                              static_cast<unsigned>(made.type)));
  }
  made.access = access(section, keys, fallback, made.type);
  made.mappable = context_.flag(section, entry(keys, Key::pdo_mapping));
  made.obj_flags = static_cast<std::uint8_t>(
      context_.number(section, entry(keys, Key::obj_flags), 0xFFFF'FFFF, Severity::warning).value_or(0));
  const ObjectRef ref{group.index, fallback.sub};
  limits(section, keys, made);
  initial(ref, section, keys, made);
  extras(ref, section, keys);
  made.name = parameter_name(group, section, keys, fallback);
  return made;
}

std::optional<od::Literal> ObjectReader::literal(const Section& section, const Entry* entry, od::DataType type) {
  const std::string_view raw = context_.raw(entry);
  if (raw.empty()) return std::nullopt;
  auto parsed = od::parse(type, raw);
  if (!parsed) {
    const std::string_view name = od::name(type);
    context_.tell(
        Severity::error, section, entry,
        fmt::format("\"{}\" is no {}: {}", context_.document().utf8(raw.substr(0, 40)), name, parsed.error().what), "",
        parsed.error().at);
    return std::nullopt;
  }
  if (!od::known(type) && parsed->notes.has(od::Note::plain_text)) {
    context_.warn(section, entry, "a value of a data type that CiA 301 does not know; left out");
    return std::nullopt;
  }
  context_.tell_notes(section, *entry, parsed->notes, type);
  return std::move(parsed->value);
}

od::Literal ObjectReader::limit(const Section& section, const Entry* entry, od::DataType type, bool low) {
  const std::string_view raw = context_.raw(entry);
  if (raw.empty()) return {};
  if (od::bit_length(type) == 0) {
    context_.warn(section, entry, "a limit of a type that has no order; left out");
    return {};
  }
  const auto parsed = od::parse(type, raw);
  // Taken by its bits, -1 as the lower limit of an UNSIGNED32 would refuse every value.
  if (parsed && parsed->notes.has(od::Note::wrapped)) {
    context_.warn(
        section, entry,
        fmt::format("\"{}\" lies outside of {}; there is no {} limit", raw, od::name(type), low ? "low" : "high"));
    return {};
  }
  return literal(section, entry, type).value_or(od::Literal{});
}

void ObjectReader::limits(const Section& section, const Keys& keys, od::SubSpec& spec) {
  const Entry* const low = entry(keys, Key::low_limit);
  const Entry* const high = entry(keys, Key::high_limit);
  spec.low = limit(section, low, spec.type, true);
  spec.high = limit(section, high, spec.type, false);
  const bool both = spec.low.kind == spec.high.kind && spec.low.present();
  if (both && od::compare(spec.type, spec.low.raw, spec.high.raw) > 0) {
    context_.warn(section, low, "LowLimit is above HighLimit; both are left out, for they would refuse every value");
    spec.low = {};
    spec.high = {};
  }
}

void ObjectReader::check_limits(const Section& section, const Entry* entry, const od::SubSpec& spec,
                                const od::Literal& value) {
  if (od::bit_length(spec.type) == 0 || !value.present()) return;
  for (const std::uint8_t node : {std::uint8_t{1}, std::uint8_t{127}}) {
    const std::uint64_t raw = value.resolve(spec.type, node);
    const bool low = spec.low.present() && od::compare(spec.type, raw, spec.low.resolve(spec.type, node)) < 0;
    const bool high = spec.high.present() && od::compare(spec.type, raw, spec.high.resolve(spec.type, node)) > 0;
    if (!low && !high) continue;
    context_.warn(section, entry, fmt::format("the value lies {} the limits", low ? "below" : "above"));
    return;
  }
}

void ObjectReader::initial(ObjectRef ref, const Section& section, const Keys& keys, od::SubSpec& spec) {
  const Entry* const default_key = entry(keys, Key::default_value);
  const Entry* const set_key = entry(keys, Key::parameter_value);
  if (auto value = literal(section, default_key, spec.type)) {
    check_limits(section, default_key, spec, *value);
    spec.initial = std::move(*value);
  }
  if (auto value = literal(section, set_key, spec.type)) {
    check_limits(section, set_key, spec, *value);
    parameters_.push_back({ref, spec.type, *value, set_key->line});
    if (spec.initial.present()) defaults_.push_back({ref, spec.type, std::move(spec.initial), default_key->line});
    spec.initial = std::move(*value);
  }
}

void ObjectReader::extras(ObjectRef ref, const Section& section, const Keys& keys) {
  if (given(keys, Key::denotation)) denotations_.push_back({ref, context_.text(entry(keys, Key::denotation))});
  if (given(keys, Key::param_refd)) param_refs_.push_back({ref, context_.text(entry(keys, Key::param_refd))});
  for (const Key key : {Key::upload_file, Key::download_file}) {
    if (!given(keys, key)) continue;
    std::string name = context_.text(entry(keys, key));
    if (!plain_file_name(name)) {
      context_.warn(section, entry(keys, key), "leads out of the file's folder; left out", "write a plain file name");
      continue;
    }
    file_references_.push_back({ref, key == Key::download_file, std::move(name), entry(keys, key)->line});
  }
}

}  // namespace berth::eds

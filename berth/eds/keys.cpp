#include "berth/eds/keys.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/eds/dcf.hpp"
#include "berth/eds/odd_values.hpp"

namespace berth::eds {
namespace {

using Severity = Finding::Severity;

constexpr std::array<std::string_view, static_cast<std::size_t>(Key::count)> key_words{
    "ParameterName", "ObjectType",   "DataType",   "AccessType", "DefaultValue",  "PDOMapping",
    "SubNumber",     "LowLimit",     "HighLimit",  "ObjFlags",   "CompactSubObj", "ParameterValue",
    "UploadFile",    "DownloadFile", "Denotation", "ParamRefd"};

/// Finds a key's place in `Key` by its length and two letters, which distinguish the words.
class KeySlots {
 public:
  static constexpr std::uint8_t none = 0xFF;

  constexpr KeySlots() {
    slots_.fill(none);
    for (std::size_t slot = 0; slot < key_words.size(); ++slot) {
      std::uint8_t& place = slots_[hash(key_words[slot])];
      if (place != none) throw "two words in one place";  // at compile time
      place = static_cast<std::uint8_t>(slot);
    }
  }
  [[nodiscard]] constexpr std::uint8_t at(std::string_view key) const noexcept { return slots_[hash(key)]; }

 private:
  static constexpr std::size_t hash(std::string_view key) noexcept {
    if (key.size() < 3) return 0;
    const auto letter = [key](std::size_t i) { return static_cast<unsigned char>(key[i] | 0x20); };
    return (key.size() + letter(0) + letter(2) * 7U) % 32;
  }
  std::array<std::uint8_t, 32> slots_{};
};
constexpr KeySlots key_slots;

/// A key's place in `Key`; Key::count for a key that CiA 306 does not know.
std::size_t key_slot(std::string_view key) noexcept {
  const std::uint8_t slot = key_slots.at(key);
  return slot != KeySlots::none && same_word(key_words[slot], key) ? slot : key_words.size();
}

}  // namespace

bool ReadBudget::afford(const Section* section, std::size_t sub_objects, std::size_t bytes) {
  if (spent_) return false;
  sub_objects_ += sub_objects;
  bytes_ += bytes;
  if (sub_objects_ <= options_->max_sub_objects && bytes_ <= options_->max_value_bytes) return true;
  spent_ = true;
  const char* const message = "the file describes more objects than are read";
  if (section != nullptr) {
    context_->tell(Severity::error, *section, nullptr, message);
  } else {
    context_->report().add(Severity::error, 0, 0, "", message);
  }
  return false;
}

void KeyReader::collect(const Section& section, Keys& keys, std::span<const std::string_view> own_words) {
  Keys own{};
  for (const Entry& each : context_.document().entries(section)) {
    const std::string_view key = context_.document().key(each);
    const std::size_t slot = key_slot(key);
    if (slot == key_words.size()) {
      if (std::ranges::any_of(own_words, [key](std::string_view word) { return same_word(word, key); })) continue;
      context_.tell(Severity::note, section, &each, "CiA 306 does not know this key; it is kept and not used");
      continue;
    }
    if (own[slot] != nullptr) context_.warn(section, &each, "appears twice; the last one is used");
    own[slot] = &each;
    keys[slot] = &each;
  }
}

od::ObjectCode KeyReader::object_code(const ObjectGroup& group, bool has_subs) {
  using od::ObjectCode;
  const bool compact =
      given(group.keys, Key::compact_sub_obj) && context_.raw(entry(group.keys, Key::compact_sub_obj)) != "0";
  const ObjectCode derived = has_subs ? ObjectCode::record : compact ? ObjectCode::array : ObjectCode::var;
  const Entry* const type = entry(group.keys, Key::object_type);
  if (context_.raw(type).empty()) {
    if (derived != ObjectCode::var) {
      context_.warn(*group.main, type, fmt::format("ObjectType is missing; taken as {}", od::name(derived)));
    }
    return derived;
  }
  const auto value = context_.number(*group.main, type, 0xFF, Severity::warning);
  const bool valid = value && (*value == 0 || *value == 2 || (*value >= 5 && *value <= 9));
  if (!valid) {
    if (value) {
      context_.warn(*group.main, type, fmt::format("{} is not an object code; taken as {}", *value, od::name(derived)));
    }
    return derived;
  }
  const auto code = static_cast<ObjectCode>(*value);
  const bool simple = code != ObjectCode::array && code != ObjectCode::record && code != ObjectCode::defstruct;
  if (simple && derived != ObjectCode::var) {
    context_.warn(*group.main, type,
                  fmt::format("a {} with sub-objects; taken as {}", od::name(code), od::name(derived)));
    return derived;
  }
  return code;
}

std::string_view KeyReader::parameter_name(const ObjectGroup& group, const Section& section, const Keys& keys,
                                           const Fallback& fallback) {
  if (given(keys, Key::parameter_name)) {
    name_ = context_.text(entry(keys, Key::parameter_name));
  } else {
    name_ = &keys == &group.keys ? fmt::format("{:04X}", group.index)
                                 : fmt::format("{:04X}sub{:X}", group.index, fallback.sub);
    context_.warn(section, nullptr, fmt::format("ParameterName is missing; taken as \"{}\"", name_));
  }
  return name_;
}

od::DataType KeyReader::data_type(const Section& section, const Keys& keys, const Fallback& fallback) {
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

od::Access KeyReader::access(const Section& section, const Keys& keys, const Fallback& fallback, od::DataType type) {
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
                              : fmt::format("\"{}\" is not an access type; taken as {}",
                                            context_.document().utf8(value.substr(0, 20)), od::name(taken)),
                "write ro, wo, rw, rwr, rww or const");
  return taken;
}

od::SubSpec KeyReader::spec(const ObjectGroup& group, const Section& section, const Keys& keys,
                            const Fallback& fallback) {
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

// One odd value does not make the description unusable: it is taken in its plain sense, or left out.
std::optional<od::Literal> KeyReader::literal(const Section& section, const Entry* entry, od::DataType type,
                                              Severity wrong) {
  const std::string_view raw = context_.raw(entry);
  if (raw.empty()) return std::nullopt;
  auto [parsed, plain] = understand(type, raw);
  if (plain) {
    context_.warn(section, entry,
                  fmt::format("\"{}\" is not a {} as CiA 306 writes it; taken as {}",
                              context_.document().utf8(raw.substr(0, 40)), od::name(type), *plain));
  }
  if (!parsed) {
    const std::string_view name = od::name(type);
    const char* const so = wrong == Severity::error ? "" : "; left out";
    context_.tell(wrong, section, entry,
                  fmt::format("\"{}\" is not a {}: {}{}", context_.document().utf8(raw.substr(0, 40)), name,
                              parsed.error().what, so),
                  "", parsed.error().at);
    return std::nullopt;
  }
  if (!od::known(type) && parsed->notes.has(od::Note::plain_text)) {
    context_.warn(section, entry, "a value of a data type that CiA 301 does not know; left out");
    return std::nullopt;
  }
  context_.tell_notes(section, *entry, parsed->notes, type);
  return std::move(parsed->value);
}

od::Literal KeyReader::limit(const Section& section, const Entry* entry, od::DataType type, bool low) {
  const std::string_view raw = context_.raw(entry);
  if (raw.empty()) return {};
  if (od::bit_length(type) == 0) {
    context_.warn(section, entry, "a limit of a type that has no order; left out");
    return {};
  }
  const auto parsed = od::parse(type, raw);
  // If -1 were taken by its bits, as the lower limit of an UNSIGNED32 it would refuse every value.
  if (parsed && parsed->notes.has(od::Note::wrapped)) {
    context_.warn(
        section, entry,
        fmt::format("\"{}\" lies outside of {}; there is no {} limit", raw, od::name(type), low ? "low" : "high"));
    return {};
  }
  return literal(section, entry, type, Severity::warning).value_or(od::Literal{});
}

void KeyReader::limits(const Section& section, const Keys& keys, od::SubSpec& spec) {
  const Entry* const low = entry(keys, Key::low_limit);
  const Entry* const high = entry(keys, Key::high_limit);
  spec.low = limit(section, low, spec.type, true);
  spec.high = limit(section, high, spec.type, false);
  const bool both = spec.low.kind == spec.high.kind && spec.low.present();
  if (both && od::compare(spec.type, spec.low.raw, spec.high.raw) > 0) {
    context_.warn(section, low,
                  "LowLimit is above HighLimit; both are left out, because they would refuse every value");
    spec.low = {};
    spec.high = {};
  }
}

void KeyReader::check_limits(const Section& section, const Entry* entry, const od::SubSpec& spec,
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

void KeyReader::initial(ObjectRef ref, const Section& section, const Keys& keys, od::SubSpec& spec) {
  const Entry* const default_key = entry(keys, Key::default_value);
  const Entry* const set_key = entry(keys, Key::parameter_value);
  if (auto value = literal(section, default_key, spec.type, Severity::warning)) {
    check_limits(section, default_key, spec, *value);
    spec.initial = std::move(*value);
  }
  // A value that a configuration is to write is not left out: if it is wrong, that is an error.
  if (auto value = literal(section, set_key, spec.type)) {
    check_limits(section, set_key, spec, *value);
    values_.parameters.push_back({ref, spec.type, *value, set_key->line});
    if (spec.initial.present())
      values_.defaults.push_back({ref, spec.type, std::move(spec.initial), default_key->line});
    spec.initial = std::move(*value);
  }
}

void KeyReader::extras(ObjectRef ref, const Section& section, const Keys& keys) {
  if (given(keys, Key::denotation)) values_.denotations.push_back({ref, context_.text(entry(keys, Key::denotation))});
  if (given(keys, Key::param_refd)) values_.param_refs.push_back({ref, context_.text(entry(keys, Key::param_refd))});
  for (const Key key : {Key::upload_file, Key::download_file}) {
    if (!given(keys, key)) continue;
    std::string name = context_.text(entry(keys, key));
    if (!plain_file_name(name)) {
      context_.warn(section, entry(keys, key), "leads out of the file's folder; left out", "write a plain file name");
      continue;
    }
    values_.file_references.push_back({ref, key == Key::download_file, std::move(name), entry(keys, key)->line});
  }
}

}  // namespace berth::eds

#include "berth/eds/objects.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/eds/info.hpp"

namespace berth::eds {
namespace {

using Severity = Finding::Severity;

constexpr unsigned most_sub = 254;

int hex_digit(char c) noexcept {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

constexpr std::array<std::string_view, static_cast<std::size_t>(Key::count)> key_words{
    "ParameterName", "ObjectType",   "DataType",   "AccessType", "DefaultValue",  "PDOMapping",
    "SubNumber",     "LowLimit",     "HighLimit",  "ObjFlags",   "CompactSubObj", "ParameterValue",
    "UploadFile",    "DownloadFile", "Denotation", "ParamRefd"};

/// A key's place in `Key` by its length and two letters, which tell the words apart.
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

/// Ascending by object; of several entries for one the last (or first) stays.
template <bool KeepLast, class T>
void by_object(std::vector<T>& list) {
  if (std::ranges::is_sorted(list, std::ranges::less_equal{}, &T::object)) return;
  std::ranges::stable_sort(list, {}, &T::object);
  if (KeepLast) std::ranges::reverse(list);
  const auto rest = std::ranges::unique(list, {}, &T::object);
  list.erase(rest.begin(), rest.end());
  if (KeepLast) std::ranges::reverse(list);
}

}  // namespace

std::optional<std::uint32_t> hex_word(std::string_view text) noexcept {
  if (text.empty() || text.size() > 4) return std::nullopt;
  std::uint32_t value = 0;
  for (const char c : text) {
    const int digit = hex_digit(c);
    if (digit < 0) return std::nullopt;
    value = value * 16 + static_cast<std::uint32_t>(digit);
  }
  return value;
}

std::optional<ObjectSection> object_section(std::string_view name) noexcept {
  if (name.size() < 4) return std::nullopt;
  const auto index = hex_word(name.substr(0, 4));
  if (!index) return std::nullopt;
  ObjectSection found;
  found.index = static_cast<std::uint16_t>(*index);
  const std::string_view rest = name.substr(4);
  if (rest.empty()) return found;
  if (same_word(rest.substr(0, 3), "sub")) {
    const auto sub = hex_word(rest.substr(3));
    if (!sub || *sub > 0xFF) return std::nullopt;
    found.part = Part::sub;
    found.sub = static_cast<std::uint8_t>(*sub);
    return found;
  }
  constexpr std::array<std::pair<std::string_view, Part>, 4> parts{
      {{"Name", Part::name}, {"Value", Part::value}, {"Denotation", Part::denotation}, {"ObjectLinks", Part::links}}};
  for (const auto& [word, part] : parts) {
    if (!same_word(rest, word)) continue;
    found.part = part;
    return found;
  }
  return std::nullopt;
}

ObjectReader::ObjectReader(Context& context, const DeviceInfo& device, const ReadOptions& options)
    : context_(context), device_(device), options_(options) {}

void ObjectReader::run(File& file, std::uint32_t dummies) {
  builder_.dummies(dummies);
  dcf_ = file.commissioning.has_value();
  classify();
  read_lists();
  for (std::size_t begin = 0; begin < sections_.size() && !too_much_;) {
    std::size_t end = begin;
    while (end < sections_.size() && sections_[end].index == sections_[begin].index) ++end;
    const Group found = group(std::span(sections_).subspan(begin, end - begin));
    check_listed(found);
    read_group(found);
    begin = end;
  }
  missing_sections();
  compact_pdos();
  modules(file);
  file.description = builder_.build();
  if (file.description->objects().empty() && !context_.report().has_error()) {
    context_.report().add(Severity::error, 0, 0, "", "no object sections: this is no EDS or DCF");
  }
  check_mandatory(*file.description);
  check_pdo_counts(*file.description);
  if (too_much_) {
    const auto left_out = [&file](const auto& each) { return file.description->find(each.object) == nullptr; };
    std::erase_if(parameters_, left_out);
    std::erase_if(defaults_, left_out);
    std::erase_if(denotations_, left_out);
    std::erase_if(param_refs_, left_out);
    std::erase_if(file_references_, left_out);
  }
  // [xxxxValue] and ParameterValue may both speak of one sub-object: the builder kept the last one, so does this list.
  by_object<true>(parameters_);
  by_object<false>(defaults_);
  by_object<true>(denotations_);
  by_object<true>(param_refs_);
  std::ranges::stable_sort(file_references_, {}, &FileReference::object);
  std::ranges::stable_sort(object_links_, {}, &ObjectLinks::index);
  file.parameters = std::move(parameters_);
  file.defaults = std::move(defaults_);
  file.file_references = std::move(file_references_);
  file.denotations = std::move(denotations_);
  file.param_refs = std::move(param_refs_);
  file.object_links = std::move(object_links_);
}

void ObjectReader::classify() {
  std::vector<std::string_view> others;
  for (const Section& section : context_.document().sections()) {
    const std::string_view name = context_.document().name(section);
    if (auto found = object_section(name)) {
      found->section = &section;
      sections_.push_back(*found);
      if (found->part == Part::sub && name.size() > 8 && name[7] == '0') {
        context_.tell(Severity::note, section, nullptr, "the sub-index is written with a leading zero");
      }
      continue;
    }
    if (!known_section(name)) {
      context_.tell(Severity::note, section, nullptr, "CiA 306 does not know this section; it is kept and not used");
      continue;
    }
    if (module_section(name)) continue;
    // At most a dozen names: a hostile file may repeat them, not multiply them.
    if (std::ranges::any_of(others, [name](std::string_view each) { return same_word(each, name); })) {
      context_.warn(section, nullptr, "the section stands twice; the last one counts");
    } else if (others.size() < 64) {
      others.push_back(name);
    }
  }
  std::ranges::stable_sort(sections_, {}, &ObjectSection::order);
}

void ObjectReader::read_lists() {
  struct List {
    const char* name;
    std::uint16_t first;
    std::uint16_t last;
  };
  constexpr std::array<List, 3> lists{{{"MandatoryObjects", 0x1000, 0x1FFF},
                                       {"OptionalObjects", 0x1000, 0xFFFF},
                                       {"ManufacturerObjects", 0x2000, 0x5FFF}}};
  for (const List& list : lists) {
    const Section* const section = context_.document().find(list.name);
    if (section == nullptr) continue;
    any_list_ = true;
    read_list(*section, list.first, list.last);
  }
  if (!any_list_ && !sections_.empty()) {
    context_.report().add(Severity::warning, 0, 0, "[OptionalObjects]",
                          "no object list stands in the file; every object section counts");
  }
}

void ObjectReader::read_list(const Section& section, std::uint16_t first, std::uint16_t last) {
  std::vector<std::uint32_t> numbers;
  const bool optional = last == 0xFFFF;
  numbered(section, "SupportedObjects", [&](std::uint32_t number, const Entry& entry) {
    numbers.push_back(number);
    const auto index = context_.number(section, &entry, 0xFFFF, Severity::warning);
    if (!index) return;
    const bool misplaced = *index < first || *index > last || (optional && *index >= 0x2000 && *index <= 0x5FFF);
    if (misplaced)
      context_.tell(Severity::note, section, &entry, fmt::format("{:04X}h belongs in another list", *index));
    std::uint64_t& word = (*listed_)[*index / 64];
    if ((word & bit(*index)) != 0) context_.warn(section, &entry, fmt::format("{:04X}h is listed twice", *index));
    word |= bit(*index);
    lists_.push_back({&section, &entry, static_cast<std::uint16_t>(*index)});
  });
  std::ranges::sort(numbers);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (i != 0 && numbers[i] == numbers[i - 1]) {
      context_.warn(section, nullptr, fmt::format("the list has number {} twice; both count", numbers[i]));
      return;
    }
    if (numbers[i] != i + 1) {
      context_.warn(section, nullptr, fmt::format("the list has a hole: number {} is missing", i + 1));
      return;
    }
  }
}

void ObjectReader::check_listed(const Group& group) {
  const bool listed = ((*listed_)[group.index / 64] & bit(group.index)) != 0;
  (*described_)[group.index / 64] |= bit(group.index);
  if (!listed && any_list_ && group.main != nullptr) {
    context_.warn(*group.main, nullptr, "the object is in none of the object lists; it is kept",
                  "add it to [OptionalObjects] or [ManufacturerObjects]");
  }
}

void ObjectReader::missing_sections() {
  for (const auto& each : lists_) {
    if (too_much_ || ((*described_)[each.index / 64] & bit(each.index)) != 0) continue;
    context_.warn(*each.section, each.entry,
                  fmt::format("{:04X}h is listed and has no section [{:04X}]; left out", each.index, each.index),
                  "describe it, or take it off the list");
    (*described_)[each.index / 64] |= bit(each.index);  // told once
  }
}

ObjectReader::Group ObjectReader::group(std::span<const ObjectSection> sections) {
  Group found;
  found.index = sections.front().index;
  std::size_t first_sub = 0;
  std::size_t subs = 0;
  for (std::size_t i = 0; i < sections.size(); ++i) {
    const ObjectSection& each = sections[i];
    if (i != 0 && each.order() == sections[i - 1].order()) {
      context_.warn(*each.section, nullptr, "the section stands twice; where both have a key, the last one counts");
    }
    switch (each.part) {
      case Part::object:
        found.main = each.section;
        collect(*each.section, found.keys);
        break;
      case Part::sub:
        if (subs++ == 0) first_sub = i;
        break;
      case Part::name: found.names = each.section; break;
      case Part::value: found.values = each.section; break;
      case Part::denotation: found.denotations = each.section; break;
      case Part::links: found.links = each.section; break;
    }
  }
  found.subs = sections.subspan(first_sub, subs);
  return found;
}

void ObjectReader::collect(const Section& section, Keys& keys, std::span<const std::string_view> own_words) {
  Keys own{};
  for (const Entry& each : context_.document().entries(section)) {
    const std::string_view key = context_.document().key(each);
    const std::size_t slot = key_slot(key);
    if (slot == key_words.size()) {
      if (std::ranges::any_of(own_words, [key](std::string_view word) { return same_word(word, key); })) continue;
      context_.tell(Severity::note, section, &each, "CiA 306 does not know this key; it is kept and not used");
      continue;
    }
    if (own[slot] != nullptr) context_.warn(section, &each, "stands twice; the last one counts");
    own[slot] = &each;
    keys[slot] = &each;
  }
}

od::ObjectCode ObjectReader::object_code(const Group& group, bool has_subs) {
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
      context_.warn(*group.main, type, fmt::format("{} is no object code; taken as {}", *value, od::name(derived)));
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

void ObjectReader::read_group(const Group& group) {
  using od::ObjectCode;
  parameters_of_group_ = parameters_.size();
  if (group.main == nullptr) {
    if (group.subs.empty()) {
      const Section* const section = group.names != nullptr    ? group.names
                                     : group.values != nullptr ? group.values
                                     : group.links != nullptr  ? group.links
                                                               : group.denotations;
      if (section != nullptr) context_.warn(*section, nullptr, "belongs to an object that has no section; left out");
      return;
    }
    context_.warn(*group.subs.front().section, nullptr,
                  fmt::format("section [{:04X}] is missing; the object is taken as RECORD", group.index));
  }
  const ObjectCode code = group.main == nullptr ? ObjectCode::record : object_code(group, !group.subs.empty());
  if (code == ObjectCode::array || code == ObjectCode::record || code == ObjectCode::defstruct) {
    read_complex(group, code);
  } else {
    read_simple(group, code);
  }
  if (group.links != nullptr) links(group);
  if (group.values != nullptr) value_list(group);
  if (group.denotations != nullptr) denotation_list(group);
}

void ObjectReader::read_simple(const Group& group, od::ObjectCode code) {
  const od::SubSpec only = spec(group, *group.main, group.keys, {});
  if (!afford(group.main, 1, only.name.size() + only.initial.bytes.size())) return;
  builder_.object(group.index, code, only.name, only.type, only.obj_flags);
  builder_.sub(group.index, only);
}

void ObjectReader::read_complex(const Group& group, od::ObjectCode code) {
  od::DataType type = od::DataType::none;
  std::uint8_t flags = 0;
  if (group.main != nullptr) {
    if (given(group.keys, Key::data_type)) type = data_type(*group.main, group.keys, {});
    flags = static_cast<std::uint8_t>(
        context_.number(*group.main, entry(group.keys, Key::obj_flags), 0xFFFF'FFFF, Severity::warning).value_or(0));
    (void)parameter_name(group, *group.main, group.keys, {});
  } else {
    scratch_ = fmt::format("{:04X}", group.index);
  }
  if (!afford(group.main, 1, scratch_.size())) return;
  builder_.object(group.index, code, scratch_, type, flags);

  unsigned compact = 0;
  const Entry* const compact_key = entry(group.keys, Key::compact_sub_obj);
  if (const auto count =
          group.main == nullptr ? std::nullopt : context_.number(*group.main, compact_key, ~0ULL, Severity::error)) {
    if (*count > most_sub) {
      context_.warn(*group.main, compact_key, fmt::format("{} is more than 254 sub-indices; taken as 254", *count));
    }
    compact = static_cast<unsigned>(std::min<std::uint64_t>(*count, most_sub));
  }
  if (compact != 0) {
    if (code != od::ObjectCode::array) {
      context_.warn(*group.main, compact_key,
                    fmt::format("CompactSubObj is for an ARRAY, this is a {}", od::name(code)));
    }
    read_compact(group, compact);
  }
  for (std::size_t i = 0; i < group.subs.size() && !too_much_;) {
    const std::uint8_t sub = group.subs[i].sub;
    Keys keys{};
    const Section* section = nullptr;
    for (; i < group.subs.size() && group.subs[i].sub == sub; ++i) {
      section = group.subs[i].section;
      collect(*section, keys);
    }
    read_sub(group, *section, keys, sub, type);
  }
  if (group.main != nullptr) check_sub_number(group, compact != 0);
}

void ObjectReader::read_sub(const Group& group, const Section& section, const Keys& keys, std::uint8_t sub,
                            od::DataType type) {
  const od::DataType usual = sub == 0 ? od::DataType::unsigned8 : type;
  add(group.index, spec(group, section, keys, {.sub = sub, .type = usual}), &section);
  if (given(keys, Key::compact_sub_obj)) {
    context_.warn(section, entry(keys, Key::compact_sub_obj), "a sub-object has no CompactSubObj; left out");
  }
  if (const auto code = context_.number(section, entry(keys, Key::object_type), 0xFF, Severity::warning);
      code && *code != 7 && *code != 2) {
    context_.warn(section, entry(keys, Key::object_type),
                  fmt::format("object code {} of a sub-object; taken as VAR", *code));
  }
}

void ObjectReader::check_sub_number(const Group& group, bool compact) {
  const Entry* const key = entry(group.keys, Key::sub_number);
  const auto promised = context_.number(*group.main, key, ~0ULL, Severity::warning);
  if (compact) {
    if (promised && *promised != 0) context_.warn(*group.main, key, "stands beside CompactSubObj; left out");
    return;
  }
  std::size_t present = 0;
  for (std::size_t i = 0; i < group.subs.size(); ++i) {
    const bool again = i != 0 && group.subs[i].sub == group.subs[i - 1].sub;
    if (!again && group.subs[i].sub != 0xFF) ++present;
  }
  if (!promised || *promised == 0) {
    context_.warn(*group.main, key, fmt::format("SubNumber is missing or 0; {} sub-objects stand there", present));
  } else if (*promised != present) {
    context_.warn(*group.main, key,
                  fmt::format("says {}, {} sub-objects stand there; all are kept", *promised, present));
  }
}

void ObjectReader::read_compact(const Group& group, unsigned count) {
  const std::size_t defaults = defaults_.size();
  od::SubSpec item = spec(group, *group.main, group.keys, {.sub = 1});
  const auto usual = defaults_.size() > defaults ? std::optional(defaults_.back().value) : std::nullopt;
  const std::uint32_t item_line = group.main->line;
  const std::string base(item.name);
  std::vector<std::string> names(count + 1);
  name_list(group, count, names);
  add(group.index,
      {.sub = 0,
       .name = "NrOfObjects",
       .type = od::DataType::unsigned8,
       .access = od::Access::ro,
       .initial = od::Literal::number(count)},
      group.main);
  for (unsigned sub = 1; sub <= count && !too_much_; ++sub) {
    std::string& name = names[sub];
    if (name.empty()) name = fmt::format("{}{}", base, sub);
    item.sub = static_cast<std::uint8_t>(sub);
    item.name = name;
    add(group.index, item, group.main);
    const Entry* const set = entry(group.keys, Key::parameter_value);
    if (sub > 1 && set != nullptr && item.initial.present() && given(group.keys, Key::parameter_value)) {
      parameters_.push_back({{group.index, item.sub}, item.type, item.initial, set->line});
      if (usual) defaults_.push_back({{group.index, item.sub}, item.type, *usual, item_line});
    }
  }
}

void ObjectReader::name_list(const Group& group, unsigned count, std::vector<std::string>& names) {
  if (group.names == nullptr) return;
  numbered(*group.names, "NrOfEntries", [&](std::uint32_t sub, const Entry& entry) {
    if (sub == 0 || sub > count) {
      context_.warn(*group.names, &entry, "there is no such sub-index; left out");
      return;
    }
    if (!names[sub].empty()) context_.warn(*group.names, &entry, "stands twice; the last one counts");
    names[sub] = context_.text(&entry);
  });
}

}  // namespace berth::eds

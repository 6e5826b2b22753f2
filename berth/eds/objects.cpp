#include "berth/eds/objects.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/eds/compact_pdos.hpp"
#include "berth/eds/info.hpp"
#include "berth/eds/modules_read.hpp"
#include "berth/eds/sub_indices_parts.hpp"

namespace berth::eds {
namespace {

using Severity = Finding::Severity;

int hex_digit(char c) noexcept {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

/// Sorts by object; of several entries for one object the last (or first) stays.
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
    : context_(context), device_(device), budget_(context, options) {}

void ObjectReader::run(File& file, std::uint32_t dummies) {
  builder_.dummies(dummies);
  classify();
  lists_.read(!sections_.empty());
  for (std::size_t begin = 0; begin < sections_.size() && !budget_.spent();) {
    std::size_t end = begin;
    while (end < sections_.size() && sections_[end].index == sections_[begin].index) ++end;
    const ObjectGroup found = group(std::span(sections_).subspan(begin, end - begin));
    lists_.described(found);
    read_group(found);
    begin = end;
  }
  if (!budget_.spent()) lists_.missing_sections();
  if (own_values_ > most_told)
    context_.report().add(Severity::warning, 0, 0, "", more_own_values(own_values_ - most_told));
  CompactPdos(device_, file.commissioning.has_value(), builder_, budget_, values_).add_all();
  ModuleReader(context_, budget_).read(file);
  file.description = builder_.build();
  if (file.description->objects().empty() && !context_.report().has_error()) {
    context_.report().add(Severity::error, 0, 0, "", "no object sections: this is not an EDS or DCF");
  }
  check_mandatory(*file.description);
  check_pdo_counts(*file.description);
  hand_over(file);
}

// An object that was left out has no values either.
void ObjectReader::hand_over(File& file) {
  if (budget_.spent()) {
    const auto left_out = [&file](const auto& each) { return file.description->find(each.object) == nullptr; };
    std::erase_if(values_.parameters, left_out);
    std::erase_if(values_.defaults, left_out);
    std::erase_if(values_.denotations, left_out);
    std::erase_if(values_.param_refs, left_out);
    std::erase_if(values_.file_references, left_out);
  }
  // [xxxxValue] and ParameterValue may both set one sub-object. The builder kept the last value, and so does this list.
  by_object<true>(values_.parameters);
  by_object<false>(values_.defaults);
  by_object<true>(values_.denotations);
  by_object<true>(values_.param_refs);
  std::ranges::stable_sort(values_.file_references, {}, &FileReference::object);
  std::ranges::stable_sort(values_.object_links, {}, &ObjectLinks::index);
  file.parameters = std::move(values_.parameters);
  file.defaults = std::move(values_.defaults);
  file.file_references = std::move(values_.file_references);
  file.denotations = std::move(values_.denotations);
  file.param_refs = std::move(values_.param_refs);
  file.object_links = std::move(values_.object_links);
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
    // These are a dozen names at most: a hostile file can repeat them, but not invent more.
    if (std::ranges::any_of(others, [name](std::string_view each) { return same_word(each, name); })) {
      context_.warn(section, nullptr, "the section appears twice; the last one is used");
    } else if (others.size() < 64) {
      others.push_back(name);
    }
  }
  std::ranges::stable_sort(sections_, {}, &ObjectSection::order);
}

ObjectGroup ObjectReader::group(std::span<const ObjectSection> sections) {
  ObjectGroup found;
  found.index = sections.front().index;
  std::size_t first_sub = 0;
  std::size_t subs = 0;
  for (std::size_t i = 0; i < sections.size(); ++i) {
    const ObjectSection& each = sections[i];
    if (i != 0 && each.order() == sections[i - 1].order()) {
      context_.warn(*each.section, nullptr, "the section appears twice; where both have a key, the last one is used");
    }
    switch (each.part) {
      case Part::object:
        found.main = each.section;
        keys_.collect(*each.section, found.keys);
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

void ObjectReader::read_group(const ObjectGroup& group) {
  using od::ObjectCode;
  parameters_of_group_ = values_.parameters.size();
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
  const ObjectCode code = group.main == nullptr ? ObjectCode::record : keys_.object_code(group, !group.subs.empty());
  if (code == ObjectCode::array || code == ObjectCode::record || code == ObjectCode::defstruct) {
    read_complex(group, code);
  } else {
    read_simple(group, code);
  }
  if (group.links != nullptr) links(group);
  if (group.values != nullptr) value_list(group);
  if (group.denotations != nullptr) denotation_list(group);
}

void ObjectReader::read_simple(const ObjectGroup& group, od::ObjectCode code) {
  const od::SubSpec only = keys_.spec(group, *group.main, group.keys, {});
  if (!budget_.afford(group.main, 1, only.name.size() + only.initial.bytes.size())) return;
  builder_.object(group.index, code, only.name, only.type, only.obj_flags);
  builder_.sub(group.index, only);
}

void ObjectReader::read_complex(const ObjectGroup& group, od::ObjectCode code) {
  od::DataType type = od::DataType::none;
  std::uint8_t flags = 0;
  std::string name;
  if (group.main != nullptr) {
    if (keys_.given(group.keys, Key::data_type)) type = keys_.data_type(*group.main, group.keys, {});
    flags = static_cast<std::uint8_t>(
        context_.number(*group.main, entry(group.keys, Key::obj_flags), 0xFFFF'FFFF, Severity::warning).value_or(0));
    name = keys_.parameter_name(group, *group.main, group.keys, {});
  } else {
    name = fmt::format("{:04X}", group.index);
  }
  if (!budget_.afford(group.main, 1, name.size())) return;
  builder_.object(group.index, code, name, type, flags);

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
  } else if (group.main != nullptr) {
    tell_own_values(group, code);
  }
  for (std::size_t i = 0; i < group.subs.size() && !budget_.spent();) {
    const std::uint8_t sub = group.subs[i].sub;
    Keys keys{};
    const Section* section = nullptr;
    for (; i < group.subs.size() && group.subs[i].sub == sub; ++i) {
      section = group.subs[i].section;
      keys_.collect(*section, keys);
    }
    read_sub(group, *section, keys, sub, type);
  }
  if (group.main != nullptr) check_sub_number(group, compact != 0);
}

// Beside CompactSubObj, such a value would be that of every element (CiA 306-1 §4.6.3).
void ObjectReader::tell_own_values(const ObjectGroup& group, od::ObjectCode code) {
  for (const Key key : {Key::default_value, Key::parameter_value}) {
    if (!keys_.given(group.keys, key) || ++own_values_ > most_told) continue;
    context_.warn(*group.main, entry(group.keys, key), no_own_value(code), "give it to a sub-object");
  }
}

void ObjectReader::read_sub(const ObjectGroup& group, const Section& section, const Keys& keys, std::uint8_t sub,
                            od::DataType type) {
  const od::DataType usual = sub == 0 ? od::DataType::unsigned8 : type;
  add(group.index, keys_.spec(group, section, keys, {.sub = sub, .type = usual}), &section);
  if (keys_.given(keys, Key::compact_sub_obj)) {
    context_.warn(section, entry(keys, Key::compact_sub_obj), "a sub-object has no CompactSubObj; left out");
  }
  if (const auto code = context_.number(section, entry(keys, Key::object_type), 0xFF, Severity::warning);
      code && *code != 7 && *code != 2) {
    context_.warn(section, entry(keys, Key::object_type),
                  fmt::format("object code {} of a sub-object; taken as VAR", *code));
  }
}

void ObjectReader::check_sub_number(const ObjectGroup& group, bool compact) {
  const Entry* const key = entry(group.keys, Key::sub_number);
  const auto promised = context_.number(*group.main, key, ~0ULL, Severity::warning);
  if (compact) {
    if (promised && *promised != 0) context_.warn(*group.main, key, "is beside CompactSubObj; left out");
    return;
  }
  std::size_t present = 0;
  for (std::size_t i = 0; i < group.subs.size(); ++i) {
    const bool again = i != 0 && group.subs[i].sub == group.subs[i - 1].sub;
    if (!again && group.subs[i].sub != 0xFF) ++present;
  }
  if (!promised || *promised == 0) {
    context_.warn(*group.main, key, fmt::format("SubNumber is missing or 0; {} sub-objects are there", present));
  } else if (*promised != present) {
    context_.warn(*group.main, key, fmt::format("says {}, {} sub-objects are there; all are kept", *promised, present));
  }
}

void ObjectReader::read_compact(const ObjectGroup& group, unsigned count) {
  const std::size_t defaults = values_.defaults.size();
  od::SubSpec item = keys_.spec(group, *group.main, group.keys, {.sub = 1});
  const auto usual = values_.defaults.size() > defaults ? std::optional(values_.defaults.back().value) : std::nullopt;
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
  for (unsigned sub = 1; sub <= count && !budget_.spent(); ++sub) {
    std::string& name = names[sub];
    if (name.empty()) name = fmt::format("{}{}", base, sub);
    item.sub = static_cast<std::uint8_t>(sub);
    item.name = name;
    add(group.index, item, group.main);
    const Entry* const set = entry(group.keys, Key::parameter_value);
    if (sub > 1 && set != nullptr && item.initial.present() && keys_.given(group.keys, Key::parameter_value)) {
      values_.parameters.push_back({{group.index, item.sub}, item.type, item.initial, set->line});
      if (usual) values_.defaults.push_back({{group.index, item.sub}, item.type, *usual, item_line});
    }
  }
}

void ObjectReader::name_list(const ObjectGroup& group, unsigned count, std::vector<std::string>& names) {
  if (group.names == nullptr) return;
  numbered(context_, *group.names, "NrOfEntries", [&](std::uint32_t sub, const Entry& entry) {
    if (sub == 0 || sub > count) {
      context_.warn(*group.names, &entry, "there is no such sub-index; left out");
      return;
    }
    if (!names[sub].empty()) context_.warn(*group.names, &entry, "appears twice; the last one is used");
    names[sub] = context_.text(&entry);
  });
}

void ObjectReader::add(std::uint16_t index, const od::SubSpec& spec, const Section* section) {
  if (budget_.afford(section, 1, spec.name.size() + spec.initial.bytes.size())) builder_.sub(index, spec);
}

}  // namespace berth::eds

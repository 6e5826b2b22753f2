#include "berth/eds/modules_read.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/eds/info.hpp"
#include "berth/eds/objects.hpp"
#include "berth/eds/sub_indices_parts.hpp"

namespace berth::eds {
namespace {

using Severity = Finding::Severity;

constexpr std::array<std::string_view, 2> extension_words{"Count", "ObjExtend"};

/// Reads "6423" and "6423sub1", the names of a fixed object.
bool fixed_name(std::string_view rest, ModuleSection& found) noexcept {
  const auto index = hex_word(rest.substr(0, 4));
  if (!index || rest.size() < 4) return false;
  found.index = static_cast<std::uint16_t>(*index);
  found.part = ModulePart::fixed;
  if (rest.size() == 4) return true;
  const auto sub = same_word(rest.substr(4, 3), "sub") ? hex_word(rest.substr(7)) : std::nullopt;
  if (!sub || *sub > 0xFF) return false;
  found.part = ModulePart::fixed_sub;
  found.sub = static_cast<std::uint8_t>(*sub);
  return true;
}

}  // namespace

od::SubSpec ModuleValue::spec(std::uint8_t at) const {
  return {.sub = at,
          .name = name,
          .type = type,
          .access = access,
          .mappable = mappable,
          .initial = initial,
          .low = low,
          .high = high,
          .obj_flags = obj_flags};
}

std::optional<ModuleSection> module_section(std::string_view name) noexcept {
  if (name.size() < 3 || (name[0] != 'M' && name[0] != 'm')) return std::nullopt;
  const std::size_t end = name.find_first_not_of("0123456789", 1);
  const auto number = end == std::string_view::npos ? 0 : number_key(name.substr(1, end - 1)).value_or(0);
  if (number == 0 || number > 0xFFFF) return std::nullopt;
  ModuleSection found;
  found.module = static_cast<std::uint16_t>(number);
  const std::string_view rest = name.substr(end);
  constexpr std::array<std::pair<std::string_view, ModulePart>, 4> words{{{"ModuleInfo", ModulePart::info},
                                                                          {"Comments", ModulePart::comments},
                                                                          {"FixedObjects", ModulePart::fixed_list},
                                                                          {"SubExtends", ModulePart::extension_list}}};
  for (const auto& [word, part] : words) {
    if (!same_word(rest, word)) continue;
    found.part = part;
    return found;
  }
  if (same_word(rest.substr(0, 5), "Fixed")) {
    return fixed_name(rest.substr(5), found) ? std::optional(found) : std::nullopt;
  }
  if (!same_word(rest.substr(0, 6), "SubExt")) return std::nullopt;
  const auto index = hex_word(rest.substr(6));
  if (!index) return std::nullopt;
  found.part = ModulePart::extension;
  found.index = static_cast<std::uint16_t>(*index);
  return found;
}

void ModuleReader::read(File& file) {
  std::vector<ModuleSection> sections;
  for (const Section& each : context_.document().sections()) {
    auto found = module_section(context_.document().name(each));
    if (!found) continue;
    found->section = &each;
    sections.push_back(*found);
  }
  std::ranges::stable_sort(sections, {}, &ModuleSection::order);
  for (std::size_t i = 1; i < sections.size(); ++i) {
    if (sections[i].order() != sections[i - 1].order()) continue;
    context_.warn(*sections[i].section, nullptr,
                  "the section appears twice; where both have a key, the last one is used");
  }
  for (std::size_t begin = 0; begin < sections.size() && !budget_.spent();) {
    std::size_t end = begin;
    while (end < sections.size() && sections[end].module == sections[begin].module) ++end;
    file.modules.push_back(module(sections[begin].module, std::span(sections).subspan(begin, end - begin)));
    begin = end;
  }
  const Section* const list = context_.document().find("SupportedModules");
  if (list == nullptr) {
    if (!sections.empty()) {
      context_.warn(*sections.front().section, nullptr, "the file has modules and no [SupportedModules]");
    }
    return;
  }
  const Entry* const count = context_.document().find(*list, "NrOfEntries");
  const auto promised = context_.number(*list, count, 0xFFFF'FFFF, Severity::warning);
  if (promised && *promised != file.modules.size()) {
    context_.warn(*list, count, fmt::format("says {}, {} kinds of modules are there", *promised, file.modules.size()));
  }
}

Module ModuleReader::module(std::uint16_t number, std::span<const ModuleSection> sections) {
  Module made;
  made.number = number;
  const Section* fixed_list = nullptr;
  const Section* extension_list = nullptr;
  for (std::size_t i = 0; i < sections.size() && !budget_.spent();) {
    const ModuleSection& each = sections[i];
    std::size_t end = i + 1;
    switch (each.part) {
      case ModulePart::info: {
        const auto text = [&](std::string_view key) {
          return context_.text(context_.document().find(*each.section, key));
        };
        made.product_name = text("ProductName");
        made.product_version = text("ProductVersion");
        made.product_revision = text("ProductRevision");
        made.order_code = text("OrderCode");
        break;
      }
      case ModulePart::comments: made.comments = read_comments(context_, *each.section); break;
      case ModulePart::fixed_list: fixed_list = each.section; break;
      case ModulePart::extension_list: extension_list = each.section; break;
      case ModulePart::fixed:
      case ModulePart::fixed_sub:
        while (end < sections.size() && sections[end].index == each.index &&
               (sections[end].part == ModulePart::fixed || sections[end].part == ModulePart::fixed_sub)) {
          ++end;
        }
        fixed_object(made, sections.subspan(i, end - i));
        break;
      case ModulePart::extension:
        while (end < sections.size() && sections[end].order() == each.order()) ++end;
        extension(made, sections.subspan(i, end - i));
        break;
    }
    i = end;
  }
  std::vector<std::uint16_t> present;
  for (const ModuleObject& each : made.fixed_objects) present.push_back(each.index);
  if (fixed_list != nullptr) check_module_list(*fixed_list, present);
  present.clear();
  for (const ModuleExtension& each : made.extensions) present.push_back(each.index);
  if (extension_list != nullptr) check_module_list(*extension_list, present);
  return made;
}

void ModuleReader::check_module_list(const Section& section, std::span<const std::uint16_t> present) {
  numbered(context_, section, "NrOfEntries", [&](std::uint32_t, const Entry& entry) {
    const auto index = context_.number(section, &entry, 0xFFFF, Severity::warning);
    if (!index || std::ranges::binary_search(present, static_cast<std::uint16_t>(*index))) return;
    context_.warn(section, &entry, fmt::format("{:04X}h is listed and has no section; left out", *index));
  });
}

ModuleValue ModuleReader::module_value(std::uint16_t index, const Section& section, const Keys& keys,
                                       const Fallback& fallback) {
  ObjectGroup group;
  group.index = index;
  const od::SubSpec read = keys_.spec(group, section, keys, fallback);
  not_taken_ = {};
  (void)budget_.afford(&section, 1, read.name.size() + read.initial.bytes.size());
  return {.sub = read.sub,
          .name = std::string(read.name),
          .type = read.type,
          .access = read.access,
          .mappable = read.mappable,
          .initial = read.initial,
          .low = read.low,
          .high = read.high,
          .obj_flags = read.obj_flags};
}

void ModuleReader::fixed_object(Module& module, std::span<const ModuleSection> sections) {
  ObjectGroup group;
  group.index = sections.front().index;
  std::size_t first_sub = 0;
  for (; first_sub < sections.size() && sections[first_sub].part == ModulePart::fixed; ++first_sub) {
    group.main = sections[first_sub].section;
    keys_.collect(*group.main, group.keys);
  }
  const auto subs = sections.subspan(first_sub);
  if (group.main == nullptr) {
    context_.warn(*subs.front().section, nullptr, "the section of the object itself is missing; left out");
    return;
  }
  ModuleObject made;
  made.index = group.index;
  made.code = keys_.object_code(group, !subs.empty());
  if (!takes_subs(made.code)) {
    made.subs.push_back(module_value(group.index, *group.main, group.keys, {}));
    made.name = made.subs.front().name;
    made.type = made.subs.front().type;
    made.obj_flags = made.subs.front().obj_flags;
    module.fixed_objects.push_back(std::move(made));
    return;
  }
  made.name = keys_.parameter_name(group, *group.main, group.keys, {});
  if (keys_.given(group.keys, Key::data_type)) made.type = keys_.data_type(*group.main, group.keys, {});
  made.obj_flags = static_cast<std::uint8_t>(
      context_.number(*group.main, entry(group.keys, Key::obj_flags), 0xFFFF'FFFF, Severity::warning).value_or(0));
  const auto compact =
      context_.number(*group.main, entry(group.keys, Key::compact_sub_obj), most_sub, Severity::warning).value_or(0);
  if (compact != 0) {
    made.subs.push_back({.sub = 0,
                         .name = "NrOfObjects",
                         .type = od::DataType::unsigned8,
                         .access = od::Access::ro,
                         .initial = od::Literal::number(compact)});
    const ModuleValue item = module_value(group.index, *group.main, group.keys, {.sub = 1});
    for (unsigned sub = 1; sub <= compact && budget_.afford(group.main, 1, item.name.size() + 3); ++sub) {
      ModuleValue& each = made.subs.emplace_back(item);
      each.sub = static_cast<std::uint8_t>(sub);
      each.name = fmt::format("{}{}", item.name, sub);
    }
  }
  for (std::size_t i = 0; i < subs.size() && !budget_.spent();) {
    const std::uint8_t sub = subs[i].sub;
    Keys keys{};
    const Section* section = nullptr;
    for (; i < subs.size() && subs[i].sub == sub; ++i) keys_.collect(*(section = subs[i].section), keys);
    const od::DataType usual = sub == 0 ? od::DataType::unsigned8 : made.type;
    std::erase_if(made.subs, [sub](const ModuleValue& each) { return each.sub == sub; });
    made.subs.push_back(module_value(group.index, *section, keys, {.sub = sub, .type = usual}));
  }
  std::ranges::sort(made.subs, {}, &ModuleValue::sub);
  module.fixed_objects.push_back(std::move(made));
}

void ModuleReader::extension(Module& module, std::span<const ModuleSection> sections) {
  Keys keys{};
  const Section& section = *sections.back().section;
  for (const ModuleSection& each : sections) keys_.collect(*each.section, keys, extension_words);
  ModuleExtension made;
  made.index = sections.front().index;
  made.value = module_value(made.index, section, keys, {.sub = 1});
  made.value.sub = 0;
  const Entry* const count = context_.document().find(section, "Count");
  const std::string_view text = context_.raw(count);
  const std::size_t semicolon = text.find(';');
  const auto part = [](std::string_view digits) { return od::parse_number(digits); };
  const auto sub_indices = part(text.substr(0, semicolon));
  const auto bits = semicolon == std::string_view::npos ? part("0") : part(text.substr(semicolon + 1));
  if (!sub_indices || !bits || sub_indices->magnitude > most_sub || bits->magnitude > 64) {
    context_.warn(section, count, "Count is neither n nor 0;bits; the extension is left out");
    return;
  }
  made.count = static_cast<std::uint16_t>(sub_indices->magnitude);
  made.bits = static_cast<std::uint16_t>(bits->magnitude);
  const Entry* const extend = context_.document().find(section, "ObjExtend");
  made.object_extend =
      static_cast<std::uint16_t>(context_.number(section, extend, 0xFFFF, Severity::warning).value_or(0));
  module.extensions.push_back(std::move(made));
}

}  // namespace berth::eds

// Checks that concern several objects: value lists, PDOs without a section, counts and mandatory objects.
#include <fmt/format.h>

#include <algorithm>

#include "berth/eds/info.hpp"
#include "berth/eds/objects.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::eds {
namespace {

using Severity = Finding::Severity;

std::size_t count(const od::Description& description, std::uint16_t first) {
  std::size_t found = 0;
  for (const od::Object& each : description.objects()) {
    if (each.index >= first && each.index < first + od::most_pdos) ++found;
  }
  return found;
}

}  // namespace

void ObjectReader::value_list(const ObjectGroup& group) {
  const Section& section = *group.values;
  if (!keys_.given(group.keys, Key::compact_sub_obj)) {
    context_.warn(section, nullptr, "the object has no CompactSubObj; the values are taken all the same");
  }
  numbered(context_, section, "NrOfEntries", [&](std::uint32_t sub, const Entry& entry) {
    const ObjectRef ref{group.index, static_cast<std::uint8_t>(sub)};
    const auto known = sub <= 0xFF ? builder_.spec_of(ref) : std::nullopt;
    if (!known) {
      context_.warn(section, &entry, "there is no such sub-index; left out");
      return;
    }
    auto value = keys_.literal(section, &entry, known->type);
    if (!value || !budget_.afford(&section, 0, value->bytes.size())) return;
    keys_.check_limits(section, &entry, *known, *value);
    const auto set = [ref](const Parameter& each) { return each.object == ref; };
    const auto first = static_cast<std::ptrdiff_t>(parameters_of_group_);
    if (known->initial.present() && std::none_of(values_.parameters.begin() + first, values_.parameters.end(), set)) {
      values_.defaults.push_back({ref, known->type, known->initial, group.main == nullptr ? 0 : group.main->line});
    }
    builder_.initial(ref, *value);
    values_.parameters.push_back({ref, known->type, std::move(*value), entry.line});
  });
}

void ObjectReader::denotation_list(const ObjectGroup& group) {
  numbered(context_, *group.denotations, "NrOfEntries", [&](std::uint32_t sub, const Entry& entry) {
    if (sub > 0xFF || !builder_.has(ObjectRef{group.index, static_cast<std::uint8_t>(sub)})) {
      context_.warn(*group.denotations, &entry, "there is no such sub-index; left out");
      return;
    }
    values_.denotations.push_back({{group.index, static_cast<std::uint8_t>(sub)}, context_.text(&entry)});
  });
}

void ObjectReader::links(const ObjectGroup& group) {
  ObjectLinks made{group.index, {}};
  numbered(context_, *group.links, "ObjectLinks", [&](std::uint32_t, const Entry& entry) {
    const auto index = context_.number(*group.links, &entry, 0xFFFF, Severity::warning);
    if (index) made.links.push_back(static_cast<std::uint16_t>(*index));
  });
  values_.object_links.push_back(std::move(made));
}

void ObjectReader::check_pdo_counts(const od::Description& description) {
  const Section* const section = context_.document().find("DeviceInfo");
  if (section == nullptr) return;
  struct Check {
    const char* key;
    std::uint16_t promised;
    std::uint16_t first;
  };
  for (const Check& each : {Check{"NrOfRXPDO", device_.rpdos, 0x1400}, Check{"NrOfTXPDO", device_.tpdos, 0x1800}}) {
    const std::size_t present = count(description, each.first);
    const Entry* const entry = context_.document().find(*section, each.key);
    if (present == each.promised || entry == nullptr) continue;
    context_.tell(Severity::note, *section, entry,
                  fmt::format("{} PDOs are declared, {} communication records are there", each.promised, present));
  }
}

void ObjectReader::check_mandatory(const od::Description& description) {
  if (sections_.empty()) return;
  for (const std::uint16_t index : {std::uint16_t{0x1000}, std::uint16_t{0x1001}, std::uint16_t{0x1018}}) {
    if (description.find(index) != nullptr) continue;
    context_.report().add(Severity::warning, 0, 0, fmt::format("[{:04X}]", index),
                          "the object is mandatory (CiA 301) and not there");
  }
}

}  // namespace berth::eds

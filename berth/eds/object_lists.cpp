#include "berth/eds/object_lists.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth::eds {
namespace {

using Severity = Finding::Severity;

}  // namespace

void ObjectLists::read(bool any_object) {
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
  if (!any_list_ && any_object) {
    context_.report().add(Severity::warning, 0, 0, "[OptionalObjects]",
                          "the file has no object list; every object section is used");
  }
}

void ObjectLists::read_list(const Section& section, std::uint16_t first, std::uint16_t last) {
  std::vector<std::uint32_t> numbers;
  const bool optional = last == 0xFFFF;
  numbered(context_, section, "SupportedObjects", [&](std::uint32_t number, const Entry& entry) {
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
      context_.warn(section, nullptr, fmt::format("the list has number {} twice; both are used", numbers[i]));
      return;
    }
    if (numbers[i] != i + 1) {
      context_.warn(section, nullptr, fmt::format("the list has a gap: number {} is missing", i + 1));
      return;
    }
  }
}

void ObjectLists::described(const ObjectGroup& group) {
  const bool listed = ((*listed_)[group.index / 64] & bit(group.index)) != 0;
  (*described_)[group.index / 64] |= bit(group.index);
  if (!listed && any_list_ && group.main != nullptr) {
    context_.warn(*group.main, nullptr, "the object is in none of the object lists; it is kept",
                  "add it to [OptionalObjects] or [ManufacturerObjects]");
  }
}

void ObjectLists::missing_sections() {
  for (const auto& each : lists_) {
    if (((*described_)[each.index / 64] & bit(each.index)) != 0) continue;
    context_.warn(*each.section, each.entry,
                  fmt::format("{:04X}h is listed and has no section [{:04X}]; left out", each.index, each.index),
                  "describe it, or take it off the list");
    (*described_)[each.index / 64] |= bit(each.index);  // so that it is reported once
  }
}

}  // namespace berth::eds

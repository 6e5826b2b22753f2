#include "berth/linker/variables_parts.hpp"

#include <algorithm>
#include <tuple>

#include "berth/base/words.hpp"

namespace berth::linker {
namespace {

using od::DataType;

constexpr unsigned most_subs = 254;

std::string in_lower_case(std::string name) {
  std::ranges::transform(name, name.begin(), [](char c) { return lower(c); });
  return name;
}

bool serves(const eds::DynamicSegment& segment, const Variable& variable) noexcept {
  if (segment.type != variable.type) return false;
  switch (segment.access) {
    case od::Access::ro:
    case od::Access::rwr: return variable.input;
    case od::Access::wo:
    case od::Access::rww: return !variable.input;
    case od::Access::rw: return true;
    default: return false;
  }
}

}  // namespace

std::size_t Variables::of(std::size_t node, const std::string& name, bool input, std::optional<ObjectRef> pinned) {
  auto& names = input ? inputs_ : outputs_;
  const auto [found, fresh] = names.try_emplace(Key{node, in_lower_case(name)}, list_.size());
  if (fresh) list_.push_back({{.node = node, .name = name, .input = input}, pinned});
  // The choice between two spellings does not depend on the order of the links.
  auto& kept = list_[found->second].variable.name;
  kept = std::min(kept, name);
  return found->second;
}

std::optional<std::size_t> Variables::other_direction(std::size_t variable) const {
  const Variable& one = list_[variable].variable;
  const auto& names = one.input ? outputs_ : inputs_;
  const auto found = names.find(Key{one.node, in_lower_case(one.name)});
  if (found == names.end()) return std::nullopt;
  return found->second;
}

void Variables::infer(const std::vector<std::size_t>& order, const Ends& ends) {
  // A variable with a pinned place has the type of its segment.
  for (Each& each : list_) {
    if (!each.pinned) continue;
    for (const auto& segment : network_.nodes[each.variable.node].file->dynamic_segments) {
      if (each.pinned->index >= segment.first && each.pinned->index <= segment.last) each.variable.type = segment.type;
    }
  }
  bool changed = true;
  while (changed) {
    changed = false;
    for (const std::size_t link : order) {
      DataType known = DataType::none;
      const auto all = ends(link);
      for (const auto& [variable, type] : all) {
        if (known == DataType::none) known = variable == no_variable ? type : list_[variable].variable.type;
      }
      for (const auto& [variable, ignored] : all) {
        if (known == DataType::none || variable == no_variable) continue;
        if (list_[variable].variable.type != DataType::none) continue;
        list_[variable].variable.type = known;
        changed = true;
      }
    }
  }
}

bool Variables::has_segment(std::size_t variable) const {
  const Each& each = list_[variable];
  return std::ranges::any_of(network_.nodes[each.variable.node].file->dynamic_segments, [&](const auto& segment) {
    if (!serves(segment, each.variable)) return false;
    return !each.pinned || (each.pinned->index >= segment.first && each.pinned->index <= segment.last);
  });
}

bool Variables::place(Each& each, ObjectRef object) {
  for (const auto& segment : network_.nodes[each.variable.node].file->dynamic_segments) {
    const auto address = segment.address(object);
    if (!serves(segment, each.variable) || !address) continue;
    if (!taken_.try_emplace({each.variable.node, object}, 0).second) return false;
    each.variable.object = object;
    each.variable.offset = *address;
    each.placed = true;
    return true;
  }
  return false;
}

void Variables::find_place(Each& each) {
  const eds::File& file = *network_.nodes[each.variable.node].file;
  for (const auto& segment : file.dynamic_segments) {
    if (!serves(segment, each.variable)) continue;
    for (std::uint32_t index = segment.first; index <= segment.last; ++index) {
      for (unsigned sub = 1; sub <= most_subs; ++sub) {
        const ObjectRef object{static_cast<std::uint16_t>(index), static_cast<std::uint8_t>(sub)};
        if (taken_.contains({each.variable.node, object})) continue;
        // Variables made by the programming system stay in place.
        const bool there =
            file.description->find(object) != nullptr && !network_.nodes[each.variable.node].linked_before;
        if (!there && place(each, object)) return;
      }
    }
  }
}

void Variables::allocate(const Earlier& earlier) {
  for (Each& each : list_) {
    if (each.used && each.pinned) place(each, *each.pinned);
  }
  for (const EarlierVariable& old : earlier.variables) {
    for (Each& each : list_) {
      const Variable& variable = each.variable;
      const bool same = network_.nodes[variable.node].name == old.node && same_word(variable.name, old.name) &&
                        variable.type == old.type && variable.input == old.input;
      if (same && each.used && !each.placed && !each.pinned) place(each, old.object);
    }
  }
  std::vector<Each*> rest;
  for (Each& each : list_) {
    if (each.used && !each.placed && !each.pinned) rest.push_back(&each);
  }
  std::ranges::sort(rest, [](const Each* a, const Each* b) {
    return std::tie(a->variable.node, a->variable.name) < std::tie(b->variable.node, b->variable.name);
  });
  for (Each* const each : rest) find_place(*each);
}

std::optional<ObjectRef> Variables::object(std::size_t variable) const {
  if (!list_[variable].placed) return std::nullopt;
  return list_[variable].variable.object;
}

std::vector<Variable> Variables::all() const {
  std::vector<Variable> made;
  for (const Each& each : list_) {
    if (each.placed) made.push_back(each.variable);
  }
  std::ranges::sort(made, [](const Variable& a, const Variable& b) {
    return std::tie(a.node, b.input, a.object) < std::tie(b.node, a.input, b.object);
  });
  return made;
}

}  // namespace berth::linker

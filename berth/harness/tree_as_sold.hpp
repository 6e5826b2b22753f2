// Draws, for a tree of buses (tree_plan.hpp), devices as sold in shops beneath its gateways: a third of those buses
// have some. Uses its own random numbers after all others, so that trees without them do not change.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "berth/harness/description_of.hpp"
#include "berth/harness/tree_mixture.hpp"
#include "berth/harness/tree_plan.hpp"

namespace berth::harness {

class TreeAsSold {
 public:
  // `folder`: what its devices say of themselves is written there, and stays as long as the world is run.
  TreeAsSold(TreePlan plan, std::string folder)
      : plan_(std::move(plan)), folder_(std::move(folder)), random_(plan_.seed ^ 0x501D'7EE5) {}

  TreePlan run() {
    for (const auto& line : plan_.machine.beneath) {
      if (!one_in(3)) continue;
      if (one_in(3)) {
        blank_ones(line.name);
      } else {
        switched_ones(line.name);
      }
    }
    return std::move(plan_);
  }

 private:
  using Device = plant::PlantDevice;

  bool one_in(std::uint64_t n) { return random_.below(n) == 0; }
  Device& device(const std::string& name) { return *std::ranges::find(plan_.plant.devices, name, &Device::name); }
  TreePlan::Spare* spare_of(const std::string& worn) {
    const auto it = std::ranges::find(plan_.spares, worn, &TreePlan::Spare::worn);
    return it == plan_.spares.end() ? nullptr : &*it;
  }
  // Two devices for one slot that are equal, or have the same switch setting, cannot be distinguished.
  void one_spare(const std::string& worn) {
    auto* const spare = spare_of(worn);
    if (spare == nullptr || spare->second.empty()) return;
    std::erase_if(plan_.plant.devices, [&](const Device& d) { return d.name == spare->second; });
    spare->second.clear();
  }
  // The slots of a bus that no gateway sits in.
  std::vector<design::Slot*> plain_slots(const std::string& bus) {
    std::vector<design::Slot*> slots;
    for (auto& slot : plan_.machine.slots) {
      const bool plain = slot.spec.name.bus == bus && !plan_.plant.gateway_part(slot.spec.name.name).any;
      if (plain) slots.push_back(&slot);
    }
    return slots;
  }

  // One to all of these slots are for one type. Each device, and its replacement, has its slot's node-ID on its
  // switches.
  void switched_ones(const std::string& bus) {
    const auto slots = plain_slots(bus);
    if (slots.empty()) return;
    const TypeCode type = slots[random_.below(slots.size())]->spec.type;
    const bool with_serial = one_in(4);
    const bool with_lss = one_in(3);
    const unsigned parts = one_in(3) ? static_cast<unsigned>(1 + random_.below(3)) : 4;
    const bool is_said = one_in(4) ? false : true;
    for (auto* const slot : slots) {
      if (slot->spec.type != type && one_in(2)) continue;
      const std::string worn = slot->spec.name.name;
      one_spare(worn);
      slot->spec.type = type;
      if (is_said || !with_lss) slot->spec.assign = places::Assign::fixed;
      std::vector<std::string> names{worn};
      if (auto* const spare = spare_of(worn)) names.push_back(spare->fresh);
      for (const auto& name : names) {
        Device& d = device(name);
        d.source = plant::NodeIdSource::switches;
        d.node_id = slot->spec.id;
        d.address = {type.vendor, type.product, 0, with_serial && parts == 4 ? d.address.serial : 0};
        if (parts < 4) d.eds = d.eds_path = description_of(folder_, type, parts);
        if (!with_lss) d.speaks = {};
      }
    }
  }

  // The only device of its type, and its spare, are blank and have no serial numbers.
  void blank_ones(const std::string& bus) {
    const auto slots = plain_slots(bus);
    for (auto* const slot : slots) {
      const auto alike = [&](const design::Slot* other) { return other->spec.type == slot->spec.type; };
      if (std::ranges::count_if(slots, alike) != 1 || one_in(3)) continue;
      const std::string worn = slot->spec.name.name;
      one_spare(worn);
      std::vector<std::string> names{worn};
      if (auto* const spare = spare_of(worn)) names.push_back(spare->fresh);
      for (const auto& name : names) {
        Device& d = device(name);
        d.address.serial = 0;
        d.address.revision = 0;
        d.source = plant::NodeIdSource::blank;
        d.node_id = NodeId();
      }
    }
  }

  TreePlan plan_;
  std::string folder_;
  Random random_;
};

inline TreePlan as_sold(TreePlan plan, const std::string& folder) { return TreeAsSold(std::move(plan), folder).run(); }

// The kind of trees that a seed gives.
struct TreeDraws {
  bool mixed = false;    // with sister buses, replacements, devices of all kinds (tree_mixture.hpp)
  bool as_sold = false;  // with what `TreeAsSold` draws
};
// The tree of this seed.
inline TreePlan plan_of_tree(std::uint64_t seed, TreeDraws draws, const std::string& folder) {
  TreePlan plan = draws.mixed ? mix(tree_plan(seed)) : tree_plan(seed);
  return draws.as_sold ? as_sold(std::move(plan), folder) : plan;
}

}  // namespace berth::harness

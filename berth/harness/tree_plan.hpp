// A random machine of many buses, one beneath the other (paper 3; docs/multilevel.md): a tree of gateways with their
// own NMT masters, blank devices, Berth on the backbone alone.
#pragma once

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/design/machine.hpp"
#include "berth/plant/plant_file.hpp"

namespace berth::harness {

struct TreePlan {
  std::uint64_t seed = 0;
  design::Machine machine;
  plant::PlantFile plant;
  // A device of the plant, and the spare that takes its place.
  struct Spare {
    std::string worn;
    std::string fresh;
    std::string second = {};  // comes too, `later` after the first; empty: none
    std::chrono::milliseconds later{};
  };
  std::vector<Spare> spares;
  bool calm = false;   // exchanges are the only troubles
  bool mixed = false;  // `mix` has drawn more (tree_mixture.hpp)
};

class TreePlanner {
 public:
  TreePlanner(std::uint64_t seed, bool equal_gateways) : random_(seed), equal_gateways_(equal_gateways) {
    plan_.seed = plan_.plant.seed = seed;
  }

  TreePlan run() {
    plan_.machine.name = "tree";
    plan_.machine.file = "tree";
    add_bus("backbone", 0);
    const auto beneath = 1 + random_.below(4);
    for (std::uint64_t i = 0; i < beneath; ++i) grow(i);
    for (auto& level : levels_) add_devices(level);
    return std::move(plan_);
  }
  // One mandatory bus beneath one gateway, a few devices on each.
  TreePlan run_two_levels() {
    plan_.machine.name = "levels";
    plan_.machine.file = "levels";
    add_bus("backbone", 0);
    grow(0);
    plan_.machine.beneath.back().gateway->mandatory = plan_.machine.slots.front().spec.mandatory = true;
    for (auto& level : levels_) add_devices(level);
    return std::move(plan_);
  }

 private:
  static constexpr unsigned deepest = 3;  // gateways on the way: the four levels of Figure 8
  static constexpr TypeCode gateway_type{1, 0x58};
  struct Level {
    std::string bus;
    unsigned depth = 0;
    std::uint8_t next_id = 2;
    std::uint32_t next_serial = 0;
  };

  void add_bus(const std::string& name, unsigned depth) {
    constexpr std::uint32_t rates[]{125'000, 250'000, 500'000};
    design::Bus bus;
    bus.name = name;
    bus.bitrate = rates[random_.below(3)];
    bus.own_port = depth == 0;
    if (depth > 0) bus.master = NodeId(1);
    (depth == 0 ? plan_.machine.buses : plan_.machine.beneath).push_back(bus);
    plan_.plant.buses.push_back({name, 0});
    levels_.push_back({name, depth, 2, static_cast<std::uint32_t>(1000 * (levels_.size() + 1))});
  }

  // A gateway on one of the buses, and a bus beneath it.
  void grow(std::uint64_t number) {
    std::vector<std::size_t> above;
    for (std::size_t i = 0; i < levels_.size(); ++i) {
      if (levels_[i].depth < deepest) above.push_back(i);
    }
    const std::size_t at = above[random_.below(above.size())];
    const std::string name = "bus" + std::to_string(number + 1);
    const std::string gateway = name + " gateway", port = name + " port";
    const bool mandatory = random_.below(2) == 0;
    // Beneath a gateway, each gateway is the only one of its type, like every device that can be exchanged: their
    // master could only guess which of two equal ones is away.
    const auto product =
        levels_[at].depth == 0 || equal_gateways_ ? gateway_type.product : gateway_type.product + 0x1000 * (1 + number);
    const TypeCode type{gateway_type.vendor, static_cast<std::uint32_t>(product)};
    const NodeId id = add_slot(levels_[at], type, gateway, mandatory);
    add_device(levels_[at], type, gateway);
    // The gateway above must know it, to forward its EMCYs about nodes beneath it unchanged.
    for (auto& above_it : plan_.plant.gateways) {
      if (above_it.beneath.front() == levels_[at].bus + " port") above_it.speaks_layout.push_back(id.value());
    }
    add_bus(name, levels_[at].depth + 1);
    plan_.machine.beneath.back().gateway = design::Gateway{.bus = levels_[at].bus, .slot = id, .mandatory = mandatory};
    auto& device = add_device(levels_.back(), {1, 0x59}, port);
    device.node_id = NodeId(1);
    device.source = plant::NodeIdSource::hard_coded;
    device.heartbeat = std::chrono::milliseconds(500);
    device.does.master = plant::PlantMaster{};
    device.does.master->flying = false;
    plant::PlantGateway made;
    made.above = gateway;
    made.beneath = {port};
    plan_.plant.gateways.push_back(made);
  }

  void add_devices(Level& level) {
    const auto slots = 1 + random_.below(4);
    for (std::uint64_t i = 0; i < slots; ++i) {
      // A device that can be exchanged is the only one of its type: if two are missing, the gateway's master could only
      // guess which one a new device replaces.
      const bool exchanged = level.depth > 0 && random_.below(3) == 0;
      const TypeCode type{1, exchanged ? 0x100 + level.next_serial : static_cast<std::uint32_t>(1 + random_.below(3))};
      const std::string name = level.bus + " s" + std::to_string(level.next_id);
      add_slot(level, type, name, random_.below(3) == 0);
      add_device(level, type, name);
      if (!exchanged) continue;
      auto& spare = add_device(level, type, name + " spare");
      spare.plugged = false;
      plan_.spares.push_back({name, spare.name});
    }
  }

  NodeId add_slot(Level& level, TypeCode type, const std::string& name, bool mandatory) {
    design::Slot slot;
    slot.spec.name = {plan_.machine.name, level.bus, name};
    slot.spec.id = NodeId(level.next_id++);
    slot.spec.type = type;
    slot.spec.replacement = places::Replacement::automatic;
    slot.spec.mandatory = mandatory;
    plan_.machine.slots.push_back(slot);
    return slot.spec.id;
  }

  plant::PlantDevice& add_device(Level& level, TypeCode type, const std::string& name) {
    plant::PlantDevice device;
    device.name = name;
    device.bus = level.bus;
    device.address = {type.vendor, type.product, 0, ++level.next_serial};
    device.response = {std::chrono::microseconds(200), std::chrono::microseconds(200 + random_.below(1800)), 0, {}};
    device.boot = std::chrono::milliseconds(20 + random_.below(300));
    plan_.plant.devices.push_back(device);
    return plan_.plant.devices.back();
  }

  Random random_;
  bool equal_gateways_ = false;
  TreePlan plan_;
  std::vector<Level> levels_;
};

// `equal_gateways`: those on one bus beneath are of one type, and distinguished by their serial numbers.
inline TreePlan tree_plan(std::uint64_t seed, bool equal_gateways = false) {
  return TreePlanner(seed, equal_gateways).run();
}

inline TreePlan two_levels(std::uint64_t seed) { return TreePlanner(seed, false).run_two_levels(); }

}  // namespace berth::harness

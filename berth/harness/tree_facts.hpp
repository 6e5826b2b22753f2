// A tree of buses as it is (tree_world.hpp): who uses which node-ID, what the gateways have in their dictionaries.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "berth/harness/tree_plan.hpp"
#include "berth/multilevel/sub_bus.hpp"
#include "berth/plant/world.hpp"

namespace berth::harness {

class TreeFacts {
 public:
  // Both must outlive this.
  TreeFacts(const TreePlan& plan, plant::World& world) : plan_(&plan), world_(&world) {}

  [[nodiscard]] bool all_seats_are_right() const {
    return std::ranges::all_of(plan_->machine.slots, [&](const auto& slot) { return wrong_seat(slot).empty(); });
  }
  [[nodiscard]] std::string wrong_seat(const design::Slot& slot) const {
    std::vector<std::string> users;
    bool right = false;
    for (const auto& device : world_->devices()) {
      if (!device->powered() || device->bus().name() != slot.spec.name.bus) continue;
      if (device->device().node_id() != slot.spec.id) continue;
      users.push_back(device->name());
      const bool fits = device->truth().address.type() == slot.spec.type;
      right = fits && device->device().state() == NmtState::operational;
    }
    if (users.size() == 1 && right) return {};
    std::string text = fmt::format("  node-ID {} of slot {} is used by", slot.spec.id.value(), slot.spec.name.name);
    for (const auto& user : users) text += " " + user;
    return text + (users.empty() ? " no device\n" : "\n");
  }
  [[nodiscard]] std::string wrong_mandatory() const {
    std::string text;
    if (!plan_->mixed) return text;
    for (const auto& line : plan_->machine.beneath) {
      const auto& gateway = *line.gateway;
      for (const auto& device : world_->devices()) {
        const bool is_it = device->powered() && device->bus().name() == gateway.bus &&
                           device->device().node_id() == gateway.slot &&
                           plan_->plant.gateway_part(device->name()).ports != 0;
        if (!is_it || multilevel::is_mandatory(device->device().values(), gateway.port) == gateway.mandatory) continue;
        text += fmt::format("  5F00h:{:02X} of {} says that {} is {}\n", gateway.port, device->name(), line.name,
                            gateway.mandatory ? "optional" : "mandatory");
      }
    }
    return text;
  }
  // The slots that are lost with a device: its own, and all beneath it.
  [[nodiscard]] std::set<std::string> taken_by(const design::Slot& slot) const {
    std::set<std::string> names{slot.spec.name.name};
    std::vector<std::string> buses;
    const auto add = [&](std::string bus, NodeId gateway) {  // a copy: `buses` grows meanwhile
      for (const auto& line : plan_->machine.beneath) {
        const bool hangs_there = line.gateway->bus == bus && line.gateway->slot == gateway;
        if (hangs_there) buses.push_back(line.name);
      }
    };
    add(slot.spec.name.bus, slot.spec.id);
    for (std::size_t i = 0; i < buses.size(); ++i) {
      for (const auto& each : plan_->machine.slots) {
        if (each.spec.name.bus != buses[i]) continue;
        names.insert(each.spec.name.name);
        add(buses[i], each.spec.id);
      }
    }
    return names;
  }

 private:
  const TreePlan* plan_;
  plant::World* world_;
};

}  // namespace berth::harness

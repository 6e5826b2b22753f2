// Adds variety to a tree of buses (tree_plan.hpp): sister buses beneath one gateway with equal node-IDs, so that one
// path means two devices; spares that come blank or used, one or two for a slot; devices of every kind that is searched
// for; slow devices beside quick ones; gateways whose EMCYs the gateway above does not forward unchanged. All of it is
// drawn with its own random numbers after the tree: the trees themselves do not change.
#pragma once

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "berth/harness/tree_plan.hpp"

namespace berth::harness {

class TreeMixer {
 public:
  explicit TreeMixer(TreePlan plan) : plan_(std::move(plan)), random_(plan_.seed ^ 0x3175'7EE5) {}

  TreePlan run() {
    plan_.mixed = true;
    plan_.calm = random_.below(5) < 2;
    if (random_.below(2) == 0) sister();
    if (random_.below(4) == 0) forget_layouts();
    more_spares();
    for (auto& spare : plan_.spares) used(spare.fresh);
    seconds();
    for (const auto& line : plan_.machine.beneath) kinds(line.name);
    for (const auto& line : plan_.machine.beneath) times(line.name);
    return std::move(plan_);
  }

 private:
  using Device = plant::PlantDevice;

  bool one_in(std::uint64_t n) { return random_.below(n) == 0; }
  plant::Duration between(plant::Duration low, plant::Duration high) {
    return plant::Duration(random_.between(low.count(), high.count()));
  }
  Device& device(const std::string& name) { return *std::ranges::find(plan_.plant.devices, name, &Device::name); }
  [[nodiscard]] bool is_part_of_gateway(const std::string& name) const { return plan_.plant.gateway_part(name).any; }

  // ---- sister buses ----

  void sister() {
    auto& gateways = plan_.plant.gateways;
    const auto at = random_.below(gateways.size());
    const std::string first = device(gateways[at].beneath.front()).bus;
    auto line = *plan_.machine.bus(first);
    const std::string name = first + " sister";
    line.name = name;
    line.gateway->port = 2;
    line.gateway->mandatory = one_in(2);
    add_bus(line);
    gateways[at].beneath.push_back(name + " port");
    // Takes node-IDs of the first bus, at least one.
    bool any = false;
    for (const auto& slot : plan_.machine.specs(first)) {
      if (any && one_in(3)) continue;
      any = true;
      const auto deeper = beneath_of(first, slot.id);
      if (!deeper.empty() && one_in(2)) {
        add_gateway(name, slot.id, at, deeper);
      } else {
        add_slot(name, slot.id, {1, static_cast<std::uint32_t>(1 + random_.below(3))});
      }
    }
  }

  // The same path elsewhere: a gateway of this node-ID on the sister bus, and beneath it a node-ID of the bus `like`.
  void add_gateway(const std::string& bus, NodeId id, std::size_t above, const std::string& like) {
    const std::string name = bus + " bus" + std::to_string(id.value());
    // A type of its own: otherwise it would be unknown which of two equal gateways this bus is beneath.
    add_slot(bus, id, {1, 0x8058 + 0x100U * id.value()});
    const std::string upper = plan_.machine.slots.back().spec.name.name;
    auto line = *plan_.machine.bus(bus);
    line.name = name;
    line.gateway = design::Gateway{.bus = bus, .slot = id, .mandatory = one_in(2)};
    add_bus(line);
    plant::PlantGateway made;
    made.above = upper;
    made.beneath = {name + " port"};
    plan_.plant.gateways.push_back(made);
    plan_.plant.gateways[above].speaks_layout.push_back(id.value());
    for (const auto& slot : plan_.machine.specs(like)) {
      if (slot.type.product < 0x58)
        return add_slot(name, slot.id, {1, static_cast<std::uint32_t>(1 + random_.below(3))});
    }
    add_slot(name, NodeId(2), {1, 1});
  }

  // A bus beneath a gateway, with the gateway's own node on it.
  void add_bus(const design::Bus& line) {
    plan_.machine.beneath.push_back(line);
    plan_.plant.buses.push_back({line.name, 0});
    auto& port = add_device(line.name, line.name + " port", {1, 0x59});
    port.node_id = line.master;
    port.source = plant::NodeIdSource::hard_coded;
    port.heartbeat = std::chrono::milliseconds(500);
    port.does.master = plant::PlantMaster{};
    port.does.master->flying = false;
  }

  void add_slot(const std::string& bus, NodeId id, TypeCode type) {
    design::Slot slot;
    slot.spec.name = {plan_.machine.name, bus, bus + " s" + std::to_string(id.value())};
    slot.spec.id = id;
    slot.spec.type = type;
    slot.spec.replacement = places::Replacement::automatic;
    slot.spec.mandatory = one_in(3);
    plan_.machine.slots.push_back(slot);
    add_device(bus, slot.spec.name.name, type);
  }

  Device& add_device(const std::string& bus, const std::string& name, TypeCode type) {
    Device made;
    made.name = name;
    made.bus = bus;
    const auto serial = static_cast<std::uint32_t>(100'000 + plan_.plant.devices.size());
    made.address = {type.vendor, type.product, 0, serial};
    made.response = {std::chrono::microseconds(200), std::chrono::microseconds(200 + random_.below(1800)), 0, {}};
    made.boot = std::chrono::milliseconds(20 + random_.below(300));
    plan_.plant.devices.push_back(std::move(made));
    return plan_.plant.devices.back();
  }

  // The bus beneath this gateway; empty: it is no gateway.
  [[nodiscard]] std::string beneath_of(const std::string& bus, NodeId id) const {
    for (const auto& line : plan_.machine.beneath) {
      if (line.gateway->bus == bus && line.gateway->slot == id) return line.name;
    }
    return {};
  }

  // The gateway above takes some gateways for plain devices: it reports their EMCYs about nodes beneath as their own.
  void forget_layouts() {
    for (auto& gateway : plan_.plant.gateways) {
      std::erase_if(gateway.speaks_layout, [&](std::uint8_t) { return one_in(2); });
    }
  }

  // ---- spares ----

  // A device can be exchanged if it is the only one of its type on its bus.
  void more_spares() {
    for (const auto& line : plan_.machine.beneath) {
      const auto specs = plan_.machine.specs(line.name);
      for (const auto& spec : specs) {
        const auto alike = std::ranges::count(specs, spec.type, &places::SlotSpec::type);
        const std::string worn = spec.name.name;
        const bool has_one = std::ranges::any_of(plan_.spares, [&](const auto& s) { return s.worn == worn; });
        if (alike == 1 && !has_one && !is_part_of_gateway(worn) && one_in(2))
          plan_.spares.push_back({worn, add_spare(worn, " spare")});
      }
    }
  }

  std::string add_spare(const std::string& worn, const std::string& name) {
    const auto& like = device(worn);
    const TypeCode type = like.address.type();
    add_device(std::string(like.bus), worn + name, type).plugged = false;
    return worn + name;
  }

  void seconds() {
    for (auto& spare : plan_.spares) {
      if (!one_in(3)) continue;
      spare.second = add_spare(spare.worn, " second spare");
      spare.later = std::chrono::milliseconds(one_in(4) ? random_.below(1000) : 1000 + random_.below(4000));
      used(spare.second);
    }
  }

  // Blank, or with the slot's own node-ID stored, another slot's, the master's, one of another machine.
  void used(const std::string& name) {
    auto& spare = device(name);
    const auto specs = plan_.machine.specs(spare.bus);
    const auto own = std::ranges::find(specs, spare.address.type(), &places::SlotSpec::type);
    std::vector<NodeId> ids;
    switch (random_.below(6)) {
      case 0: return;
      case 1: ids = {own->id}; break;
      case 2: {
        for (const auto& spec : specs) {
          if (spec.id != own->id) ids.push_back(spec.id);
        }
        break;
      }
      case 3: ids = {plan_.machine.bus(spare.bus)->master}; break;
      default: break;
    }
    while (ids.empty()) {
      const NodeId id(static_cast<std::uint8_t>(1 + random_.below(127)));
      const bool known = plan_.machine.slot(spare.bus, id) != nullptr || id == plan_.machine.bus(spare.bus)->master;
      if (!known) ids.push_back(id);
    }
    spare.source = plant::NodeIdSource::nonvolatile;
    spare.node_id = ids[random_.below(ids.size())];
  }

  // ---- devices ----

  template <class Act>
  void each_device(const std::string& bus, const Act& act) {
    for (auto& d : plan_.plant.devices) {
      if (d.bus == bus && !d.does.master) act(d);
    }
  }

  void kinds(const std::string& bus) {
    using enum plant::Speaks;
    if (one_in(2)) return;
    each_device(bus, [&](Device& d) {
      switch (random_.below(8)) {
        case 0: d.speaks = {lss}; break;
        case 1: d.speaks = {fastscan}; break;
        case 2: d.speaks = {feedback_29}; break;
        case 3: d.speaks = {feedback_11}; break;
        case 4: d.speaks = {lss, rand_resume}; break;
        default: break;
      }
    });
  }

  void times(const std::string& bus) {
    using namespace std::chrono_literals;
    const auto way = random_.below(3);
    if (way == 0) return;
    each_device(bus, [&](Device& d) {
      // In the third way, only devices that are brought later are slow.
      const bool slow = way == 1 ? one_in(2) : !d.plugged;
      d.response = {200us, 200us, 0, {}};
      if (slow) d.response.min = way == 1 ? between(200us, 9ms) : between(2ms, 9ms);
      if (slow) d.response.max = between(d.response.min, 9ms);
      if (slow && one_in(3)) {
        d.response.outlier_ppm = 10'000;
        d.response.outlier = between(10ms, 40ms);
      }
      d.storing.time = between(1ms, 200ms);
      d.storing.deaf = one_in(8);
    });
  }

  TreePlan plan_;
  Random random_;
};

inline TreePlan mix(TreePlan plan) { return TreeMixer(std::move(plan)).run(); }

}  // namespace berth::harness

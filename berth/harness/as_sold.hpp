// Draws a world with devices as sold in shops: equal ones with node-ID switches, ones that report only a part of 1018h,
// and blank ones without serial numbers. Uses its own random numbers, so that worlds without them do not change.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "berth/harness/description_of.hpp"
#include "berth/harness/world_plan.hpp"

namespace berth::harness {

class AsSold {
 public:
  AsSold(WorldPlan& plan, Folders folders) : plan_(&plan), folders_(std::move(folders)), random_(plan.seed ^ 0x501D) {}

  void draw() {
    if (random_.below(3) != 0) return;
    const auto& buses = plan_->machine.buses;
    bus_ = buses[random_.below(buses.size())].name;
    if (random_.below(3) == 0) return blank_ones();
    switched_ones();
  }

 private:
  [[nodiscard]] std::vector<plant::PlantDevice*> fitting(const places::SlotSpec& spec) const {
    std::vector<plant::PlantDevice*> all;
    for (auto& d : plan_->plant.devices) {
      if (d.bus == spec.name.bus && d.address.type() == spec.type) all.push_back(&d);
    }
    return all;
  }

  // One to all slots of the bus are for devices of one type, each with the slot's node-ID on its switches.
  void switched_ones() {
    std::vector<design::Slot*> slots;
    for (auto& s : plan_->machine.slots) {
      if (s.spec.name.bus == bus_) slots.push_back(&s);
    }
    const TypeCode type = slots[random_.below(slots.size())]->spec.type;
    // Other devices of the type stay as they are: blank devices beside equal ones with node-IDs.
    std::vector<std::vector<plant::PlantDevice*>> owners;
    for (auto* const slot : slots) owners.push_back(fitting(slot->spec));
    const auto how = random_.below(4);
    const bool with_serial = how == 0;
    const bool with_lss = random_.below(3) == 0;
    const bool is_said = random_.below(2) == 0;
    const unsigned parts = how == 1 ? static_cast<unsigned>(1 + random_.below(3)) : 4;
    for (std::size_t i = 0; i < slots.size(); ++i) {
      auto& spec = slots[i]->spec;
      if (spec.type != type && random_.below(2) == 0) continue;
      const bool was = spec.type == type;
      const auto was_revision = spec.revision;
      if (is_said) spec.assign = places::Assign::fixed;
      if (!was) {
        spec.type = type;
        spec.config.clear();
      }
      spec.rule = places::RevisionRule::any;
      spec.revision.reset();
      bool first = true;
      for (auto* const d : owners[i]) {
        if (std::ranges::find(taken_, d) != taken_.end()) continue;
        if (was && was_revision && d->address.revision != *was_revision) continue;
        // The slot's device, and its spare among those that are not plugged in.
        if (!first && d->plugged) continue;
        first = false;
        taken_.push_back(d);
        set_switches(*d, spec, type, with_serial, with_lss, parts);
      }
    }
    // A device may have come with one of their node-IDs, be a clone, or be one too many: the end is not determined.
    plan_->solvable = false;
  }

  void set_switches(plant::PlantDevice& d, const places::SlotSpec& spec, TypeCode type, bool with_serial, bool with_lss,
                    unsigned parts) {
    d.source = plant::NodeIdSource::switches;
    d.node_id = spec.id;
    d.storing.power_cycle_after = false;
    std::erase(plan_->waiting, d.name);
    const std::uint32_t serial = with_serial ? d.address.serial : 0;
    d.address = {type.vendor, type.product, 0, serial};
    d.eds = d.eds_path = type == type_pump ? folders_.example("pump.eds") : std::string();
    if (type != type_pump && parts < 4) d.eds = d.eds_path = description_of(folders_.own, type, parts);
    if (!with_lss) d.speaks = {};
  }

  // All devices of one type are blank and have no serial number. The first is there from the beginning, and the others
  // are plugged in later, one after the other.
  void blank_ones() {
    std::vector<design::Slot*> slots;
    for (auto& s : plan_->machine.slots) {
      if (s.spec.name.bus == bus_) slots.push_back(&s);
    }
    auto& spec = slots[random_.below(slots.size())]->spec;
    const auto one_by_one = random_.below(2) == 0;
    rt::Duration later{0};
    for (auto* const slot : slots) {
      if (slot->spec.type == spec.type && one_by_one) slot->spec.when_ambiguous = places::WhenAmbiguous::one_at_a_time;
    }
    // AND does not report the revision number.
    const auto one_revision = spec.revision.value_or(0);
    bool first = true;
    for (auto* const d : fitting(spec)) {
      d->address.serial = 0;
      d->address.revision = one_revision;
      if (!d->plugged) continue;
      if (!std::exchange(first, false)) {
        plan_->solvable = false;
        later += rt::Duration(random_.between(rt::Duration(1s).count(), rt::Duration(12s).count()));
        d->plugged = false;
        plant::PlantEvent e;
        e.action = plant::Action::plug;
        e.device = d->name;
        e.delay = later;
        plan_->later.push_back(e);
      }
    }
  }

  WorldPlan* plan_;
  Folders folders_;
  Random random_;
  std::string bus_;
  std::vector<plant::PlantDevice*> taken_;
};

// The world of this seed.
inline WorldPlan plan_world(std::uint64_t seed, Draws draws, const Folders& folders) {
  WorldPlan plan = Planner(seed, draws, folders).make();
  if (draws.as_sold) AsSold(plan, folders).draw();
  return plan;
}

}  // namespace berth::harness

// What goes wrong in a tree of buses (tree_world.hpp), and what a person does about it.
#pragma once

#include <fmt/format.h>

#include <functional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/harness/tree_plan.hpp"
#include "berth/plant/world.hpp"

namespace berth::harness {

class TreeTroubles {
 public:
  // All must stay. `turn`: Berth dies, or begins where none runs. `note`: takes a line of the log.
  TreeTroubles(const TreePlan& plan, plant::World& world, Random& random, std::function<void()> turn,
               std::function<void(const std::string&)> note)
      : plan_(&plan),
        world_(&world),
        random_(&random),
        turn_(std::move(turn)),
        note_(std::move(note)),
        spares_(plan.spares) {}

  void trouble() {
    if (plan_->calm || (plan_->mixed && random_->below(4) == 0)) return exchange();
    switch (random_->below(8)) {
      case 0: return cut(any_bus());
      case 1: return join(any_bus().name);
      case 2:
      case 3: {
        auto& device = any_device();
        note_(fmt::format("power {} {}", device.powered() ? "off" : "on", device.name()));
        return device.power(!device.powered());
      }
      case 4: {
        auto& device = any_device();
        note_("reset " + device.name());
        if (device.powered()) device.reset();
        return;
      }
      case 5: return exchange();
      case 6: return turn_();
      default: return lose_frames(any_bus().name);
    }
  }

  // Cables, frames and power are as they were; not who was exchanged.
  void mend() {
    for (const auto* const bus : plan_->machine.all_buses()) {
      join(bus->name);
      world_->bus(bus->name)->faults().draw_from({});
    }
    for (const auto& device : world_->devices()) {
      if (device->plugged()) device->power(true);
    }
  }
  [[nodiscard]] const std::vector<TreePlan::Spare>& exchanged() const noexcept { return exchanged_; }

  // The user removes devices without a slot: they would get the slot of a device that is without power.
  void clear_away() {
    for (const auto& device : world_->devices()) {
      const auto* const slot = plan_->machine.slot(device->bus().name(), device->device().node_id());
      if (device->plan().does.master || !device->powered() || slot != nullptr) continue;
      note_("unplug " + device->name());
      device->unplug();
    }
  }

 private:
  plant::SimDevice& any_device() {
    for (;;) {
      auto& device = *world_->devices()[random_->below(world_->devices().size())];
      if (!device.plan().does.master && device.plugged()) return device;
    }
  }
  const design::Bus& any_bus() {
    const auto all = plan_->machine.all_buses();
    return *all[random_->below(all.size())];
  }

  // The master of the bus hears nothing: Berth's own cable is cut, or that of the gateway's port.
  void cut(const design::Bus& bus) {
    if (cut_.contains(bus.name)) return;
    plant::PlantEvent event;
    event.action = plant::Action::cut_cable;
    event.bus = bus.name;
    event.nodes = {bus.own_port ? "master" : bus.name + " port"};
    note_("cut " + bus.name);
    if (world_->perform(event)) cut_.insert(bus.name);
  }
  void join(const std::string& bus) {
    if (cut_.erase(bus) == 0) return;
    plant::PlantEvent event;
    event.action = plant::Action::join;
    event.bus = bus;
    note_("join " + bus);
    static_cast<void>(world_->perform(event));
  }

  // The worn device goes for good, unless its slot waits for it: then it is brought back at the end.
  void exchange() {
    if (spares_.empty()) return;
    const auto at = spares_.begin() + static_cast<std::ptrdiff_t>(random_->below(spares_.size()));
    note_("exchange " + at->worn);
    exchanged_.push_back(*at);
    world_->find(at->worn)->unplug();
    // At once, or when the worn device is missed.
    const auto pause = std::chrono::milliseconds(plan_->mixed ? random_->below(6000) : 0);
    bring(at->fresh, pause);
    if (!at->second.empty()) bring(at->second, pause + at->later);
    spares_.erase(at);
  }
  void bring(const std::string& name, std::chrono::milliseconds later) {
    auto* const device = world_->find(name);
    if (later.count() == 0) return device->plug();
    world_->sim().after(later, [this, device] {
      note_(fmt::format("plug {} with {}", device->name(), device->plan().node_id.value()));
      device->plug();
    });
  }

  void lose_frames(const std::string& bus) {
    const auto one_in_a_million = static_cast<std::uint32_t>(random_->below(2) * random_->below(2000));
    note_(fmt::format("frames lost on {}: {} per million", bus, one_in_a_million));
    world_->bus(bus)->faults().draw_from(
        {.disturbed_per_million = one_in_a_million, .overrun_per_million = one_in_a_million / 2});
  }

  const TreePlan* plan_;
  plant::World* world_;
  Random* random_;
  std::function<void()> turn_;
  std::function<void(const std::string&)> note_;
  std::vector<TreePlan::Spare> spares_;  // on the shelf
  std::set<std::string> cut_;
  std::vector<TreePlan::Spare> exchanged_;
};

}  // namespace berth::harness

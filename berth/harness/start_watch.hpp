// Does Berth ever start a device that is not its slot's? By the ground truth, whatever the device reports.
#pragma once

#include <algorithm>
#include <map>
#include <string>
#include <utility>

#include "berth/design/machine.hpp"
#include "berth/plant/world.hpp"

namespace berth::harness {

class StartWatch final : public plant::World::Observer {
 public:
  StartWatch(plant::World& world, const design::Machine& machine) : world_(&world), machine_(&machine) {
    world.add_observer(*this);
  }
  ~StartWatch() { world_->remove_observer(*this); }
  StartWatch(const StartWatch&) = delete;
  StartWatch& operator=(const StartWatch&) = delete;
  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }

 private:
  void plant_changed(const plant::SimDevice& changed) noexcept override {
    const auto t = changed.truth();
    const bool was = std::exchange(runs_[t.name], t.powered && t.state == NmtState::operational);
    if (was || !runs_[t.name] || !failure_.empty() || shares(t)) return;
    const design::Slot* const slot = machine_->slot(t.bus, t.active);
    const std::string what = t.name + " was started with node-ID " + std::to_string(t.active.value());
    if (slot == nullptr) {
      failure_ = what + ", which is no slot's";
    } else if (!places::fits(slot->spec, t.address)) {
      failure_ = what + ", and does not fit slot " + slot->spec.name.name;
    }
  }
  // NMT addresses node-IDs: a command reaches all devices with that node-ID.
  [[nodiscard]] bool shares(const plant::Truth& t) const {
    return std::ranges::any_of(world_->devices(), [&](const auto& d) {
      const auto o = d->truth();
      return o.name != t.name && o.powered && o.bus == t.bus && o.active == t.active;
    });
  }

  plant::World* world_;
  const design::Machine* machine_;
  std::map<std::string, bool> runs_;
  std::string failure_;
};

}  // namespace berth::harness

// Checks that a device running in its slot is as the slot's file wants it, whenever a device changes.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <string>

#include "berth/harness/rig.hpp"
#include "berth/manager/configuration.hpp"

namespace berth::harness {

// What differs, in words; empty: nothing.
inline std::string wrong_configuration(const manager::Configuration& configuration, plant::SimDevice& device) {
  const auto& d = device.device();
  const auto wanted = manager::wanted(configuration, d.node_id());
  if (!wanted) return "the configuration cannot be had";
  for (const auto& entry : wanted->entries) {
    if (entry.object.index == 0x1017) continue;  // the machine file sets it
    const auto held = d.values().bytes(entry.object);
    if (std::ranges::equal(held, entry.bytes)) continue;
    return entry.name + " is " + manager::print_value(entry.type, held) + " instead of " +
           manager::print_value(entry.type, entry.bytes);
  }
  return {};
}

// The wanted configuration of each slot's device: its file (`config =`), else the settings of the machine's links.
class SlotConfigurations {
 public:
  explicit SlotConfigurations(const design::Machine& machine, const manager::SlotSettings& linked = {})
      : linked_(linked) {
    for (const auto& slot : machine.slots) {
      if (slot.spec.config.empty() || files_.contains(slot.spec.config)) continue;
      auto loaded = manager::load_configuration(slot.spec.config);
      if (!loaded.usable()) std::abort();
      files_.emplace(slot.spec.config, std::move(loaded.configuration));
    }
  }
  void set_linked(const manager::SlotSettings& linked) { linked_ = linked; }
  [[nodiscard]] bool empty() const noexcept { return files_.empty() && linked_.empty(); }
  // What the device lacks of its configuration, in words; empty: nothing.
  [[nodiscard]] std::string check(plant::SimDevice& device, const design::Slot& slot) const {
    const auto file = files_.find(slot.spec.config);
    if (file != files_.end()) return wrong_configuration(file->second, device);
    const auto linked = linked_.find(slot.spec.name.name);
    return linked == linked_.end() ? std::string() : wrong_configuration(*linked->second, device);
  }

 private:
  std::map<std::string, manager::Configuration> files_;
  manager::SlotSettings linked_;
};

// Berth must never start a slot's device with anything but its configuration.
class ConfigWatch final : public plant::World::Observer {
 public:
  ConfigWatch(plant::World& world, const design::Machine& machine, places::SlotStore& store)
      : world_(&world), machine_(&machine), store_(&store), wanted_(machine) {
    if (!wanted_.empty()) world.add_observer(*this);
  }
  ~ConfigWatch() { world_->remove_observer(*this); }

  // Adds the settings of the machine's links to `config =`.
  void add(const manager::SlotSettings& settings) {
    if (wanted_.empty() && !settings.empty()) world_->add_observer(*this);
    wanted_.set_linked(settings);
  }

  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }
  // Empty: the device is as its slot's file wants it.
  [[nodiscard]] std::string check(plant::SimDevice& device, const design::Slot& slot) const {
    return wanted_.check(device, slot);
  }

 private:
  void plant_changed(const plant::SimDevice& changed) noexcept override {
    const auto t = changed.truth();
    const bool was = std::exchange(runs_[t.name], t.state == NmtState::operational && t.powered);
    if (was || !runs_[t.name] || !failure_.empty()) return;
    const design::Slot* const slot = machine_->slot(t.bus, t.active);
    if (slot == nullptr || !sits_there(t, *slot)) return;
    const auto wrong = check(*world_->find(t.name), *slot);
    if (!wrong.empty()) failure_ = t.name + " was started in slot " + slot->spec.name.name + ", and " + wrong;
  }
  // Does not judge another device under the slot's node-ID.
  [[nodiscard]] bool sits_there(const plant::Truth& t, const design::Slot& slot) const {
    const auto records = store_->load(machine_->name);
    if (!records) return false;
    const auto r = std::ranges::find(*records, slot.spec.name, &places::SlotRecord::name);
    if (r == records->end() || !r->confirmed || !t.is(r->confirmed->device)) return false;
    return std::ranges::count_if(world_->devices(), [&](const auto& d) {
             const auto o = d->truth();
             return o.powered && o.bus == t.bus && o.active == t.active;
           }) == 1;
  }

  plant::World* world_;
  const design::Machine* machine_;
  places::SlotStore* store_;
  SlotConfigurations wanted_;
  std::map<std::string, bool> runs_;
  std::string failure_;
};

}  // namespace berth::harness

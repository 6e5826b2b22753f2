// What `EndJudge` looks at: the devices as they are, the rows of the store, and what of them no master can change.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "berth/harness/duplicate_watch.hpp"
#include "berth/harness/rig.hpp"

namespace berth::harness {

class EndFacts {
 protected:
  EndFacts(Rig& rig, const design::Machine& machine, const DuplicateWatch& watch)
      : rig_(&rig), machine_(&machine), watch_(&watch) {}
  ~EndFacts() = default;
  EndFacts(const EndFacts&) = default;
  EndFacts& operator=(const EndFacts&) = default;

  // Reads them as they are now; false: the store cannot be read.
  [[nodiscard]] bool look() {
    truth_ = rig_->world().truth();
    const auto records = rig_->store().load(machine_->name);
    if (records) records_ = *records;
    return records.has_value();
  }

  [[nodiscard]] static bool is_present(const plant::Truth& t) { return t.powered && !t.booting; }
  [[nodiscard]] const plant::Truth* present(const Identity& device, const std::string& bus) const {
    const auto it = std::ranges::find_if(
        truth_, [&](const plant::Truth& t) { return is_present(t) && t.bus == bus && t.is(device); });
    return it == truth_.end() ? nullptr : &*it;
  }
  // Devices without serial numbers, known by the node-IDs of their slots. LSS cannot distinguish one with another
  // node-ID from them.
  [[nodiscard]] bool told_apart(const plant::Truth& a, const plant::Truth& b) const {
    return a.address.serial == 0 && a.active != b.active && record_of(a) != nullptr && record_of(b) != nullptr;
  }
  // Berth cannot distinguish two devices with one LSS address on one bus by any question: it reports them, and they are
  // not judged. Twins on two buses are two devices like any others.
  [[nodiscard]] bool clones(const plant::Truth& t) const {
    return std::ranges::count_if(truth_, [&](const plant::Truth& o) {
             return is_present(o) && o.bus == t.bus && o.address == t.address && !told_apart(o, t);
           }) > 1;
  }
  [[nodiscard]] bool any_clones() const {
    return std::ranges::any_of(truth_, [&](const auto& t) { return is_present(t) && clones(t); });
  }
  [[nodiscard]] const places::SlotRecord* record_of(const places::SlotName& name) const {
    const auto it = std::ranges::find(records_, name, &places::SlotRecord::name);
    return it == records_.end() ? nullptr : &*it;
  }
  [[nodiscard]] const places::SlotRecord* record_of(const plant::Truth& t) const {
    const auto it = std::ranges::find_if(
        records_, [&](const auto& r) { return r.name.bus == t.bus && r.device() && t.is(*r.device()); });
    return it == records_.end() ? nullptr : &*it;
  }

  // For a device without a serial number that uses another node-ID than its slot's: the row has its stored one.
  [[nodiscard]] const places::SlotRecord* row_of_memory(const plant::Truth& t) const {
    const auto it = std::ranges::find_if(
        records_, [&](const auto& r) { return r.name.bus == t.bus && r.device() && t.is_or_will_be(*r.device()); });
    return it == records_.end() ? nullptr : &*it;
  }

  // Fastscan finds no device with a node-ID: if the machine file allows no other method, Berth cannot know such a
  // device's address, so it cannot make the device leave. It reports that to the user.
  [[nodiscard]] bool out_of_reach(const plant::Truth& t) const {
    const auto& method = machine_->bus(t.bus)->discovery;
    const bool fastscan = method.find("fastscan") != std::string::npos || method == "planner-feedback";
    return fastscan && t.active.configured() && watch_->owned(t.name) != t.active;
  }
  // Two devices with one address hold its slot's node-ID, and no master can distinguish them: the user must remove one.
  [[nodiscard]] bool waits_for_clones(const plant::Truth& t) const {
    return std::ranges::any_of(truth_, [&](const plant::Truth& clone) {
      const design::Slot* const slot = machine_->slot(t.bus, clone.active);
      return is_present(clone) && clones(clone) && clone.bus == t.bus && slot != nullptr &&
             places::fits(slot->spec, t.address);
    });
  }
  [[nodiscard]] bool shared_out_of_reach(const plant::Truth& t) const {
    return std::ranges::any_of(truth_, [&](const plant::Truth& o) {
      return o.name != t.name && is_present(o) && o.bus == t.bus && o.active == t.active && out_of_reach(o);
    });
  }

  // The device sat in a slot before, and is used again when the user says so; meanwhile its switches keep its node-ID.
  [[nodiscard]] bool waits_for_a_word(const plant::Truth& t) const {
    const auto lines = rig_->store().history_of({t.address, {machine_->name, t.bus}});
    const bool used = lines && record_of(t) == nullptr && places::former_seat(*lines).has_value();
    return used && rig_->device(t.name).plan().source == plant::NodeIdSource::switches;
  }

  // Only the user can move one of the two.
  [[nodiscard]] bool shared_with_switches(const plant::Truth& t) const {
    const auto has_switches = [&](const plant::Truth& o) {
      return rig_->device(o.name).plan().source == plant::NodeIdSource::switches;
    };
    return std::ranges::any_of(truth_, [&](const plant::Truth& o) {
      return o.name != t.name && is_present(o) && o.bus == t.bus && o.active == t.active &&
             (has_switches(o) || has_switches(t));
    });
  }
  // Only the user can move a device whose switches set another slot's node-ID.
  [[nodiscard]] std::ptrdiff_t held_by_switches(const design::Slot& slot) const {
    return std::ranges::count_if(truth_, [&](const plant::Truth& o) {
      return is_present(o) && o.bus == slot.spec.name.bus && o.active == slot.spec.id &&
             rig_->device(o.name).plan().source == plant::NodeIdSource::switches;
    });
  }
  // Its switches, or the machine file for its type, fix the node-ID: no master can change it. If `replacement` is
  // "ask", no slot takes the device without the user's word.
  [[nodiscard]] bool a_hand_must(const plant::Truth& t) const {
    const design::Slot* const there = machine_->slot(t.bus, t.active);
    const auto* const row = there == nullptr ? nullptr : record_of(there->spec.name);
    const bool is_free = row != nullptr && !row->device();
    const bool takes = there != nullptr && places::fits(there->spec, t.address);
    if (takes && (is_free || there->spec.replacement == places::Replacement::automatic)) return false;
    bool all_fixed = false;
    for (const auto& slot : machine_->slots) {
      if (slot.spec.name.bus != t.bus || !places::fits(slot.spec, t.address)) continue;
      if (slot.spec.assign == places::Assign::lss) all_fixed = false;
      if (slot.spec.assign == places::Assign::lss) break;
      all_fixed = true;
    }
    return all_fixed || rig_->device(t.name).plan().source == plant::NodeIdSource::switches;
  }
  // It has no serial number, and an equal device is on its bus: LSS addresses both at once, so it keeps its node-ID.
  [[nodiscard]] bool cannot_be_addressed(const plant::Truth& t) const {
    return t.address.serial == 0 && std::ranges::any_of(truth_, [&](const plant::Truth& o) {
             return o.name != t.name && is_present(o) && o.bus == t.bus && o.address == t.address;
           });
  }

  // Another device with this address has the node-ID in its memory: a request to one of them reached both.
  [[nodiscard]] bool clone_has(const plant::Truth& t, NodeId id) const {
    return std::ranges::any_of(truth_, [&](const plant::Truth& o) {
      return o.name != t.name && o.bus == t.bus && o.address == t.address && o.persistent == id;
    });
  }
  Rig* rig_;
  const design::Machine* machine_;
  const DuplicateWatch* watch_;
  std::vector<plant::Truth> truth_;
  std::vector<places::SlotRecord> records_;
};

}  // namespace berth::harness

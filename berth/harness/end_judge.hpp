// The judgement after all faults have ended: does every device sit where it must, and do Berth, its store and the
// devices' memories agree? See docs/faults.md.
#pragma once

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "berth/discovery/discovery.hpp"
#include "berth/harness/config_watch.hpp"
#include "berth/harness/end_facts.hpp"

namespace berth::harness {

// Which devices fit which free slots: `edges[slot][device]`.
struct Choice {
  std::vector<std::vector<bool>> edges;

  // How many devices can be seated at once, and in how many ways.
  struct Result {
    std::size_t seated = 0;
    std::size_t ways = 0;
  };
  [[nodiscard]] Result solve() const {
    Result result;
    if (edges.empty()) return result;
    std::vector<bool> used(edges.front().size());
    walk(0, 0, used, result);
    return result;
  }

 private:
  void walk(std::size_t slot, std::size_t seated, std::vector<bool>& used, Result& result) const {
    if (slot == edges.size()) {
      if (seated > result.seated) result = {seated, 0};
      if (seated == result.seated) ++result.ways;
      return;
    }
    walk(slot + 1, seated, used, result);
    for (std::size_t d = 0; d < used.size(); ++d) {
      if (!edges[slot][d] || used[d]) continue;
      used[d] = true;
      walk(slot + 1, seated + 1, used, result);
      used[d] = false;
    }
  }
};

class EndJudge final : private EndFacts {
 public:
  EndJudge(Rig& rig, const design::Machine& machine, const DuplicateWatch& watch, const ConfigWatch& configured)
      : EndFacts(rig, machine, watch), configured_(&configured) {}

  // The first error on this bus, or on all buses (""); empty: none.
  [[nodiscard]] std::string wrong(const std::string& bus = {}) {
    wrong_.clear();
    const auto counts = [&](const std::string& name) { return bus.empty() || name == bus; };
    const auto blanks = rig_->store().unfinished_blanks();
    if (!look() || !blanks) return "the store cannot be read";
    for (std::size_t i = 0; i < rig_->networks(); ++i) {
      if (!counts(rig_->network(i).bus().name)) continue;
      for (const auto& s : rig_->network(i).report()) check_slot(s);
      check_free(rig_->network(i));
    }
    for (const auto& t : truth_) {
      if (counts(t.bus)) check_device(t);
    }
    for (const auto& blank : *blanks) {
      if (!counts(blank.bus)) continue;
      const auto* const t = present(blank.device, blank.bus);
      if (t != nullptr && !clones(*t)) say(t->name + " is there, and taking its node-ID away is not finished");
    }
    return wrong_;
  }

 private:
  void say(const std::string& text) {
    if (wrong_.empty()) wrong_ = text;
  }
  // ---- a slot: its row, its report, its device ----

  void check_slot(const operate::SlotReport& s) {
    using places::SlotState;
    const design::Slot* const slot = machine_->slot(s.bus, s.id);
    const places::SlotRecord* const row = record_of(slot->spec.name);
    if (row == nullptr) return say("slot " + s.name + " has no row in the store");
    // If no device has power, each attempt lasts a second, and the world may end during one.
    const bool dead = std::ranges::none_of(truth_, [&](const auto& t) { return t.bus == s.bus && t.powered; });
    if (s.state == SlotState::binding && dead) return;
    if (s.state == SlotState::unknown || s.state == SlotState::binding) {
      return say("slot " + s.name + " ended as " + places::name(s.state));
    }
    if (s.device != row->device()) return say("slot " + s.name + " and its row name two devices");
    const plant::Truth* const t = row->device() ? present(*row->device(), s.bus) : nullptr;
    if (t != nullptr && !clones(*t)) {
      check_seated(s, *slot, *row, *t);
    } else if (s.state == SlotState::operational || s.state == SlotState::present) {
      if (t == nullptr) say("slot " + s.name + " is " + places::name(s.state) + " and its device is not there");
    }
    if (s.state == SlotState::operational) check_operational(s, *slot);
  }

  void check_seated(const operate::SlotReport& s, const design::Slot& slot, const places::SlotRecord& row,
                    const plant::Truth& t) {
    using places::SlotState;
    const std::string who = "slot " + s.name + ": its device " + t.name;
    if (s.state == SlotState::power_cycle) return;
    // Two devices have one address, and one of them may use the slot's node-ID, too: nothing is started there.
    if (s.state == SlotState::duplicate && (any_clones() || shared_out_of_reach(t) || shared_with_switches(t))) return;
    // If two devices have one address, neither can be made to leave the slot's node-ID. What one of them was to save is
    // checked in the other when that is the only one there.
    const bool held = std::ranges::any_of(truth_, [&](const plant::Truth& o) {
      return is_present(o) && o.bus == t.bus && o.active == slot.spec.id && clones(o);
    });
    if (held || (s.state == SlotState::failed && clone_has(t, slot.spec.id))) return;
    if (s.state == SlotState::failed && held_by_switches(slot) > 0) return;
    if (row.intended) return say(who + " is there, and what was asked of it is not confirmed");
    if (row.confirmed->id != slot.spec.id) return say(who + " is confirmed under another node-ID");
    if (t.active != slot.spec.id) return say(who + " uses node-ID " + std::to_string(t.active.value()));
    // The other device with its address, now absent, stored it; this one has the slot's own node-ID as a loan.
    if (t.persistent != slot.spec.id && !clone_has(t, slot.spec.id) && !cannot_be_addressed(t))
      return say(who + " is confirmed and has stored " + std::to_string(t.persistent.value()));
    if (s.state != SlotState::operational)
      return say(who + " is there, and the slot is " + places::name(s.state) + ": " + s.reason);
  }

  void check_operational(const operate::SlotReport& s, const design::Slot& slot) {
    unsigned holders = 0;
    bool right = false;
    for (const auto& t : truth_) {
      if (!t.powered || t.active != s.id || t.bus != s.bus) continue;
      ++holders;
      const bool its_own = s.device && t.is(*s.device);
      right = right || (its_own && t.state == NmtState::operational);
      if (!its_own || clones(t)) continue;
      const auto wrong = configured_->check(rig_->device(t.name), slot);
      if (!wrong.empty()) say("slot " + s.name + " is operational, and " + wrong);
    }
    if (!right) say("slot " + s.name + " is told operational and its device is not");
    if (holders > 1 && !any_clones()) say("two devices hold the node-ID of operational slot " + s.name);
  }

  // ---- a device: does it sit where its memory says? ----

  void check_device(const plant::Truth& t) {
    const places::SlotRecord* const row = record_of(t);
    if (row != nullptr && row->confirmed && !row->intended && !is_present(t) && !clone_has(t, row->confirmed->id) &&
        t.persistent != row->confirmed->id) {
      say("the store has " + t.name + " confirmed as node-ID " + std::to_string(row->confirmed->id.value()) +
          ", and its memory has " + std::to_string(t.persistent.value()));
    }
    check_owned(t, row != nullptr ? row : row_of_memory(t));
    if (!is_present(t) || clones(t) || !t.active.configured()) return;
    const design::Bus* const bus = machine_->bus(t.bus);
    if (out_of_reach(t) && shared_out_of_reach(t)) return;
    if (waits_for_clones(t) || shared_with_switches(t) || a_hand_must(t) || waits_for_a_word(t)) return;
    if (t.active == bus->master) say(t.name + " holds the master's node-ID");
    const design::Slot* const slot = machine_->slot(t.bus, t.active);
    if (slot == nullptr) return;
    if (out_of_reach(t)) return;
    const places::SlotRecord* const there = record_of(slot->spec.name);
    if (there == nullptr || !there->device() || !t.is(*there->device()))
      say(t.name + " holds the node-ID of slot " + slot->spec.name.name + " and does not sit there");
  }
  // In the store, a node-ID that Berth wrote into a memory stays that device's, present or absent.
  void check_owned(const plant::Truth& t, const places::SlotRecord* row) {
    const NodeId id = watch_->owned(t.name);
    if (!id.configured() || watch_->given_up(t, id)) return;
    if (row == nullptr ? clone_has(t, NodeId()) : clone_has(t, row->confirmed ? row->confirmed->id : row->intended->id))
      return;
    if (machine_->slot(t.bus, id) == nullptr) return;
    const bool kept =
        row != nullptr && ((row->intended && row->intended->id == id) || (row->confirmed && row->confirmed->id == id));
    if (!kept)
      say("node-ID " + std::to_string(id.value()) + " stands, by Berth, in the memory of " + t.name +
          ", and no slot of the store says so");
  }

  // ---- free slots: does every device sit that can? ----

  // The published procedures wait 10 ms for an answer, frames included: a slower device may be missed forever, and a
  // device after such a one, or after clones, is not reached. Auto and the planners have neither limit.
  [[nodiscard]] static bool published(const std::string& method) {
    return method.starts_with("fastscan") || method == "and";
  }
  [[nodiscard]] bool too_slow(const plant::PlantDevice& plan) const {
    const auto window = std::chrono::milliseconds(4);
    return plan.response.max > window || (plan.response.outlier_ppm > 0 && plan.response.outlier > window);
  }

  // A device that answers some questions after the window is not identified, and ends the search each time.
  [[nodiscard]] bool slow_in_front(const std::string& bus) const {
    return std::ranges::any_of(truth_, [&](const plant::Truth& t) {
      return is_present(t) && t.bus == bus && !t.active.configured() && too_slow(rig_->device(t.name).plan());
    });
  }

  [[nodiscard]] bool can_be_found(const plant::Truth& t, const std::string& method) const {
    if (method == "auto") return true;
    const auto& plan = rig_->device(t.name).plan();
    if (published(method) && too_slow(plan)) return false;
    const bool by_rand = plan.speaks.has(plant::Speaks::rand);
    if (method == "rand" || method == "planner-rand") return by_rand;
    if (method == "and") return plan.speaks.has(plant::Speaks::and_protocol);
    if (method == "identify") return plan.speaks.has(plant::Speaks::lss);
    // Fastscan, with and without feedback, finds devices without a node-ID (CiA 305).
    return plan.speaks.has(plant::Speaks::fastscan) && !t.active.configured();
  }

  void check_free(const operate::Network& network) {
    const auto& bus = network.bus();
    std::vector<const plant::Truth*> devices;
    used_ = false;
    for (const auto& t : truth_) {
      // The node-ID of a device with switches shows its slot: `check_device`.
      const bool here = is_present(t) && t.bus == bus.name && !clones(t) && record_of(t) == nullptr;
      const bool counts = here && rig_->device(t.name).plan().source != plant::NodeIdSource::switches;
      // A device that sat in a slot before is used again when the user says so (docs/machine-file.md).
      const auto lines = rig_->store().history_of({t.address, {machine_->name, t.bus}});
      const bool used = lines && places::former_seat(*lines).has_value();
      used_ = used_ || (here && used);
      const bool found = can_be_found(t, bus.discovery);
      used_ = used_ || (counts && !found);
      if (counts && !used && found) devices.push_back(&t);
    }
    const bool doubled =
        std::ranges::any_of(truth_, [&](const auto& t) { return is_present(t) && t.bus == bus.name && clones(t); });
    if (published(bus.discovery) && (doubled || slow_in_front(bus.name))) return;
    std::vector<const design::Slot*> slots;
    std::vector<const operate::SlotReport*> reports;
    const auto report = network.report();
    for (const auto& s : report) {
      const design::Slot* const slot = machine_->slot(s.bus, s.id);
      const places::SlotRecord* const row = record_of(slot->spec.name);
      if (row == nullptr || row->device() || waits_for_a_borrower(bus.name, s)) continue;
      slots.push_back(slot);
      reports.push_back(&s);
    }
    // Slots of one type are judged together: a device in one of them is not available to the others.
    for (std::size_t i = 0; i < slots.size(); ++i) check_group(i, slots, reports, devices);
  }

  // The slot's node-ID was lent to a device that left before it gave it back. The device has it while it has power;
  // only the device or the user can end the loan.
  [[nodiscard]] bool waits_for_a_borrower(const std::string& bus, const operate::SlotReport& s) const {
    const auto lent = rig_->store().lent();
    return lent && s.state == places::SlotState::empty && std::ranges::any_of(*lent, [&](const places::LentId& l) {
             return l.bus == bus && l.id == s.id && present(l.device, bus) == nullptr;
           });
  }

  void check_group(std::size_t at, const std::vector<const design::Slot*>& slots,
                   const std::vector<const operate::SlotReport*>& reports,
                   const std::vector<const plant::Truth*>& devices) {
    const TypeCode type = slots[at]->spec.type;
    // Two devices with one address use the slot's node-ID: neither can be made to leave it.
    if (std::ranges::any_of(truth_, [&](const auto& t) {
          return is_present(t) && clones(t) && t.bus == slots[at]->spec.name.bus && t.active == slots[at]->spec.id;
        }))
      return;
    std::vector<const design::Slot*> group;
    for (const auto* slot : slots) {
      if (slot->spec.type == type) group.push_back(slot);
    }
    std::vector<const plant::Truth*> fitting;
    for (const auto* t : devices) {
      if (std::ranges::any_of(group, [&](const auto* slot) { return places::fits(slot->spec, t->address); }))
        fitting.push_back(t);
    }
    const auto state = reports[at]->state;
    const std::string what =
        "slot " + reports[at]->name + " is " + places::name(state) + " (" + reports[at]->reason + ")";
    const bool open =
        std::ranges::any_of(fitting, [&](const auto* t) { return places::fits(slots[at]->spec, t->address); });
    if (!open) {
      const bool asks = state == places::SlotState::question && fitting.empty();
      if (asks && !used_ && !any_clones() && held_by_switches(*slots[at]) < 2) say(what + " and no device fits it");
      return;
    }
    // The slot's device has a fixed node-ID; only the user can take another device off it.
    if (slots[at]->spec.assign == places::Assign::fixed) return;
    const bool told = state == places::SlotState::failed || state == places::SlotState::duplicate ||
                      state == places::SlotState::wrong_type;
    const bool held = std::ranges::any_of(truth_, [&](const plant::Truth& o) {
      return is_present(o) && o.bus == slots[at]->spec.name.bus && o.active == slots[at]->spec.id && a_hand_must(o);
    });
    if (told && held) return;
    if (state != places::SlotState::question) return say(what + " and " + fitting.front()->name + " fits it");
    Choice choice;
    for (const auto* slot : group) {
      auto& row = choice.edges.emplace_back();
      for (const auto* t : fitting) row.push_back(places::fits(slot->spec, t->address));
    }
    // A device that the bus's method cannot find may have been found before, or by its node-ID.
    const auto candidates = std::ranges::count_if(truth_, [&](const auto& t) {
      return is_present(t) && t.bus == slots[at]->spec.name.bus && record_of(t) == nullptr &&
             std::ranges::any_of(group, [&](const auto* slot) { return places::fits(slot->spec, t.address); });
    });
    if (candidates != std::ssize(fitting)) return;
    if (choice.solve().ways == 1) return say(what + " and there is one way only to seat who is there");
    // Paper 1's rule 2: as many devices as slots, in the order of R_SN.
    std::ranges::sort(group, {}, [](const auto* slot) { return slot->spec.id; });
    std::ranges::sort(fitting, {}, [](const auto* t) { return t->address.r_sn(); });
    bool pairs = group.size() == fitting.size();
    for (std::size_t i = 0; pairs && i < group.size(); ++i) pairs = places::fits(group[i]->spec, fitting[i]->address);
    if (pairs) say(what + " and rule 2 tells who belongs there");
  }

  const ConfigWatch* configured_;
  bool used_ = false;  // a device that sat in a slot before is present without one
  std::string wrong_;
};

}  // namespace berth::harness

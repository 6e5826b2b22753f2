// A device that takes a node-ID only at power-on waits for the user. Checks that no other device is affected.
#pragma once

#include <algorithm>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "berth/harness/world_plan.hpp"

namespace berth::harness {

class WaitingJudge {
 public:
  // Both must outlive this.
  WaitingJudge(Rig& rig, const WorldPlan& plan) noexcept : rig_(&rig), plan_(&plan) {}
  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }

  // All slots are operational except those whose devices, or whose configurations, wait.
  [[nodiscard]] bool others_run() {
    for (std::size_t i = 0; i < rig_->networks(); ++i) {
      for (const auto& s : rig_->network(i).report()) {
        if (s.state != places::SlotState::operational && !is_excused(s)) return false;
      }
    }
    return true;
  }
  // Judges the start of a world. `without`: how long it takes if no device waits.
  void start(rt::Duration without, const std::function<bool()>& unsound) {
    // Twice: a search that misses a slow device is repeated, and that may happen more often with the waiting device.
    const rt::Duration limit = 2 * without + cost_of_waiting();
    if (rig_->run_until([&] { return others_run() || unsound(); }, limit)) return;
    failure_ = "beside a device that waits for its power cycle the others are not operational in " + text(limit) +
               ", and without it in " + text(without);
  }

  // Each of the other devices may lose its power for a moment. No search is under way, and only the slots of waiting
  // devices miss theirs.
  void lose(Random& random, const std::function<bool()>& unsound) {
    for (int i = 0; i < 6; ++i) {
      rig_->run_for(rt::Duration(random.between(0, rt::Duration(8s).count())));
      plant::SimDevice* const device = one_that_runs(random);
      if (device == nullptr || !others_run()) continue;
      device->power(false);
      rig_->run_for(rt::Duration(random.between(rt::Duration(100ms).count(), rt::Duration(500ms).count())));
      device->power(true);
      const rt::Duration limit = back_in(device->plan().bus);
      const bool back = rig_->run_until([&] { return unsound() || runs(*device); }, limit);
      if (back) continue;
      failure_ = device->name() + " was switched on, and is not operational after " + text(limit);
      return;
    }
  }
  [[nodiscard]] std::optional<operate::SlotReport> report_of(const std::string& slot) {
    for (std::size_t i = 0; i < rig_->networks(); ++i) {
      for (const auto& s : rig_->network(i).report()) {
        if (s.name == slot) return s;
      }
    }
    return std::nullopt;
  }
  // Powered, and with the address of the slot's device; null: there is none.
  [[nodiscard]] plant::SimDevice* device_of(const operate::SlotReport& slot) {
    for (const auto& d : rig_->world().devices()) {
      const auto t = d->truth();
      if (t.powered && t.bus == slot.bus && slot.device && t.is(*slot.device)) return d.get();
    }
    return nullptr;
  }

 private:
  [[nodiscard]] static bool by_power(const design::Slot& slot) noexcept {
    return slot.spec.configuring.activate == places::Activate::power_cycle;
  }
  [[nodiscard]] bool waits(const std::string& device) const {
    const auto* const plan = plan_->plant.device(device);
    return plan != nullptr && plan->storing.power_cycle_after;
  }
  [[nodiscard]] bool is_excused(const operate::SlotReport& s) {
    const design::Slot& slot = *plan_->machine.slot(s.bus, s.id);
    if (by_power(slot)) return true;
    const auto* const device = device_of(s);
    if (device != nullptr) return waits(device->name());
    // A device that must first give a node-ID up gets its slot after its power cycle, and keeps another's node-ID until
    // then.
    const bool waiting = s.state == places::SlotState::power_cycle || s.state == places::SlotState::binding;
    return waiting && std::ranges::any_of(rig_->world().devices(), [&](const auto& d) {
             const auto t = d->truth();
             const bool concerned = places::fits(slot.spec, t.address) || t.active == s.id;
             return t.bus == s.bus && t.powered && waits(t.name) && concerned;
           });
  }
  // What a waiting device may cost the others, once: it is told to store, and awaited as long as a device may need to
  // boot, since Berth cannot distinguish one that has not booted from a slow one; without a node-ID it is then told
  // again, in case it missed the first command. Three seconds for its identity, read under the new node-ID after each.
  // Never again: its slot reports that it waits.
  [[nodiscard]] rt::Duration cost_of_waiting() const {
    const auto& timing = plan_->machine.buses.front().timing;
    const auto many = static_cast<int>(plan_->waiting.size());
    return many * (2 * timing.store_timeout + timing.boot_timeout + rt::Duration(3s));
  }

  [[nodiscard]] bool runs(const plant::SimDevice& device) {
    const auto t = device.truth();
    const auto* const slot = plan_->machine.slot(t.bus, t.active);
    const auto report = slot == nullptr ? std::nullopt : report_of(slot->spec.name.name);
    return report && report->state == places::SlotState::operational && t.state == NmtState::operational;
  }
  // The time until a device is back: two seconds for a look round the bus that has just begun; three for its boot-up
  // (200 ms at most), identity, configuration, NMT start and the heartbeat after that; and for each waiting device on
  // its bus as long as that may occupy LSS just then, since a power cycle may not have been heard: it stores, and
  // restarts.
  [[nodiscard]] rt::Duration back_in(const std::string& bus) const {
    const auto many = std::ranges::count_if(plan_->plant.devices,
                                            [&](const auto& d) { return d.bus == bus && d.storing.power_cycle_after; });
    return 5s + many * (plan_->machine.bus(bus)->timing.store_timeout + rt::Duration(1s));
  }
  [[nodiscard]] plant::SimDevice* one_that_runs(Random& random) {
    std::vector<plant::SimDevice*> all;
    for (std::size_t i = 0; i < rig_->networks(); ++i) {
      for (const auto& s : rig_->network(i).report()) {
        auto* const device = device_of(s);
        const design::Slot& slot = *plan_->machine.slot(s.bus, s.id);
        // A device that is silent for long loses a slot with `replacement = "auto"`, and is searched for like a new
        // one.
        const bool keeps = slot.spec.replacement != places::Replacement::automatic && !by_power(slot);
        const bool good = device != nullptr && s.state == places::SlotState::operational && !waits(device->name());
        if (!good || !keeps) continue;
        all.push_back(device);
      }
    }
    return all.empty() ? nullptr : all[random.below(all.size())];
  }
  [[nodiscard]] static std::string text(rt::Duration time) {
    return std::to_string(std::chrono::duration_cast<std::chrono::milliseconds>(time).count()) + " ms";
  }

  Rig* rig_;
  const WorldPlan* plan_;
  std::string failure_;
};

}  // namespace berth::harness

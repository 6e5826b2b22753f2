/// The end of a world of `run_world`: without further faults, what can become operational does so in bounded bus time,
/// and stays so. What is judged: docs/faults.md.
#pragma once

#include <algorithm>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "berth/harness/end_judge.hpp"
#include "berth/harness/word_judge.hpp"
#include "berth/harness/world_plan.hpp"

namespace berth::harness {

class WorldEnding {
 public:
  /// All must stay. `sound`: no watch has seen a violation; the end is not waited for after one.
  WorldEnding(const WorldPlan& plan, Rig& rig, EndJudge& judge, WordJudge& words, std::function<bool()> sound)
      : plan_(&plan), rig_(&rig), judge_(&judge), words_(&words), sound_(std::move(sound)) {}

  /// Runs the world to its end; `events`: what happened in it. What is wrong then; empty: nothing, or `sound` says it.
  [[nodiscard]] std::string judge(const std::vector<plant::PlantEvent>& events) {
    const bool cycles =
        std::ranges::any_of(plan_->plant.devices, [](const auto& d) { return d.storing.power_cycle_after; }) ||
        std::ranges::any_of(plan_->machine.slots,
                            [](const auto& s) { return s.spec.configuring.activate == places::Activate::power_cycle; });
    for (int round = 0; round < 6; ++round) {
      if (comes_to_rest(15s) || !sound_()) break;
      look_at_words();
      if (cycles) static_cast<void>(power_cycle());
    }
    if (!sound_()) return {};
    rig_->run_for(3s);
    if (!sound_()) return {};
    comes_to_rest(20s);
    return sound_() ? end(events) : std::string();
  }

 private:
  void look_at_words() {
    for (std::size_t i = 0; i < rig_->networks(); ++i) {
      if (!rig_->network(i).idle()) continue;
      for (const auto& s : rig_->network(i).report()) words_->look(s);
    }
  }

  // Everything is as it must be, within this time.
  bool comes_to_rest(rt::Duration limit) {
    const rt::Time deadline = rig_->now() + limit;
    while (rig_->now() < deadline && sound_()) {
      if (rig_->idle() && verdict().empty()) return true;
      rig_->run_for(100ms);
    }
    return false;
  }

  // Does what a user does at "power cycle needed". False: no slot reports it.
  bool power_cycle() {
    bool any = false;
    std::vector<Identity> waiting;
    for (std::size_t i = 0; i < rig_->networks(); ++i) {
      for (const auto& s : rig_->network(i).report()) {
        if (s.state == places::SlotState::power_cycle && s.device) waiting.push_back(*s.device);
      }
    }
    for (const auto& d : rig_->world().devices()) {
      const auto t = d->truth();
      // Devices that were to be blanked also wait for power, though no slot names them.
      const bool waits = std::ranges::any_of(waiting, [&](const Identity& w) { return t.is(w); }) ||
                         (d->plan().storing.power_cycle_after && (t.active != t.persistent || t.active != t.pending));
      if (!waits || !t.powered) continue;
      any = true;
      d->power(false);
      rig_->run_for(100ms);
      d->power(true);
    }
    return any;
  }

  // For this bus, or for all ("").
  [[nodiscard]] std::string verdict(const std::string& bus = {}) {
    std::string wrong = judge_->wrong(bus);
    if (!wrong.empty() || !plan_->solvable) return wrong;
    for (std::size_t i = 0; i < rig_->networks(); ++i) {
      if (!bus.empty() && rig_->network(i).bus().name != bus) continue;
      for (const auto& s : rig_->network(i).report()) {
        const bool by_fastscan = rig_->network(i).bus().discovery.find("fastscan") != std::string::npos ||
                                 rig_->network(i).bus().discovery == "planner-feedback";
        // A device whose slot was given away and that came back is used again when the user says so. Which of two slots
        // is left for another device depends on the answer.
        const auto asks_for_used = [](const operate::SlotReport& r) {
          return r.state == places::SlotState::question && r.reason.find("--used") != std::string::npos;
        };
        const bool persons =
            s.state == places::SlotState::question && std::ranges::any_of(rig_->network(i).report(), asks_for_used);
        if (s.state != places::SlotState::operational && !by_fastscan && !persons && !kept_elsewhere(s))
          return "slot " + s.name + " is " + places::name(s.state) + ": " + s.reason;
      }
    }
    return {};
  }

  // A device that came with the node-ID of a slot that it fits was seated there, before another device was found that
  // fits no other slot: seated devices are not moved.
  [[nodiscard]] bool kept_elsewhere(const operate::SlotReport& empty) {
    const auto records = rig_->store().load(plan_->machine.name);
    const bool left = empty.state == places::SlotState::empty || empty.state == places::SlotState::question;
    if (!records || !left) return false;
    const design::Slot* const slot = plan_->machine.slot(empty.bus, empty.id);
    return std::ranges::any_of(plan_->plant.devices, [&](const plant::PlantDevice& d) {
      return slot != nullptr && d.node_id.configured() && places::fits(slot->spec, d.address) &&
             std::ranges::any_of(*records, [&](const places::SlotRecord& r) {
               return r.confirmed && r.confirmed->device == d.address && r.confirmed->id == d.node_id;
             });
    });
  }

  // On a bus without acknowledgement each question takes a second, and Berth never stops asking: the judge does not
  // wait until it does.
  [[nodiscard]] bool at_rest(std::size_t network) {
    const auto& bus = rig_->network(network).bus().name;
    const bool any = std::ranges::any_of(rig_->world().devices(), [&](const auto& d) {
      const auto t = d->truth();
      return t.bus == bus && t.powered;
    });
    return (!any || rig_->network(network).idle()) && !any_boots(bus);
  }

  // A device that was just reset is neither present nor absent.
  [[nodiscard]] bool any_boots(const std::string& bus) {
    return std::ranges::any_of(rig_->world().devices(), [&](const auto& d) {
      const auto t = d->truth();
      return t.bus == bus && t.booting;
    });
  }
  // Devices still have to carry out a command that was just sent.
  [[nodiscard]] bool comes_to_rest(std::size_t network) {
    const rt::Time end = rig_->now() + 90s;
    while (rig_->now() < end) {
      if (!rig_->run_until([&] { return at_rest(network); }, end - rig_->now())) return false;
      rig_->run_for(5ms);
      if (!any_boots(rig_->network(network).bus().name)) return true;
    }
    return false;
  }

  // A device needs as long for a command as for an answer, up to 40 ms: an error counts if it persists at each of three
  // rests. Each bus has its own main job, and is judged when that rests. While a device is missing or a question is
  // open, each job looks again and again, and they may never rest at the same time.
  [[nodiscard]] std::string verdict_that_stays(std::size_t network) {
    const std::string bus = rig_->network(network).bus().name;
    std::string wrong;
    for (int look = 0; look < 3; ++look) {
      if (!comes_to_rest(network)) return "the main job does not come to rest";
      wrong = verdict(bus);
      if (wrong.empty()) break;
      rig_->run_for(50ms);
    }
    return wrong;
  }
  [[nodiscard]] std::string verdict_that_stays() {
    for (std::size_t i = 0; i < rig_->networks(); ++i) {
      std::string wrong = verdict_that_stays(i);
      if (!wrong.empty()) return wrong;
    }
    return {};
  }

  [[nodiscard]] std::string end(const std::vector<plant::PlantEvent>& events) {
    // Berth first has to notice a device that came back just now.
    rt::Duration last{0};
    for (const auto& e : events) last = std::max(last, rt::Duration(e.delay));
    const rt::Duration since = rig_->now() - rt::Time{} - last;
    if (since < 15s) rig_->run_for(15s - std::max(since, rt::Duration{0}));
    // A long search: it pauses between the frames of each question when a small receive buffer may be there.
    std::string wrong = verdict_that_stays();
    // What failed is tried again after eight probe periods, and may have become possible just now.
    if (!wrong.empty()) {
      rig_->run_for(15s);
      wrong = verdict_that_stays();
    }
    // Since the first rest, more devices may have shown that they need a power cycle.
    for (int round = 0; round < 3 && !wrong.empty() && power_cycle(); ++round) {
      rig_->run_for(15s);
      wrong = verdict_that_stays();
    }
    return wrong;
  }

  const WorldPlan* plan_;
  Rig* rig_;
  EndJudge* judge_;
  WordJudge* words_;
  std::function<bool()> sound_;
};

}  // namespace berth::harness

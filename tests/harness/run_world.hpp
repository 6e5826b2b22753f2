// One seeded world from beginning to end, with its invariants looked at after every change (see docs/faults.md).
#pragma once

#include <array>
#include <map>

#include "tests/harness/config_watch.hpp"
#include "tests/harness/world_plan.hpp"

namespace berth::harness {

struct Outcome {
  std::string failure;  // empty: good
  std::uint64_t hash = 0;
  rt::Duration bus_time{0};
  std::array<std::array<unsigned, columns>, fault_kinds> hits{};
  std::vector<plant::PlantEvent> events;  // what happened, when: replays this run
  std::string log;
};

// Berth must never be the one who makes two devices hold one node-ID.
class DoubleWatch final : public plant::World::Observer {
 public:
  explicit DoubleWatch(plant::World& world) : world_(&world) { world.add_observer(*this); }
  ~DoubleWatch() { world_->remove_observer(*this); }

  // A device that could not be heard lately may come back with what it had: nobody can have known.
  void disturbed(const std::string& who) { unreachable_[who] = world_->executor().now(); }
  void disturbed_all() {
    for (const auto& d : world_->devices()) disturbed(d->name());
  }
  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }

 private:
  struct Life {
    bool powered = false;
    rt::Time on{};
    NodeId came_with;
    NodeId active;
  };
  void plant_changed(const plant::SimDevice& device) noexcept override {
    const auto t = device.truth();
    Life& life = lives_[t.name];
    const rt::Time now = world_->executor().now();
    if (t.powered && !life.powered) {
      life.on = now;
      life.came_with = t.persistent;
    }
    const bool woke = t.active.configured() && t.active != life.active;
    life.powered = t.powered;
    life.active = t.active;
    if (!woke || !failure_.empty()) return;
    if (t.active == life.came_with) return;  // what it had when it was switched on
    for (const auto& other : world_->devices()) {
      const auto o = other->truth();
      if (o.name == t.name || !o.powered || o.booting || o.active != t.active || o.address == t.address) continue;
      const auto lost = unreachable_.find(o.name);
      const bool was_reachable =
          now - lives_[o.name].on > 3s && (lost == unreachable_.end() || now - lost->second > 4s);
      if (!was_reachable) continue;
      failure_ =
          "Berth gave node-ID " + std::to_string(t.active.value()) + " to " + t.name + " while " + o.name + " holds it";
    }
  }
  plant::World* world_;
  std::map<std::string, Life> lives_;
  std::map<std::string, rt::Time> unreachable_;
  std::string failure_;
};

class WorldRun {
 public:
  explicit WorldRun(const WorldPlan& plan)
      : plan_(plan),
        rig_(plan.machine, plan.plant),
        watch_(rig_.world()),
        configured_(rig_.world(), plan.machine, rig_.store()),
        random_(plan.seed ^ 0xFA17) {
    if (plan.perturbed) rig_.world().executor().perturb(plan.seed);
  }

  Outcome go() {
    rig_.begin();
    troubles();
    if (sound()) ending();
    if (!watch_.failure().empty()) outcome_.failure = watch_.failure();
    if (!configured_.failure().empty()) outcome_.failure = configured_.failure();
    outcome_.hash = rig_.world().sim().trace_hash();
    outcome_.bus_time = rig_.now().time_since_epoch();
    outcome_.log = rig_.log();
    return std::move(outcome_);
  }

 private:
  [[nodiscard]] bool sound() const noexcept { return watch_.failure().empty() && configured_.failure().empty(); }

  // The time in which things go wrong: until every fault had its chance, at most 20 s of bus time.
  void troubles() {
    const rt::Time limit = rig_.now() + 20s;
    std::vector<PlannedFault> waiting = plan_.faults;
    bool restarted = !plan_.restarts;
    while (rig_.now() < limit && sound()) {
      if (waiting.empty() && restarted && due_.empty()) break;
      perform_due();
      if (!restarted && rig_.now() - rt::Time{} >= plan_.restart_at) {
        restarted = true;
        rig_.kill();
        rig_.begin();
      }
      const Column here = column_of(rig_.network().phase());
      std::erase_if(waiting, [&](const PlannedFault& f) {
        if (f.column != here || rig_.network().phase() == operate::Phase::opening) return false;
        due_.emplace(rig_.now() + f.delay, f.kind);
        return true;
      });
      rt::Time next = rig_.now() + 1ms;
      if (!due_.empty()) next = std::min(next, due_.begin()->first);
      if (!rig_.world().executor().step(next)) rig_.world().sim().run_until(next);
    }
    rig_.run_for(3s);  // what was cut, slow or off comes back
  }

  void perform_due() {
    while (!due_.empty() && due_.begin()->first <= rig_.now()) {
      const FaultKind kind = due_.begin()->second;
      due_.erase(due_.begin());
      ++outcome_.hits[static_cast<std::size_t>(kind)][static_cast<std::size_t>(column_of(rig_.network().phase()))];
      for (const auto& e : events_of(kind, plan_.plant, rig_.now().time_since_epoch(), random_)) {
        outcome_.events.push_back(e);
        const rt::Duration later = e.delay - rig_.now().time_since_epoch();
        if (!e.device.empty())
          watch_.disturbed(e.device);
        else
          watch_.disturbed_all();
        if (later <= 0ms) {
          rig_.world().perform(e);
        } else {
          rig_.world().sim().after(later, [this, e] {
            if (!e.device.empty())
              watch_.disturbed(e.device);
            else
              watch_.disturbed_all();
            rig_.world().perform(e);
          });
        }
      }
    }
  }

  // Nothing goes wrong any more: what can become operational does so in bounded bus time.
  void ending() {
    const bool cycles =
        std::ranges::any_of(plan_.plant.devices, [](const auto& d) { return d.power_cycle_after_store; }) ||
        std::ranges::any_of(plan_.machine.slots,
                            [](const auto& s) { return s.spec.activate == places::Activate::power_cycle; });
    for (int round = 0; round < 6; ++round) {
      if (rig_.until_operational(15s)) break;
      if (!sound()) return;
      if (cycles) power_cycle();
    }
    check_end();
  }

  // What a person does who reads "power cycle needed".
  void power_cycle() {
    for (const auto& s : rig_.network().report()) {
      if (s.state != places::SlotState::power_cycle || !s.device) continue;
      for (const auto& d : rig_.world().devices()) {
        if (d->truth().address != *s.device) continue;
        watch_.disturbed(d->name());
        d->power(false);
        rig_.run_for(100ms);
        d->power(true);
      }
    }
    // Devices that were to be blanked wait for power too, in no slot's name.
    for (const auto& d : rig_.world().devices()) {
      const auto t = d->truth();
      if (d->plan().power_cycle_after_store && t.active != t.persistent) {
        watch_.disturbed(d->name());
        d->power(false);
        rig_.run_for(100ms);
        d->power(true);
      }
    }
  }

  void check_end() {
    const auto fail = [&](const std::string& text) {
      if (outcome_.failure.empty()) outcome_.failure = text;
    };
    if (!rig_.run_until([&] { return rig_.network().idle(); }, 20s)) fail("the main job does not come to rest");
    for (const auto& s : rig_.network().report()) {
      if (plan_.solvable && s.state != places::SlotState::operational) {
        fail("slot " + s.name + " is " + places::name(s.state) + ": " + s.reason);
      }
      if (s.state == places::SlotState::unknown || s.state == places::SlotState::binding) {
        fail("slot " + s.name + " ended as " + std::string(places::name(s.state)));
      }
      if (s.state == places::SlotState::operational) check_operational(s, fail);
    }
  }

  template <class Fail>
  void check_operational(const operate::SlotReport& s, const Fail& fail) {
    unsigned holders = 0;
    bool right = false;
    for (const auto& t : rig_.world().truth()) {
      if (!t.powered || t.active != s.id) continue;
      ++holders;
      right = right || (s.device && t.address == *s.device && t.state == NmtState::operational);
    }
    if (!right) fail("slot " + s.name + " is told operational and its device is not");
    const bool twins = std::ranges::any_of(plan_.plant.devices, [](const auto& d) { return d.name == "twin"; });
    if (!twins) check_configuration(s, fail);
    if (holders > 1 && !twins) fail("two devices hold the node-ID of operational slot " + s.name);
  }

  template <class Fail>
  void check_configuration(const operate::SlotReport& s, const Fail& fail) {
    const design::Slot* const slot = plan_.machine.slot(s.bus, s.id);
    for (const auto& d : rig_.world().devices()) {
      const auto t = d->truth();
      if (!t.powered || t.active != s.id || !s.device || t.address != *s.device) continue;
      const auto wrong = configured_.check(*d, *slot);
      if (!wrong.empty()) fail("slot " + s.name + " is operational, and " + wrong);
    }
  }

  const WorldPlan& plan_;
  Rig rig_;
  DoubleWatch watch_;
  ConfigWatch configured_;
  Random random_;
  std::multimap<rt::Time, FaultKind> due_;
  Outcome outcome_;
};

inline Outcome run_world(const WorldPlan& plan) { return WorldRun(plan).go(); }

}  // namespace berth::harness

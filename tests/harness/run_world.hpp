// One seeded world from beginning to end, with its invariants checked after every change (see docs/faults.md).
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "tests/harness/end_judge.hpp"
#include "tests/harness/start_watch.hpp"
#include "tests/harness/waiting_judge.hpp"
#include "tests/harness/word_judge.hpp"
#include "tests/harness/world_plan.hpp"

namespace berth::harness {

struct Outcome {
  std::string failure;  // empty: good
  std::uint64_t hash = 0;
  rt::Duration bus_time{0};
  std::array<std::array<unsigned, columns>, world_fault_kinds> hits{};
  std::array<std::array<unsigned, steps>, step_kinds> step_hits{};
  std::vector<plant::PlantEvent> events;  // what happened, when: replays this run
  std::string log;
};

class WorldRun final : private can::Tap {
 public:
  // `frames`: the log also has every frame.
  explicit WorldRun(const WorldPlan& plan, bool frames = false)
      : plan_(plan),
        frames_(frames),
        rig_(plan.machine, plan.plant),
        watch_(rig_.world(), plan.machine, &rig_.store()),
        configured_(rig_.world(), plan.machine, rig_.store()),
        started_(rig_.world(), plan.machine),
        judge_(rig_, plan.machine, watch_, configured_),
        words_(rig_, plan.machine),
        waiting_(rig_, plan),
        random_(plan.seed ^ 0xFA17),
        step_faults_(plan.step_faults),
        long_cuts_(plan.long_cuts) {
    if (plan.perturbed) rig_.world().executor().perturb(plan.seed);
    rig_.put_between([this](can::Port& port, const std::string& bus) {
      ports_.push_back(std::make_unique<HeardPort>(watch_, bus, port));
      return ports_.back().get();
    });
    if (plan.words) rig_.on_event([this](const operate::Event& event) { words_.told(event); });
    rig_.on_step([this](const std::string& bus, const places::Binding& binding) { step_begins(bus, binding); });
    for (const auto& bus : plan.machine.buses) {
      if (frames) rig_.world().bus(bus.name)->add_tap(*this);
    }
  }
  ~WorldRun() {
    rig_.kill();
    for (const auto& bus : plan_.machine.buses) rig_.world().bus(bus.name)->remove_tap(*this);
  }

  // `without`: for a calm world with devices that wait for their power cycle: how long its start takes if none waits.
  Outcome go(std::optional<rt::Duration> without = {}) {
    for (const auto& e : plan_.later) plan_event(e);
    begin();
    const auto unsound = [this] { return !sound(); };
    if (without) waiting_.start(*without, unsound);
    if (sound()) troubles();
    words_.all_is_quiet();
    if (plan_.calm && plan_.solvable && sound()) waiting_.lose(random_, unsound);
    if (sound()) ending();
    if (!words_.failure().empty()) outcome_.failure = words_.failure();
    if (!waiting_.failure().empty()) outcome_.failure = waiting_.failure();
    if (!configured_.failure().empty()) outcome_.failure = configured_.failure();
    if (!started_.failure().empty()) outcome_.failure = started_.failure();
    if (!watch_.failure().empty()) outcome_.failure = watch_.failure();
    outcome_.hash = rig_.world().sim().trace_hash();
    outcome_.bus_time = rig_.now().time_since_epoch();
    outcome_.log = rig_.log();
    if (frames_) outcome_.log = told_ + outcome_.log;
    return std::move(outcome_);
  }

  // The time until the slots whose devices do not wait are operational; none: not all are within two minutes.
  std::optional<rt::Duration> start() {
    begin();
    const rt::Time began = now();
    if (!rig_.run_until([this] { return waiting_.others_run(); }, 2min)) return std::nullopt;
    return now() - began;
  }

 private:
  using Deed = std::function<void()>;

  // Logs Berth's earlier events before the frame, so that both are in the order of time.
  void frame(const can::Frame& frame, rt::Time at, int sender) noexcept override {
    for (; told_events_ < rig_.events().size(); ++told_events_)
      told_ += operate::to_line(rig_.events()[told_events_]) + "\n";
    std::array<char, 48> head{};
    std::snprintf(head.data(), head.size(), "%12.6f s  %2d  ", std::chrono::duration<double>(at - rt::Time{}).count(),
                  sender);
    told_ += head.data() + can::to_string(frame) + "\n";
  }

  [[nodiscard]] bool sound() const noexcept {
    return watch_.failure().empty() && configured_.failure().empty() && started_.failure().empty() &&
           words_.failure().empty() && waiting_.failure().empty();
  }
  [[nodiscard]] rt::Time now() const noexcept { return rig_.now(); }

  void begin() {
    watch_.berth_began();
    words_.berth_began();
    ports_.clear();
    rig_.begin();
  }
  void end_berth(rt::Duration for_so_long) {
    if (!rig_.runs()) return;
    rig_.kill();
    due_.emplace(now() + for_so_long, [this] { begin(); });
  }

  // ---- the time with faults ----

  // Until every fault could strike, at most 20 s of bus time, and the devices that come back are back.
  void troubles() {
    const rt::Time limit = now() + 20s;
    std::vector<PlannedFault> waiting = plan_.faults;
    bool restarted = !plan_.restarts;
    while (sound()) {
      const bool over = now() >= limit || (waiting.empty() && step_faults_.empty() && long_cuts_.empty() && restarted);
      if (over) step_faults_.clear();
      if (over) long_cuts_.clear();
      if (over && due_.empty()) break;
      perform_due();
      if (!restarted && now() - rt::Time{} >= plan_.restart_at) {
        restarted = true;
        end_berth(0ms);
      }
      if (!over && rig_.runs()) aim(waiting);
      rt::Time next = now() + 1ms;
      if (over || waiting.empty()) next = now() + 50ms;
      if (!due_.empty()) next = std::min(next, due_.begin()->first);
      if (!rig_.world().executor().step(next)) rig_.world().sim().run_until(next);
    }
    rig_.run_for(3s);  // what was cut, slow or off comes back
  }

  void perform_due() {
    while (!due_.empty() && due_.begin()->first <= now()) {
      const Deed deed = std::move(due_.begin()->second);
      due_.erase(due_.begin());
      deed();
    }
  }

  [[nodiscard]] Column column(std::size_t bus) { return column_of(rig_.network(bus).phase()); }

  void aim(std::vector<PlannedFault>& waiting) {
    std::erase_if(long_cuts_, [&](const LongCut& cut) { return cuts(cut); });
    std::erase_if(waiting, [&](const PlannedFault& f) {
      const auto phase = rig_.network(f.bus).phase();
      if (f.column != column_of(phase) || phase == operate::Phase::opening) return false;
      due_.emplace(now() + f.delay, [this, f] { strike(f); });
      return true;
    });
  }

  // True: its slot is operational, and the cut is planned.
  bool cuts(const LongCut& cut) {
    const auto slot = waiting_.report_of(cut.slot);
    const auto* const device =
        slot && slot->state == places::SlotState::operational ? waiting_.device_of(*slot) : nullptr;
    if (device == nullptr) return false;
    const rt::Duration at = now().time_since_epoch() + cut.delay;
    auto off = event(plant::Action::cut_cable, {}, at);
    off.bus = slot->bus;
    off.nodes = {device->name()};
    plan_event(off);
    auto on = event(plant::Action::join, {}, at + 30s);
    on.bus = slot->bus;
    plan_event(on);
    return true;
  }
  void strike(const PlannedFault& f) {
    if (!rig_.runs()) return;
    const std::string bus = plan_.machine.buses[f.bus].name;
    const std::string who = victim(plan_.plant, bus, random_);
    unsigned& hits = outcome_.hits[static_cast<std::size_t>(f.kind)][static_cast<std::size_t>(column(f.bus))];
    if (f.kind == FaultKind::waiting_lost) {
      const rt::Duration armed = now().time_since_epoch();
      lose_next_waiting(rig_.world(), who, [this, &hits, who, bus, armed](std::uint64_t frame) {
        ++hits;
        auto e = event(plant::Action::overrun, who, armed);
        e.bus = bus;
        e.nodes = {std::exchange(e.device, {})};
        e.strike.frame = frame;
        outcome_.events.push_back(e);
      });
      return;
    }
    ++hits;
    const bool leaves = f.kind == FaultKind::away || f.kind == FaultKind::gone;
    if (leaves && who.empty()) return;
    for (const auto& e : events_of(f.kind, who, bus, now().time_since_epoch(), random_)) plan_event(e);
    if (leaves) left(who);
  }

  static plant::PlantEvent event(plant::Action action, const std::string& who, rt::Duration at) {
    plant::PlantEvent e;
    e.action = action;
    e.device = who;
    e.delay = at;
    return e;
  }
  void plan_event(const plant::PlantEvent& e) {
    outcome_.events.push_back(e);
    due_.emplace(std::max(now(), rt::Time{} + e.delay), [this, e] { rig_.world().perform(e); });
  }

  // ---- faults that are aimed at a step of a binding ----

  void step_begins(const std::string& bus, const places::Binding& binding) {
    const auto* const step = std::ranges::find(aimed_steps, binding.step());
    if (step == std::end(aimed_steps) || !sound()) return;
    const int place = static_cast<int>(step - std::begin(aimed_steps));
    // Of clones, the first; none if no device has the address.
    const auto& devices = rig_.world().devices();
    const auto device = std::ranges::find_if(devices, [&](const auto& d) {
      return d->plan().bus == bus && d->truth().address == binding.assignment().device;
    });
    if (device == devices.end()) return;
    for (auto it = step_faults_.begin(); it != step_faults_.end(); ++it) {
      if (it->step != place) continue;
      if (it->skip > 0) {
        --it->skip;
        continue;
      }
      const StepFault f = *it;
      step_faults_.erase(it);
      const NodeId id = binding.assignment().id;
      due_.emplace(now() + f.delay, [this, f, bus, who = (*device)->name(), id] { strike(f, bus, who, id); });
      return;
    }
  }

  void strike(const StepFault& f, const std::string& bus, const std::string& who, NodeId id) {
    const auto frame = frame_of(f.kind, aimed_steps[f.step], id);
    if (!rig_.runs()) return;
    ++outcome_.step_hits[static_cast<std::size_t>(f.kind)][static_cast<std::size_t>(f.step)];
    const rt::Duration at = now().time_since_epoch();
    switch (f.kind) {
      case StepKind::power:
        plan_event(event(plant::Action::power_off, who, at));
        if (f.back) plan_event(event(plant::Action::power_on, who, at + *f.back));
        if (!f.back || *f.back > 10s) left(who);
        break;
      case StepKind::berth: end_berth(*f.back); break;
      case StepKind::request_lost:
      case StepKind::answer_lost: {
        if (!frame) break;
        auto e = event(plant::Action::overrun, {}, at);
        e.bus = bus;
        e.nodes = {f.kind == StepKind::request_lost ? who : std::string(plant::master_name)};
        e.strike.id = *frame;
        plan_event(e);
        break;
      }
      case StepKind::count: break;
    }
    perform_due();
  }

  // ---- the user ----

  // A device left for long: the user brings a spare of its kind, and may give `berth replace`.
  void left(const std::string& who) {
    const auto* const gone = plan_.plant.device(who);
    for (const auto& d : plan_.plant.devices) {
      const bool spare = !d.plugged && d.bus == gone->bus && d.address.type() == gone->address.type() &&
                         d.address.revision == gone->address.revision && !brought_.contains(d.name);
      if (!spare) continue;
      brought_.insert(d.name);
      const rt::Duration when(random_.between(rt::Duration(500ms).count(), rt::Duration(20s).count()));
      plan_event(event(plant::Action::plug, d.name, now().time_since_epoch() + when));
      break;
    }
    if (plan_.replaces) due_.emplace(now() + 8s, [this, who] { replace(who, 6); });
  }

  // Gives `berth replace` for a slot that is shown as absent, while Berth has nothing to do.
  void replace(const std::string& who, int tries) {
    const auto t = rig_.device(who).truth();
    if (t.powered || tries == 0) return;
    const auto again = [&] { due_.emplace(now() + 1s, [this, who, tries] { replace(who, tries - 1); }); };
    if (!rig_.runs() || !rig_.idle()) return again();
    for (std::size_t i = 0; i < rig_.networks(); ++i) {
      for (const auto& s : rig_.network(i).report()) {
        if (!s.device || !t.is(*s.device) || s.state != places::SlotState::absent || s.bus != t.bus) continue;
        // It counts from the instant of the command; the command's answer is judged elsewhere.
        watch_.replaced_by_a_person(who);
        if (rig_.network(i).replace(s.name, std::nullopt)) return;
      }
    }
    again();
  }

  // ---- the end ----

  // Without further faults, what can become operational does so in bounded bus time, and stays so.
  void ending() {
    const bool cycles =
        std::ranges::any_of(plan_.plant.devices, [](const auto& d) { return d.storing.power_cycle_after; }) ||
        std::ranges::any_of(plan_.machine.slots,
                            [](const auto& s) { return s.spec.configuring.activate == places::Activate::power_cycle; });
    for (int round = 0; round < 6; ++round) {
      if (comes_to_rest(15s) || !sound()) break;
      look_at_words();
      if (cycles) static_cast<void>(power_cycle());
    }
    if (!sound()) return;
    rig_.run_for(3s);
    if (!sound()) return;
    comes_to_rest(20s);
    if (sound()) check_end();
  }

  void look_at_words() {
    for (std::size_t i = 0; i < rig_.networks(); ++i) {
      if (!rig_.network(i).idle()) continue;
      for (const auto& s : rig_.network(i).report()) words_.look(s);
    }
  }

  // Everything is as it must be, within this time.
  bool comes_to_rest(rt::Duration limit) {
    const rt::Time deadline = now() + limit;
    while (now() < deadline && sound()) {
      if (rig_.idle() && verdict().empty()) return true;
      rig_.run_for(100ms);
    }
    return false;
  }

  // Does what a user does at "power cycle needed". False: no slot reports it.
  bool power_cycle() {
    bool any = false;
    std::vector<Identity> waiting;
    for (std::size_t i = 0; i < rig_.networks(); ++i) {
      for (const auto& s : rig_.network(i).report()) {
        if (s.state == places::SlotState::power_cycle && s.device) waiting.push_back(*s.device);
      }
    }
    for (const auto& d : rig_.world().devices()) {
      const auto t = d->truth();
      // Devices that were to be blanked also wait for power, though no slot names them.
      const bool waits = std::ranges::any_of(waiting, [&](const Identity& w) { return t.is(w); }) ||
                         (d->plan().storing.power_cycle_after && (t.active != t.persistent || t.active != t.pending));
      if (!waits || !t.powered) continue;
      any = true;
      d->power(false);
      rig_.run_for(100ms);
      d->power(true);
    }
    return any;
  }

  // For this bus, or for all ("").
  [[nodiscard]] std::string verdict(const std::string& bus = {}) {
    std::string wrong = judge_.wrong(bus);
    if (!wrong.empty() || !plan_.solvable) return wrong;
    for (std::size_t i = 0; i < rig_.networks(); ++i) {
      if (!bus.empty() && rig_.network(i).bus().name != bus) continue;
      for (const auto& s : rig_.network(i).report()) {
        const bool by_fastscan = rig_.network(i).bus().discovery.find("fastscan") != std::string::npos ||
                                 rig_.network(i).bus().discovery == "planner-feedback";
        // A device whose slot was given away and that came back is used again when the user says so. Which of two slots
        // is left for another device depends on the answer.
        const auto asks_for_used = [](const operate::SlotReport& r) {
          return r.state == places::SlotState::question && r.reason.find("--used") != std::string::npos;
        };
        const bool persons =
            s.state == places::SlotState::question && std::ranges::any_of(rig_.network(i).report(), asks_for_used);
        if (s.state != places::SlotState::operational && !by_fastscan && !persons && !kept_elsewhere(s))
          return "slot " + s.name + " is " + places::name(s.state) + ": " + s.reason;
      }
    }
    return {};
  }

  // A device that came with the node-ID of a slot that it fits was seated there, before another device was found that
  // fits no other slot: seated devices are not moved.
  [[nodiscard]] bool kept_elsewhere(const operate::SlotReport& empty) {
    const auto records = rig_.store().load(plan_.machine.name);
    const bool left = empty.state == places::SlotState::empty || empty.state == places::SlotState::question;
    if (!records || !left) return false;
    const design::Slot* const slot = plan_.machine.slot(empty.bus, empty.id);
    return std::ranges::any_of(plan_.plant.devices, [&](const plant::PlantDevice& d) {
      return slot != nullptr && d.node_id.configured() && places::fits(slot->spec, d.address) &&
             std::ranges::any_of(*records, [&](const places::SlotRecord& r) {
               return r.confirmed && r.confirmed->device == d.address && r.confirmed->id == d.node_id;
             });
    });
  }

  // On a bus without acknowledgement each question takes a second, and Berth never stops asking: the judge does not
  // wait until it does.
  [[nodiscard]] bool at_rest(std::size_t network) {
    const auto& bus = rig_.network(network).bus().name;
    const bool any = std::ranges::any_of(rig_.world().devices(), [&](const auto& d) {
      const auto t = d->truth();
      return t.bus == bus && t.powered;
    });
    return (!any || rig_.network(network).idle()) && !any_boots(bus);
  }

  // A device that was just reset is neither present nor absent.
  [[nodiscard]] bool any_boots(const std::string& bus) {
    return std::ranges::any_of(rig_.world().devices(), [&](const auto& d) {
      const auto t = d->truth();
      return t.bus == bus && t.booting;
    });
  }
  // Devices still have to carry out a command that was just sent.
  [[nodiscard]] bool comes_to_rest(std::size_t network) {
    const rt::Time end = now() + 90s;
    while (now() < end) {
      if (!rig_.run_until([&] { return at_rest(network); }, end - now())) return false;
      rig_.run_for(5ms);
      if (!any_boots(rig_.network(network).bus().name)) return true;
    }
    return false;
  }

  // A device needs as long for a command as for an answer, up to 40 ms: an error counts if it persists at each of three
  // rests. Each bus has its own main job, and is judged when that rests. While a device is missing or a question is
  // open, each job looks again and again, and they may never rest at the same time.
  [[nodiscard]] std::string verdict_that_stays(std::size_t network) {
    const std::string bus = rig_.network(network).bus().name;
    std::string wrong;
    for (int look = 0; look < 3; ++look) {
      if (!comes_to_rest(network)) return "the main job does not come to rest";
      wrong = verdict(bus);
      if (wrong.empty()) break;
      rig_.run_for(50ms);
    }
    return wrong;
  }
  [[nodiscard]] std::string verdict_that_stays() {
    for (std::size_t i = 0; i < rig_.networks(); ++i) {
      std::string wrong = verdict_that_stays(i);
      if (!wrong.empty()) return wrong;
    }
    return {};
  }

  void check_end() {
    // Berth first has to notice a device that came back just now.
    rt::Duration last{0};
    for (const auto& e : outcome_.events) last = std::max(last, rt::Duration(e.delay));
    const rt::Duration since = now() - rt::Time{} - last;
    if (since < 15s) rig_.run_for(15s - std::max(since, rt::Duration{0}));
    // A long search: it pauses between the frames of each question when a small receive buffer may be there.
    std::string wrong = verdict_that_stays();
    // What failed is tried again after eight probe periods, and may have become possible just now.
    if (!wrong.empty()) {
      rig_.run_for(15s);
      wrong = verdict_that_stays();
    }
    // Since the first rest, more devices may have shown that they need a power cycle.
    for (int round = 0; round < 3 && !wrong.empty() && power_cycle(); ++round) {
      rig_.run_for(15s);
      wrong = verdict_that_stays();
    }
    if (!wrong.empty() && outcome_.failure.empty()) outcome_.failure = wrong;
  }

  const WorldPlan& plan_;
  bool frames_;
  std::string told_;
  std::size_t told_events_ = 0;
  Rig rig_;
  DuplicateWatch watch_;
  ConfigWatch configured_;
  StartWatch started_;
  EndJudge judge_;
  WordJudge words_;
  WaitingJudge waiting_;
  Random random_;
  std::vector<std::unique_ptr<HeardPort>> ports_;
  std::multimap<rt::Time, Deed> due_;
  std::vector<StepFault> step_faults_;
  std::vector<LongCut> long_cuts_;
  std::set<std::string> brought_;
  Outcome outcome_;
};

// Without devices that take a node-ID only at power-on; none: not all slots become operational then.
inline std::optional<rt::Duration> start_without_waiting(WorldPlan plan) {
  for (auto& d : plan.plant.devices) {
    const bool waits = std::ranges::find(plan.waiting, d.name) != plan.waiting.end();
    if (waits) d.storing.power_cycle_after = false;
  }
  return WorldRun(plan).start();
}

inline Outcome run_world(const WorldPlan& plan, bool frames = false) {
  std::optional<rt::Duration> without;
  // Fastscan alone finds a slow device only if it happens to answer in time.
  const bool by_chance = std::ranges::any_of(
      plan.machine.buses, [](const design::Bus& bus) { return bus.discovery.find("fastscan") != std::string::npos; });
  if (plan.calm && plan.solvable && !plan.waiting.empty() && !by_chance) without = start_without_waiting(plan);
  return WorldRun(plan, frames).go(without);
}

}  // namespace berth::harness

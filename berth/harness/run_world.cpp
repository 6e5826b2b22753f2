#include "berth/harness/run_world.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <map>
#include <memory>
#include <set>
#include <utility>

#include "berth/harness/start_watch.hpp"
#include "berth/harness/waiting_judge.hpp"
#include "berth/harness/world_ending.hpp"

namespace berth::harness {
namespace {

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
    count();
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

  void ending() {
    WorldEnding end(plan_, rig_, judge_, words_, [this] { return sound(); });
    outcome_.failure = end.judge(outcome_.events);
  }

  void count() {
    outcome_.operational = rig_.first_operational;
    for (const auto& bus : plan_.machine.buses) outcome_.frames += rig_.world().bus(bus.name)->statistics().frames;
    for (const auto& d : rig_.world().devices()) outcome_.lost += d->controller().statistics().overruns;
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
std::optional<rt::Duration> start_without_waiting(WorldPlan plan) {
  for (auto& d : plan.plant.devices) {
    const bool waits = std::ranges::find(plan.waiting, d.name) != plan.waiting.end();
    if (waits) d.storing.power_cycle_after = false;
  }
  return WorldRun(plan).start();
}

}  // namespace

Outcome run_world(const WorldPlan& plan, bool frames) {
  std::optional<rt::Duration> without;
  // Fastscan alone finds a slow device only if it happens to answer in time.
  const bool by_chance = std::ranges::any_of(
      plan.machine.buses, [](const design::Bus& bus) { return bus.discovery.find("fastscan") != std::string::npos; });
  if (plan.calm && plan.solvable && !plan.waiting.empty() && !by_chance) without = start_without_waiting(plan);
  return WorldRun(plan, frames).go(without);
}

}  // namespace berth::harness

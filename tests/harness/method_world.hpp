// One seeded world of one method of discovery from beginning to end, and what must hold in it (see docs/faults.md).
#pragma once

#include <fmt/format.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <array>
#include <map>
#include <memory>

#include "berth/research/and_frames.hpp"
#include "tests/harness/method_plan.hpp"
#include "tests/harness/negotiation_world.hpp"

namespace berth::harness {

struct MethodOutcome {
  std::string failure;  // empty: good
  std::uint64_t hash = 0;
  std::array<unsigned, method_faults> hits{};
  unsigned expected = 0;  // devices that the last search should find
  unsigned missed = 0;    // of them: slower than the window, which is no failure
  // Devices slower than the window that took another's node-ID because their answer came too late, or (RAND's planner,
  // unproven) whose last part went into another address.
  unsigned misled = 0;
  std::string log;
};

// Assigns each address one node-ID, always the same.
class OnePerAddress final : public discovery::Assigner {
 public:
  NodeId assign(const LssAddress& device, bool) noexcept override {
    const auto [it, fresh] = given_.try_emplace(device, NodeId(static_cast<std::uint8_t>(given_.size() % 99 + 1)));
    return it->second;
  }
  [[nodiscard]] NodeId of(const LssAddress& device) const {
    const auto it = given_.find(device);
    return it == given_.end() ? NodeId() : it->second;
  }

 private:
  std::map<LssAddress, NodeId> given_;
};

// `frames`: the log has every frame of the bus.
class MethodRun final : private discovery::Observer, private plant::World::Observer, private can::Tap, private rt::Job {
 public:
  explicit MethodRun(const MethodPlan& plan, bool frames) : plan_(plan), frames_(frames), random_(plan.seed ^ 0xD15C) {
    Findings findings;
    world_ = plant::World::make(plan.plant, {}, findings);
    if (!world_) std::abort();
    if (plan.perturbed) world_->executor().perturb(plan.seed);
    world_->add_observer(*this);
    if (frames_) world_->bus("backbone")->add_tap(*this);
    options_.assigner = plan.binds ? &assigner_ : nullptr;
    options_.store = plan.stores;
    options_.observer = this;
    options_.confirm = plan.confirms;
    const bool planner = plan.row == auto_row || plan.row > static_cast<int>(discovery::Method::feedback_11);
    if (planner) {
      options_.window = plan.window;
      options_.blocking = rt::Duration(2 * 160 * std::int64_t{1'000'000'000} / plan.plant.buses.front().bitrate);
    }
    promises_ = planner && plan.covered;
    hasty_ =
        std::ranges::any_of(plan.faults, [](const auto& f) { return f.kind == static_cast<int>(FaultKind::slow); }) ||
        std::ranges::any_of(plan.plant.devices,
                            [&](const auto& d) { return planner ? !plan.covered : d.response.outlier.count() > 0; });
    const bool walks_rand = plan.row == auto_row || plan.row == static_cast<int>(discovery::Method::planner_rand);
    unproven_ = hasty_ && walks_rand && !plan.confirms;
  }
  ~MethodRun() {
    end_master();
    world_->remove_observer(*this);
    if (frames_) world_->bus("backbone")->remove_tap(*this);
  }

  MethodOutcome go() {
    world_->start();
    world_->sim().run_for(300ms);
    begin_master();
    troubles();
    if (outcome_.failure.empty()) afterwards();
    outcome_.hash = world_->sim().trace_hash();
    return std::move(outcome_);
  }

 private:
  // A master's process: port, services, method, and the search under way.
  struct Master {
    std::unique_ptr<sim::Controller> port;
    std::unique_ptr<can::Dispatcher> dispatcher;
    std::unique_ptr<lss::Master> lss;
    std::unique_ptr<discovery::Discovery> method;
    rt::Task<Result<discovery::Report>> search;
  };
  static constexpr rt::Duration longest_search = 300s;

  void begin_master() {
    master_.emplace();
    master_->port = world_->attach_master("backbone");
    master_->dispatcher = std::make_unique<can::Dispatcher>(world_->executor(), *master_->port);
    master_->lss = std::make_unique<lss::Master>(*master_->dispatcher);
    const discovery::Services services{*master_->dispatcher, *master_->lss};
    if (plan_.row == auto_row) {
      master_->method = std::make_unique<discovery::Auto>(services, discovery::AutoOptions{.and_protocol = true});
    } else {
      master_->method = discovery::make(static_cast<discovery::Method>(plan_.row), services);
    }
    // What a master sends before its first search: no device stays selected or identified.
    master_->dispatcher->send(lss::request(lss::Command::switch_global, 0));
    nobody_identified();
  }
  void nobody_identified() {
    master_->dispatcher->send(nodeid::switch_identification_global(nodeid::Identification::unknown));
    master_->dispatcher->send(research::and_switch_global(nodeid::Identification::unknown));
  }
  void end_master() { master_.reset(); }

  void begin_search() {
    note("search");
    master_->search = master_->method->find(plan_.known, options_);
    began_ = now();
    master_->search.start(world_->executor(), *this);
  }
  void frame(const can::Frame& frame, rt::Time, int) noexcept override { note(can::to_string(frame)); }
  void run() noexcept override {}  // the search is over
  [[nodiscard]] bool finished() const { return master_->search.done(); }

  // The time with faults: one search after the other.
  void troubles() {
    const rt::Time start = now();
    world_->sim().run_for(20ms);
    begin_search();
    for (const auto& f : plan_.faults) {
      if (!until(start + f.at)) return;
      strike(f.kind);
    }
    while (!finished() && outcome_.failure.empty()) {
      if (now() - began_ > longest_search) return fail_with("the search does not end");
      step(now() + 100ms);
    }
    if (finished()) take();
  }
  bool until(rt::Time at) {
    while (now() < at && outcome_.failure.empty()) {
      if (finished()) {
        take();
        world_->sim().run_for(20ms);
        begin_search();
      }
      step(at);
    }
    return outcome_.failure.empty();
  }
  void step(rt::Time at) {
    perform_due();
    rt::Time next = std::min(at, now() + 10ms);
    if (!due_.empty()) next = std::min(next, due_.begin()->first);
    if (!world_->executor().step(next)) world_->sim().run_until(next);
  }
  void perform_due() {
    while (!due_.empty() && due_.begin()->first <= now()) {
      world_->perform(due_.begin()->second);
      due_.erase(due_.begin());
    }
  }

  void strike(int kind) {
    note(method_fault_name(kind));
    const std::string who = victim(plan_.plant, {}, random_);
    if (!finished() && kind != static_cast<int>(FaultKind::waiting_lost))
      ++outcome_.hits[static_cast<std::size_t>(kind)];
    if (kind == static_cast<int>(FaultKind::waiting_lost)) {
      lose_next_waiting(*world_, who, [this, kind](std::uint64_t) {
        if (master_ && !finished()) ++outcome_.hits[static_cast<std::size_t>(kind)];
      });
    } else if (kind == fault_join) {
      world_->devices().back()->plug();
    } else if (kind == fault_restart) {
      end_master();
      if (random_.below(2) == 0) world_->sim().run_for(5ms);
      begin_master();
      begin_search();
    } else {
      for (const auto& e :
           events_of(static_cast<FaultKind>(kind), who, "backbone", now().time_since_epoch(), random_)) {
        due_.emplace(rt::Time{} + e.delay, e);
      }
      perform_due();
    }
  }

  std::optional<discovery::Report> take() {
    auto result = master_->search.take();
    if (!result) {
      note("ended with an error: " + describe(result.error()));
      return std::nullopt;
    }
    note(fmt::format("ended: {}, {} found, {} requests, {} restarts", discovery::name(result->end),
                     result->found.size(), result->requests, result->restarts));
    for (const auto& f : result->found) check(f, "reports");
    return *result;
  }

  // Without further faults a new master finds all devices.
  void afterwards() {
    end_master();
    for (const rt::Time end = now() + 3s; now() < end;) step(end);
    for (const auto& d : world_->devices()) {
      d->plug();
      d->power(true);
    }
    world_->sim().run_for(1s);
    begin_master();
    world_->sim().run_for(1s);  // a device that was assigned a node-ID unheard takes it
    nobody_identified();        // it may have heard nothing meanwhile
    world_->sim().run_for(20ms);
    const auto expected = findable();
    begin_search();
    if (!world_->sim().run_until([&] { return finished(); }, longest_search)) {
      return fail_with("the last search does not end");
    }
    const auto report = take();
    if (!report) return fail_with("the last search ends with an error");
    world_->sim().run_for(1s);
    if (!outcome_.failure.empty()) return;
    count(expected, *report);
  }

  // Clones count once.
  [[nodiscard]] std::vector<LssAddress> findable() const {
    using enum discovery::Method;
    using plant::Speaks;
    std::vector<LssAddress> all;
    for (const auto& d : world_->devices()) {
      const auto truth = d->truth();
      const auto& speaks = d->plan().speaks;
      const bool rand = speaks.has(Speaks::rand) && !speaks.has(Speaks::rand_literal);
      const bool fastscan = speaks.has(Speaks::fastscan) && !truth.active.configured();
      bool fits = false;
      if (plan_.row == auto_row) {
        fits = rand || fastscan || speaks.has(Speaks::lss) || speaks.has(Speaks::and_protocol);
      } else {
        switch (static_cast<discovery::Method>(plan_.row)) {
          case discovery::Method::rand:
          case planner_rand: fits = rand; break;
          case and_protocol: fits = speaks.has(Speaks::and_protocol); break;
          case identify: fits = speaks.has(Speaks::lss); break;
          default: fits = fastscan; break;
        }
      }
      if (fits) all.push_back(d->plan().address);
    }
    std::ranges::sort(all);
    const auto clones = std::ranges::unique(all);
    all.erase(clones.begin(), clones.end());
    return all;
  }

  void count(const std::vector<LssAddress>& expected, const discovery::Report& report) {
    outcome_.expected = static_cast<unsigned>(expected.size());
    std::string names;
    for (const auto& a : expected) {
      if (std::ranges::find(report.found, a, &discovery::Found::address) != report.found.end()) continue;
      ++outcome_.missed;
      names += " " + to_string(a);
    }
    // A device on Fastscan without a node-ID keeps answering; then the result need not be complete.
    const bool held = report.end == discovery::Report::End::held;
    if (promises_ && !held && outcome_.missed > 0) fail_with("not found:" + names);
    for (const auto& f : report.found) {
      if (!f.assigned.configured()) continue;
      for (const auto& d : world_->devices()) {
        const auto t = d->truth();
        // A device that came with a node-ID takes the new one at its next reset.
        const auto has = t.active == d->plan().node_id ? t.pending : t.active;
        if (t.address != f.address || has == f.assigned || f.possible_clone || has_clone(f.address)) continue;
        fail_with(fmt::format("{} was told to have taken {} and has {}", t.name, f.assigned.value(), has.value()));
      }
    }
  }
  [[nodiscard]] bool has_clone(const LssAddress& a) const {
    return std::ranges::count_if(plan_.plant.devices, [&](const auto& d) { return d.address == a; }) > 1;
  }

  void found(const discovery::Found& device) noexcept override { check(device, "tells"); }
  void check(const discovery::Found& f, const char* how) {
    const bool real = std::ranges::any_of(plan_.plant.devices, [&](const auto& d) { return d.address == f.address; });
    if (real) return;
    const auto what = fmt::format("{} {}, which no device has", how, to_string(f.address));
    if (!unproven_) return fail_with(what);
    note(what);
    ++outcome_.misled;
  }
  // A device has the node-ID that it came with, or the one given to its own address.
  void plant_changed(const plant::SimDevice& device) noexcept override {
    const auto t = device.truth();
    if (!t.active.configured() || t.active == device.plan().node_id) return;
    if (t.active == assigner_.of(t.address)) return;
    const auto what = fmt::format("{} has node-ID {}, which was not given to its address", t.name, t.active.value());
    if (!hasty_) return fail_with(what);
    note(what);
    ++outcome_.misled;
  }

  void fail_with(const std::string& text) {
    note(text);
    if (outcome_.failure.empty()) outcome_.failure = text;
  }
  void note(const std::string& text) {
    outcome_.log += fmt::format("  {:>12.6f} s  {}\n", std::chrono::duration<double>(now() - rt::Time{}).count(), text);
  }
  [[nodiscard]] rt::Time now() const noexcept { return world_->executor().now(); }

  const MethodPlan& plan_;
  bool frames_;
  Random random_;
  OnePerAddress assigner_;
  discovery::Options options_;
  bool promises_ = false;
  bool hasty_ = false;     // some device is slower than the window
  bool unproven_ = false;  // then RAND's planner may compose an address (`WalkOptions::longest`)
  std::unique_ptr<plant::World> world_;
  std::optional<Master> master_;
  std::multimap<rt::Time, plant::PlantEvent> due_;
  rt::Time began_{};
  MethodOutcome outcome_;
};

// The fault that a disturbance of the negotiation is.
inline int negotiation_fault_of(const PlantEvent& e) {
  switch (e.action) {
    case Action::overrun: return static_cast<int>(FaultKind::overrun);
    case Action::disturb: return static_cast<int>(FaultKind::disturb);
    case Action::reset: return static_cast<int>(FaultKind::reset);
    case Action::power_off: return static_cast<int>(FaultKind::power);
    case Action::unplug: return static_cast<int>(FaultKind::unplug);
    case Action::cut_cable: return static_cast<int>(FaultKind::cut);
    case Action::plug: return fault_join;
    default: return -1;
  }
}

inline MethodOutcome run_negotiation_world(std::uint64_t seed) {
  MethodOutcome outcome;
  const auto plan = negotiation_plan(seed);
  for (const auto& e : plan.events) {
    const int fault = negotiation_fault_of(e);
    if (fault >= 0) ++outcome.hits[static_cast<std::size_t>(fault)];
  }
  outcome.failure = run_negotiation(plan, &outcome.hash);
  outcome.expected = static_cast<unsigned>(plan.devices.size());
  outcome.log = plant::write_plant(plan, "negotiation, seed " + std::to_string(seed));
  return outcome;
}

inline MethodOutcome run_method_world(int row, std::uint64_t seed, bool frames = false) {
  if (row == negotiation_row) return run_negotiation_world(seed);
  const MethodPlan plan = MethodPlanner(row, seed).make();
  auto outcome = MethodRun(plan, frames).go();
  outcome.log =
      plant::write_plant(plan.plant, fmt::format("{}, seed {}{}{}", row_name(row), seed, plan.binds ? ", binds" : "",
                                                 plan.covered ? "" : ", some answer later than the window")) +
      outcome.log;
  return outcome;
}

}  // namespace berth::harness

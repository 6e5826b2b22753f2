// Random machines, plants and faults from a seed, as explicit data: what a failed run is replayed and shrunk from.
#pragma once

#include <string>
#include <vector>

#include "tests/harness/rig.hpp"

namespace berth::harness {

enum class FaultKind : std::uint8_t {
  overrun,
  overrun_master,
  disturb,
  twice,
  slow,
  deaf,
  reset,
  power,
  unplug,
  cut,
  count
};
inline const char* name(FaultKind k) {
  constexpr const char* names[] = {"overrun", "overrun master", "disturb",    "frame twice", "slow",
                                   "deaf",    "reset",          "power loss", "unplug",      "cable cut"};
  return names[static_cast<int>(k)];
}
inline constexpr int fault_kinds = static_cast<int>(FaultKind::count);
// "opening" lasts a few frames and is counted with preparation.
enum class Column : std::uint8_t { preparation, discovery, binding, start, watch, count };
inline constexpr int columns = static_cast<int>(Column::count);
inline const char* name(Column c) {
  constexpr const char* names[] = {"preparation", "discovery", "binding", "start", "watch"};
  return names[static_cast<int>(c)];
}
inline Column column_of(operate::Phase phase) {
  switch (phase) {
    case operate::Phase::opening:
    case operate::Phase::preparation: return Column::preparation;
    case operate::Phase::discovery: return Column::discovery;
    case operate::Phase::binding: return Column::binding;
    case operate::Phase::start: return Column::start;
    case operate::Phase::watch: break;
  }
  return Column::watch;
}

// A fault that waits for its phase, then for `delay`.
struct PlannedFault {
  FaultKind kind = FaultKind::overrun;
  Column column = Column::discovery;
  rt::Duration delay{0};
};

struct WorldPlan {
  std::uint64_t seed = 0;
  design::Machine machine;
  plant::PlantFile plant;
  std::vector<PlannedFault> faults;
  bool solvable = true;   // every slot has exactly one device that fits: the end must be operational
  bool restarts = false;  // Berth is ended and begun again in the middle
  rt::Duration restart_at{0};
  bool perturbed = false;  // jobs of one instant in a drawn order
};

class Planner {
 public:
  explicit Planner(std::uint64_t seed) : random_(seed * 0x9E3779B97F4A7C15ULL + 1) { plan_.seed = seed; }

  WorldPlan make() {
    machine();
    for (std::size_t i = 0; i < plan_.machine.slots.size(); ++i) device(plan_.machine.slots[i].spec.type);
    stored_ids();
    strangers();
    faults();
    plan_.perturbed = random_.below(2) == 0;
    return std::move(plan_);
  }

 private:
  static constexpr std::size_t type_count = 4;
  static constexpr TypeCode types[type_count] = {type_a, type_b, type_c, type_pump};

  void machine() {
    constexpr std::uint32_t rates[] = {50'000, 125'000, 500'000, 1'000'000};
    plan_.machine = one_bus(rates[random_.below(4)]);
    auto& timing = plan_.machine.buses.front().timing;
    timing.rand_response = 12ms;
    timing.boot_timeout = 2s;
    timing.heartbeat_period = 200ms;
    timing.heartbeat_timeout = 700ms;
    timing.probe_period = 400ms;
    timing.sdo_timeout = 200ms;
    timing.store_timeout = 1s;
    timing.save_timeout = 1s;
    const auto slots = 1 + random_.below(5);
    while (plan_.machine.slots.size() < slots) {
      const auto id = static_cast<unsigned>(1 + random_.below(12));
      if (plan_.machine.slot("backbone", NodeId(static_cast<std::uint8_t>(id))) != nullptr) continue;
      add_slot(plan_.machine, id, types[random_.below(type_count)]);
      configuration(plan_.machine.slots.back().spec);
      if (random_.below(3) == 0) plan_.machine.slots.back().spec.replacement = places::Replacement::automatic;
    }
    plan_.plant = one_bus_plant(plan_.seed);
  }

  void configuration(places::SlotSpec& spec) {
    if (spec.type != type_pump || random_.below(4) == 0) return;
    spec.config = example_eds("pump.dcf");
    const auto how = random_.below(8);
    if (how == 0) spec.activate = places::Activate::reset;
    if (how == 1) spec.activate = places::Activate::power_cycle;
  }

  plant::PlantDevice& device(TypeCode type) {
    const auto number = plan_.plant.devices.size() + 1;
    // Serial numbers that share long prefixes, are 0, or differ everywhere.
    std::uint32_t serial = static_cast<std::uint32_t>(number);
    if (random_.below(3) == 0) serial = static_cast<std::uint32_t>(random_.next()) | 0x10000U;
    if (number == 1 && random_.below(10) == 0) serial = 0;
    while (std::ranges::any_of(plan_.plant.devices, [&](const auto& d) { return d.address.serial == serial; }))
      ++serial;
    auto& d = add_device(plan_.plant, "d" + std::to_string(number), type, serial);
    d.response.min = between(0us, 3ms);
    d.response.max = d.response.min + between(0us, 5ms);
    if (random_.below(4) == 0) {
      d.response.outlier_ppm = 10'000;
      d.response.outlier = between(10ms, 40ms);
    }
    d.boot = between(1ms, 200ms);
    d.reset = between(1ms, 100ms);
    d.store = between(1ms, 200ms);
    d.deaf_while_storing = random_.below(3) == 0;
    d.power_cycle_after_store = random_.below(16) == 0;
    d.queue = random_.below(2) == 0 ? plant::QueueKind::in_order : plant::QueueKind::priority;
    d.rx_depth = std::array<std::uint32_t, 3>{1, 2, 16}[random_.below(3)];
    d.drift_ppm = static_cast<std::int32_t>(random_.between(-200, 200));
    return d;
  }

  void stored_ids() {
    for (auto& d : plan_.plant.devices) {
      if (random_.below(4) != 0) continue;
      d.source = plant::NodeIdSource::nonvolatile;
      d.node_id = NodeId(static_cast<std::uint8_t>(random_.below(8) == 0 ? 127 : 1 + random_.below(14)));
    }
  }

  void strangers() {
    if (random_.below(3) != 0) return;
    plan_.solvable = false;
    switch (random_.below(4)) {
      case 0: device(types[random_.below(type_count)]); break;  // one too many, or of a type that has no slot
      case 1: device({0x7777, 1}); break;                       // foreign
      case 2: plan_.plant.devices.pop_back(); break;            // one missing
      default: {                                                // a clone
        plant::PlantDevice twin = plan_.plant.devices.front();
        twin.name = "twin";
        plan_.plant.devices.push_back(twin);
      }
    }
  }

  void faults() {
    const auto count = random_.below(5);
    for (std::uint64_t i = 0; i < count; ++i) {
      PlannedFault f;
      f.kind = static_cast<FaultKind>(random_.below(fault_kinds));
      f.column = static_cast<Column>(random_.below(columns));
      // About as long as the phase lasts; binding and watch last long.
      constexpr rt::Duration lasts[] = {60ms, 80ms, 300ms, 120ms, 800ms};
      f.delay = between(0us, lasts[static_cast<int>(f.column)]);
      plan_.faults.push_back(f);
    }
    plan_.restarts = random_.below(2) == 0 ||
                     std::ranges::any_of(plan_.faults, [](const auto& f) { return f.column == Column::preparation; });
    // Preparation is for what an earlier run has bound.
    const bool prepares =
        std::ranges::any_of(plan_.faults, [](const auto& f) { return f.column == Column::preparation; });
    plan_.restart_at = prepares ? between(4s, 9s) : between(500ms, 6s);
  }

  rt::Duration between(rt::Duration low, rt::Duration high) {
    return rt::Duration(random_.between(low.count(), high.count()));
  }

  Random random_;
  WorldPlan plan_;
};

// The fault as an event of the plant, now: explicit, so that it can be written down and replayed.
inline std::vector<plant::PlantEvent> events_of(FaultKind kind, const plant::PlantFile& plant, rt::Duration now,
                                                Random& random) {
  using plant::Action;
  std::vector<plant::PlantEvent> events;
  const std::string who = plant.devices.empty() ? "" : plant.devices[random.below(plant.devices.size())].name;
  const auto some = [&](std::int64_t low_ms, std::int64_t high_ms) {
    return rt::Duration(std::chrono::milliseconds(random.between(low_ms, high_ms)));
  };
  const auto add = [&](Action action, rt::Duration later = 0ms) -> plant::PlantEvent& {
    plant::PlantEvent e;
    e.delay = now + later;
    e.action = action;
    e.device = who;
    events.push_back(e);
    return events.back();
  };
  const auto on_bus = [&](plant::PlantEvent& e) -> plant::PlantEvent& {
    e.device.clear();
    e.bus = "backbone";
    return e;
  };
  switch (kind) {
    case FaultKind::overrun: on_bus(add(Action::overrun)).nodes = {who}; break;
    case FaultKind::overrun_master: on_bus(add(Action::overrun)).nodes = {std::string(plant::master_name)}; break;
    case FaultKind::disturb: {
      auto& e = on_bus(add(Action::disturb));
      e.strike.bit = static_cast<std::int32_t>(random.below(60));
      e.strike.times = static_cast<std::uint32_t>(1 + random.below(3));
      if (random.below(2) == 0) e.nodes = {who};
      break;
    }
    case FaultKind::twice: {
      auto& e = on_bus(add(Action::disturb));
      e.strike.kind = plant::Disturbance::dominant;
      e.strike.from_end = true;
      e.strike.bit = 0;
      // Only the sender sees the last bit of end-of-frame wrong: everybody else has the frame, and gets it again.
      e.nodes = random.below(2) == 0 ? std::vector<std::string>{std::string(plant::master_name)}
                                     : std::vector<std::string>{who};
      e.strike.times = 2;
      break;
    }
    case FaultKind::slow: {
      auto& e = add(Action::slow);
      e.latency = some(5, 150);
      e.duration = some(20, 800);
      break;
    }
    case FaultKind::deaf: add(Action::deaf).duration = some(10, 900); break;
    case FaultKind::reset: add(Action::reset); break;
    case FaultKind::power:
      add(Action::power_off);
      add(Action::power_on, some(1, 2500));
      break;
    case FaultKind::unplug:
      add(Action::unplug);
      add(Action::plug, some(1, 2500));
      break;
    case FaultKind::cut: {
      on_bus(add(Action::cut_cable)).nodes = {who};
      on_bus(add(Action::join, some(1, 1500)));
      break;
    }
    case FaultKind::count: break;
  }
  return events;
}

}  // namespace berth::harness

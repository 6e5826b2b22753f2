// Random machines, plants and faults from a seed, as explicit data for replaying and shrinking a failed run.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

#include "berth/discovery/discovery.hpp"
#include "berth/harness/folders.hpp"
#include "berth/harness/rig.hpp"
#include "berth/lss/frames.hpp"

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
  waiting_lost,  // one device loses the next `04 00`
  away,          // a device leaves for 30 to 90 s
  gone,          // a device leaves forever
  count
};
inline const char* name(FaultKind k) {
  constexpr const char* names[] = {"overrun",    "overrun master", "disturb",    "frame twice", "slow",
                                   "deaf",       "reset",          "power loss", "unplug",      "cable cut",
                                   "04 00 lost", "long away",      "gone"};
  return names[static_cast<int>(k)];
}
inline constexpr int world_fault_kinds = static_cast<int>(FaultKind::count);
// A single search is tried with these, too.
inline constexpr int fault_kinds = static_cast<int>(FaultKind::away);

// A fault that waits for a step of a binding and strikes before it, at this device.
enum class StepKind : std::uint8_t {
  power,         // the device loses power
  berth,         // Berth ends, and begins anew
  request_lost,  // the device loses the step's next frame
  answer_lost,   // Berth loses the device's next frame
  count
};
inline const char* name(StepKind k) {
  constexpr const char* names[] = {"device off", "Berth ended", "request lost", "answer lost"};
  return names[static_cast<int>(k)];
}
inline constexpr int step_kinds = static_cast<int>(StepKind::count);
inline constexpr places::Step aimed_steps[] = {
    places::Step::check_vacant,  places::Step::write_ask, places::Step::select,       places::Step::inquire,
    places::Step::configure,     places::Step::store,     places::Step::release,      places::Step::reset,
    places::Step::await_boot_up, places::Step::identify,  places::Step::write_confirm};
inline constexpr int steps = static_cast<int>(std::size(aimed_steps));
// The identifier of the frame that is lost at a step; none: the step sends no frame to the device and waits for none.
inline std::optional<std::uint32_t> frame_of(StepKind kind, places::Step step, NodeId id) {
  using places::Step;
  const bool lss = step == Step::select || step == Step::inquire || step == Step::configure || step == Step::store;
  if (kind == StepKind::request_lost) {
    if (lss || step == Step::release) return 0x7E5;
    if (step == Step::reset) return 0x000;
    if (step == Step::identify && id.configured()) return 0x600U + id.value();
  }
  if (kind == StepKind::answer_lost) {
    if (lss) return 0x7E4;
    if (step == Step::await_boot_up) return 0x700U + id.value();
    if (step == Step::identify && id.configured()) return 0x580U + id.value();
  }
  return std::nullopt;
}
inline bool can_strike(StepKind kind, places::Step step) {
  if (kind == StepKind::power || kind == StepKind::berth) return true;
  return frame_of(kind, step, NodeId(1)).has_value();
}
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

// A fault that waits for its phase on a bus, then for `delay`.
struct PlannedFault {
  FaultKind kind = FaultKind::overrun;
  Column column = Column::discovery;
  rt::Duration delay{0};
  std::size_t bus = 0;
};

// A fault that waits for this step, skips `skip` such steps, and then strikes `delay` after its beginning.
struct StepFault {
  StepKind kind = StepKind::power;
  int step = 0;  // of `aimed_steps`
  unsigned skip = 0;
  rt::Duration delay{0};
  std::optional<rt::Duration> back = 300ms;  // how long the device, or Berth, is away; none: forever
};

// The cable of the device in this slot is cut for 30 s, `delay` after the slot was operational.
struct LongCut {
  std::string slot;
  rt::Duration delay{0};
};

struct WorldPlan {
  std::uint64_t seed = 0;
  design::Machine machine;
  plant::PlantFile plant;
  std::vector<PlannedFault> faults;
  std::vector<StepFault> step_faults;
  bool solvable = true;   // every slot has exactly one device that fits: the end must be operational
  bool restarts = false;  // Berth is ended and begun again in the middle
  rt::Duration restart_at{0};
  bool replaces = false;   // the user gives `berth replace` for a slot whose device left for long
  bool perturbed = false;  // jobs of one instant in random order
  std::vector<LongCut> long_cuts;
  std::vector<std::string> waiting;           // devices that `waits` has made take a node-ID only at power-on
  bool calm = false;                          // no faults but the long cuts: waiting devices delay no other
  bool words = false;                         // reports are judged (word_judge.hpp)
  std::vector<plant::PlantEvent> later = {};  // devices that are plugged in at their times in any case
};

// The kind of worlds that a seed gives.
struct Draws {
  // Two or three buses, with devices that have the address of one on another bus: other worlds than those of the same
  // seeds without this.
  bool twins = false;
  // With what `waits` draws, and `WordJudge`; without, the worlds are those from before these existed.
  bool waits = true;
  // With what `AsSold` draws (as_sold.hpp).
  bool as_sold = false;
};

class Planner {
 public:
  Planner(std::uint64_t seed, Draws draws, Folders folders)
      : random_(seed * 0x9E3779B97F4A7C15ULL + 1),
        folders_(std::move(folders)),
        twins_(draws.twins),
        waits_(draws.waits) {
    plan_.seed = seed;
  }

  WorldPlan make() {
    machine();
    for (std::size_t i = 0; i < plan_.machine.slots.size(); ++i) device(plan_.machine.slots[i].spec);
    stored_ids();
    strangers();
    faults();
    spares();
    plan_.perturbed = random_.below(2) == 0;
    habits();
    if (twins_) twins();
    if (waits_) waits();
    plan_.words = waits_;
    return std::move(plan_);
  }

 private:
  static constexpr std::size_t type_count = 4;
  static constexpr TypeCode types[type_count] = {type_a, type_b, type_c, type_pump};

  void machine() {
    const auto draw = random_.below(10);
    const std::size_t fewest = twins_ ? 2 : 1;
    const std::size_t buses = draw < 7 ? fewest : draw < 9 ? 2 : 3;
    plan_.plant = one_bus_plant(plan_.seed);
    slow_stores_ = random_.below(4) == 0;
    constexpr std::uint32_t rates[] = {50'000, 125'000, 500'000, 1'000'000};
    constexpr const char* names[] = {"backbone", "second", "third"};
    for (std::size_t i = 0; i < buses; ++i) {
      if (i == 0) {
        plan_.machine = one_bus(rates[random_.below(4)]);
      } else {
        design::Bus more = plan_.machine.buses.front();
        more.name = names[i];
        more.bitrate = rates[random_.below(4)];
        plan_.machine.buses.push_back(more);
        plan_.plant.buses.push_back({more.name, 0});
      }
      bus(plan_.machine.buses.back());
      slots(plan_.machine.buses.back().name, 1 + random_.below(buses == 1 ? 5 : 3));
    }
  }

  void bus(design::Bus& bus) {
    auto& timing = bus.timing;
    timing.rand_response = 12ms;
    timing.boot_timeout = 2s;
    timing.heartbeat_period = 200ms;
    timing.heartbeat_timeout = 700ms;
    timing.probe_period = 400ms;
    timing.sdo_timeout = 200ms;
    timing.store_timeout = slow_stores_ ? rt::Duration(2500ms) : rt::Duration(1s);
    timing.save_timeout = timing.store_timeout;
    const auto way = random_.below(2 * discovery::methods);
    bus.discovery = "auto";
    if (way < discovery::methods) bus.discovery = discovery::name(static_cast<discovery::Method>(way));
  }

  void slots(const std::string& bus, std::uint64_t count) {
    while (count > 0) {
      const auto id = static_cast<unsigned>(1 + random_.below(12));
      if (plan_.machine.slot(bus, NodeId(static_cast<std::uint8_t>(id))) != nullptr) continue;
      --count;
      add_slot(plan_.machine, id, types[random_.below(type_count)], bus);
      auto& spec = plan_.machine.slots.back().spec;
      configuration(spec);
      if (random_.below(3) == 0) spec.replacement = places::Replacement::automatic;
      if (random_.below(8) == 0) {
        spec.rule = places::RevisionRule::exact;
        spec.revision = static_cast<std::uint32_t>(1 + random_.below(2));
      }
    }
  }

  void configuration(places::SlotSpec& spec) {
    if (spec.type != type_pump || random_.below(4) == 0) return;
    spec.config = folders_.example("pump.dcf");
    const auto how = random_.below(8);
    if (how == 0) spec.configuring.activate = places::Activate::reset;
    if (how == 1) spec.configuring.activate = places::Activate::power_cycle;
  }

  [[nodiscard]] std::string method_of(const std::string& bus) const { return plan_.machine.bus(bus)->discovery; }

  // Protocols that the bus's one method finds; if all methods are tried, mostly RAND.
  plant::SpeaksSet speaks(const std::string& bus) {
    using enum plant::Speaks;
    const auto method = discovery::method(method_of(bus));
    if (!method) {
      constexpr plant::Speaks others[] = {lss, fastscan, feedback_29, feedback_11, rand_resume, rand, rand, rand};
      plant::SpeaksSet set{lss};
      const bool mixed = random_.below(3) == 0;
      set.add(mixed ? others[random_.below(8)] : rand);
      return set;
    }
    switch (*method) {
      case discovery::Method::rand:
      case discovery::Method::planner_rand: return {lss, rand};
      case discovery::Method::and_protocol: return {lss, and_protocol};
      case discovery::Method::fastscan:
      case discovery::Method::planner_fastscan: return {fastscan};
      case discovery::Method::feedback_29: return {feedback_29};
      case discovery::Method::feedback_11: return {feedback_11};
      case discovery::Method::planner_feedback:
        return random_.below(2) == 0 ? plant::SpeaksSet{feedback_29} : plant::SpeaksSet{feedback_11};
      case discovery::Method::identify: return {lss};
    }
    return {lss, rand};
  }

  // Stacks that support only Fastscan, each in its way, on buses where Berth searches for such. Drawn separately:
  // worlds without them do not change.
  void habits() {
    Random random(plan_.seed ^ 0x4A81);
    for (auto& d : plan_.plant.devices) {
      const auto way = method_of(d.bus);
      const bool reached = way == "auto" || way == "planner-fastscan";
      if (!reached || random.below(10) != 0) continue;
      d.lss.habit = static_cast<plant::Habit>(random.below(2));
      d.speaks = {plant::Speaks::fastscan};
    }
  }

  // Devices that wait for the user, and cables that are off for long. Drawn separately: worlds without them do not
  // change.
  void waits() {
    Random random(plan_.seed ^ 0xD15C);
    const bool power = random.below(4) == 0, cuts = random.below(4) == 0;
    if (power) wait_for_power(random);
    if (cuts) cut_for_long(random);
    plan_.calm = (power || cuts) && random.below(2) == 0;
    if (!plan_.calm) return;
    plan_.faults.clear();
    plan_.step_faults.clear();
    plan_.restarts = plan_.replaces = false;
  }

  // One device or two take a node-ID only at power-on; the one that they come with is mostly not the one that they
  // should have.
  void wait_for_power(Random& random) {
    auto& devices = plan_.plant.devices;
    const auto many = 1 + random.below(2);
    for (std::uint64_t i = 0; i < many && !devices.empty(); ++i) {
      auto& d = devices[random.below(devices.size())];
      if (!d.plugged || std::ranges::find(plan_.waiting, d.name) != plan_.waiting.end()) continue;
      plan_.waiting.push_back(d.name);
      d.storing.power_cycle_after = true;
      const auto story = random.below(4);
      if (story == 3) continue;
      d.source = plant::NodeIdSource::nonvolatile;
      // No slot's node-ID: those are 1 to 12.
      d.node_id =
          story == 0 ? plan_.machine.bus(d.bus)->master : NodeId(static_cast<std::uint8_t>(random.between(20, 120)));
    }
  }

  void cut_for_long(Random& random) {
    auto& slots = plan_.machine.slots;
    const auto many = 1 + random.below(2);
    for (std::uint64_t i = 0; i < many; ++i) {
      auto& spec = slots[random.below(slots.size())].spec;
      spec.optional = true;
      spec.replacement = places::Replacement::automatic;
      const auto delay = rt::Duration(random.between(0, rt::Duration(3s).count()));
      plan_.long_cuts.push_back({spec.name.name, delay});
    }
  }

  // An address is unique only on its bus: devices of one type on two buses get one address (most real ones have no
  // serial number). `strangers` draws clones on one bus; and AND does not report the revision number.
  void twins() {
    Random random(plan_.seed ^ 0x7317);
    auto& devices = plan_.plant.devices;
    for (auto& d : devices) {
      const auto other = std::ranges::find_if(devices, [&](const auto& o) {
        return o.bus != d.bus && o.address != d.address && o.address.type() == d.address.type();
      });
      if (other == devices.end() || random.below(4) == 0) continue;
      LssAddress address = other->address;
      address.revision = d.address.revision;  // a slot may ask for it
      const bool taken = std::ranges::any_of(
          devices, [&](const auto& o) { return &o != &d && o.bus == d.bus && o.address.serial == address.serial; });
      if (!taken) d.address = address;
    }
  }

  // A device that fits the slot.
  plant::PlantDevice& device(const places::SlotSpec& spec) {
    auto& d = device(spec.type, spec.name.bus);
    if (spec.revision) d.address.revision = *spec.revision;
    return d;
  }

  plant::PlantDevice& device(TypeCode type, const std::string& bus) {
    const auto number = plan_.plant.devices.size() + 1;
    // Serial numbers that share long prefixes, are 0, or differ everywhere.
    std::uint32_t serial = static_cast<std::uint32_t>(number);
    if (random_.below(3) == 0) serial = static_cast<std::uint32_t>(random_.next()) | 0x10000U;
    if (number == 1 && random_.below(10) == 0) serial = 0;
    while (std::ranges::any_of(plan_.plant.devices, [&](const auto& d) { return d.address.serial == serial; }))
      ++serial;
    auto& d = add_plain_device(plan_.plant, "d" + std::to_string(number), type, serial, bus);
    if (type == type_pump) d.eds = d.eds_path = folders_.example("pump.eds");
    d.speaks = speaks(bus);
    d.response.min = between(0us, 3ms);
    d.response.max = d.response.min + between(0us, 5ms);
    // The published windows are fixed: devices that answer after them are not found, as published (see "missed").
    const bool published = method_of(bus) != "auto" && !method_of(bus).starts_with("planner");
    if (random_.below(4) == 0 && !published) {
      d.response.outlier_ppm = 10'000;
      d.response.outlier = between(10ms, 40ms);
    }
    d.boot = between(1ms, 200ms);
    d.reset = between(1ms, 100ms);
    d.storing.time = between(1ms, 200ms);
    if (slow_stores_ && random_.below(2) == 0) d.storing.time = between(300ms, 2s);
    d.storing.deaf = random_.below(3) == 0;
    d.storing.power_cycle_after = random_.below(16) == 0;
    d.controller.queue = random_.below(2) == 0 ? plant::QueueKind::in_order : plant::QueueKind::priority;
    // RAND's frames leave time to a small receive buffer, and `auto` pauses between the frames of LSS where it must;
    // the other searches send 40h to 4Bh back to back.
    const auto way = method_of(bus);
    const bool by_rand = d.speaks.has(plant::Speaks::rand) && way == "rand";
    d.controller.rx_depth = std::array<std::uint32_t, 3>{1, 2, 16}[random_.below(3)];
    if (!by_rand && way != "auto") d.controller.rx_depth = 32;
    d.controller.drift_ppm = static_cast<std::int32_t>(random_.between(-200, 200));
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
    const std::string bus = plan_.machine.buses[random_.below(plan_.machine.buses.size())].name;
    switch (random_.below(4)) {
      case 0: device(types[random_.below(type_count)], bus); break;  // one too many, or of a type that has no slot
      case 1: device({0x7777, 1}, bus); break;                       // foreign
      case 2: plan_.plant.devices.pop_back(); break;                 // one missing
      default: {                                                     // a clone
        plant::PlantDevice clone = plan_.plant.devices.front();
        clone.name = "clone";
        plan_.plant.devices.push_back(clone);
      }
    }
  }

  void faults() {
    const auto count = random_.below(5);
    for (std::uint64_t i = 0; i < count; ++i) {
      PlannedFault f;
      f.kind = static_cast<FaultKind>(random_.below(world_fault_kinds));
      // These make a world long, and there are enough of them.
      const bool leaves = f.kind == FaultKind::away || f.kind == FaultKind::gone;
      if (leaves && random_.below(2) == 0) f.kind = static_cast<FaultKind>(random_.below(fault_kinds));
      f.column = static_cast<Column>(random_.below(columns));
      // About as long as the phase lasts; binding and watch last long.
      constexpr rt::Duration lasts[] = {60ms, 80ms, 300ms, 120ms, 800ms};
      f.delay = between(0us, lasts[static_cast<int>(f.column)]);
      f.bus = random_.below(plan_.machine.buses.size());
      plan_.faults.push_back(f);
    }
    // A search by one method assigns node-IDs by address at its end, with one `04 00` each.
    for (std::size_t i = 0; i < plan_.machine.buses.size(); ++i) {
      if (plan_.machine.buses[i].discovery == "auto" || random_.below(3) != 0) continue;
      plan_.faults.push_back({FaultKind::waiting_lost, Column::discovery, between(0us, 1500ms), i});
    }
    const auto aimed = random_.below(4);
    for (std::uint64_t i = 0; i < aimed; ++i) step_fault();
    plan_.restarts = random_.below(2) == 0 ||
                     std::ranges::any_of(plan_.faults, [](const auto& f) { return f.column == Column::preparation; });
    // Preparation concerns what an earlier run has bound.
    const bool prepares =
        std::ranges::any_of(plan_.faults, [](const auto& f) { return f.column == Column::preparation; });
    plan_.restart_at = prepares ? between(4s, 9s) : between(500ms, 6s);
    plan_.replaces = random_.below(2) == 0;
  }

  void step_fault() {
    StepFault f;
    do {
      f.kind = static_cast<StepKind>(random_.below(step_kinds));
      f.step = static_cast<int>(random_.below(steps));
    } while (!can_strike(f.kind, aimed_steps[f.step]));
    f.skip = static_cast<unsigned>(random_.below(3));
    // Half of them exactly between two steps: for example after the answer to 17h and before the `04 00`.
    if (random_.below(2) == 0) f.delay = between(0us, 4ms);
    const auto lasts = random_.below(8);
    f.back = between(1ms, 2500ms);
    if (f.kind == StepKind::power && lasts >= 5) f.back = between(30s, 90s);
    if (f.kind == StepKind::power && lasts == 7) f.back.reset();
    plan_.step_faults.push_back(f);
  }

  // Spares that the user brings when a device stays away; each has a history of its own.
  void spares() {
    const auto departs = [](const auto& f) { return f.kind == FaultKind::away || f.kind == FaultKind::gone; };
    const auto stays_away = [](const auto& f) { return !f.back || *f.back > 10s; };
    const bool gone = std::ranges::any_of(plan_.faults, [](const auto& f) { return f.kind == FaultKind::gone; }) ||
                      std::ranges::any_of(plan_.step_faults, [](const auto& f) { return !f.back; });
    if (gone) plan_.solvable = false;
    const bool leaves =
        std::ranges::any_of(plan_.faults, departs) || std::ranges::any_of(plan_.step_faults, stays_away);
    if (!leaves || random_.below(3) == 0) return;
    plan_.solvable = false;
    const std::size_t most = plan_.machine.slots.size();
    for (std::size_t i = 0; i < most; ++i) {
      auto& d = device(plan_.machine.slots[i].spec);
      d.plugged = false;
      if (random_.below(4) != 0) continue;
      d.source = plant::NodeIdSource::nonvolatile;
      d.node_id = NodeId(static_cast<std::uint8_t>(1 + random_.below(14)));
    }
  }

  rt::Duration between(rt::Duration low, rt::Duration high) {
    return rt::Duration(random_.between(low.count(), high.count()));
  }

  Random random_;
  Folders folders_;
  WorldPlan plan_;
  bool slow_stores_ = false;
  bool twins_ = false;
  bool waits_ = false;
};

// This device loses the next `04 00` of its bus; then `hit` is called with the number of the frame.
inline void lose_next_waiting(plant::World& world, const std::string& who, std::function<void(std::uint64_t)> hit) {
  plant::SimDevice* const device = world.find(who);
  if (device == nullptr) return;
  sim::Fault fault;
  fault.kind = sim::Fault::Kind::overrun;
  fault.trigger.when = [hit = std::move(hit), done = false](const sim::FrameStart& start) mutable {
    const bool waiting = start.frame.key() == lss::master_cob_id && start.frame.data[0] == 0x04 &&
                         start.frame.data[1] == static_cast<std::uint8_t>(lss::State::waiting);
    if (waiting && !std::exchange(done, true)) hit(start.number);
    return waiting;
  };
  fault.victims = {&device->controller()};
  device->bus().inject(std::move(fault));
}

// The device that a fault strikes: of this bus, or of any if that is empty.
inline std::string victim(const plant::PlantFile& plant, const std::string& bus, Random& random) {
  std::vector<std::string> all;
  for (const auto& d : plant.devices) {
    if (bus.empty() || d.bus == bus) all.push_back(d.name);
  }
  return all.empty() ? std::string() : all[random.below(all.size())];
}

// Some bits of one frame, for everybody or for this device.
inline void spoil_bits(plant::PlantEvent& e, const std::string& who, Random& random) {
  e.strike.bit = static_cast<std::int32_t>(random.below(60));
  e.strike.times = static_cast<std::uint32_t>(1 + random.below(3));
  if (random.below(2) == 0) e.nodes = {who};
}

// Only the sender sees the last bit of end-of-frame wrong: all others have the frame, and get it again.
inline void spoil_last_bit(plant::PlantEvent& e, const std::string& who, Random& random) {
  e.strike.kind = plant::Disturbance::dominant;
  e.strike.from_end = true;
  e.strike.bit = 0;
  e.nodes =
      random.below(2) == 0 ? std::vector<std::string>{std::string(plant::master_name)} : std::vector<std::string>{who};
  e.strike.times = 2;
}

// The fault as plant events that happen now: explicit, so that they can be written down and replayed.
inline std::vector<plant::PlantEvent> events_of(FaultKind kind, const std::string& who, const std::string& bus,
                                                rt::Duration now, Random& random) {
  using plant::Action;
  std::vector<plant::PlantEvent> events;
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
    e.bus = bus;
    return e;
  };
  switch (kind) {
    case FaultKind::overrun: on_bus(add(Action::overrun)).nodes = {who}; break;
    case FaultKind::overrun_master: on_bus(add(Action::overrun)).nodes = {std::string(plant::master_name)}; break;
    case FaultKind::disturb: spoil_bits(on_bus(add(Action::disturb)), who, random); break;
    case FaultKind::twice: spoil_last_bit(on_bus(add(Action::disturb)), who, random); break;
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
    case FaultKind::away:
      add(Action::unplug);
      add(Action::plug, some(30'000, 90'000));
      break;
    case FaultKind::gone: add(Action::unplug); break;
    case FaultKind::waiting_lost:  // `lose_next_waiting`
    case FaultKind::count: break;
  }
  return events;
}

}  // namespace berth::harness

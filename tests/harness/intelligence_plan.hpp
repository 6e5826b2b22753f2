// Random machines whose devices have programs, configurations and links, led by one Berth or by two as flying masters,
// and what goes wrong in them, from a seed (docs/faults.md, "Programs, configurations, links, take-over").
#pragma once

#include <fmt/format.h>

#include <optional>
#include <string>
#include <vector>

#include "berth/harness/world_plan.hpp"
#include "tests/harness/rig.hpp"

namespace berth::harness {

inline constexpr TypeCode type_controller{0x0000'0001, 0x0000'0060};
inline constexpr TypeCode type_io{0x0000'0001, 0x0000'0003};

// What Berth does with a device when a fault strikes; the frames between them show it.
enum class Stage : std::uint8_t {
  identity,       // it asks for the identity (1000h, 1018h, 1009h, 100Ah)
  program,        // 1F50h to 1F5Ah
  configuration,  // 1010h, 1017h, 1020h and the device's own objects
  links,          // its PDOs (1400h to 1BFFh)
  running,        // its heartbeat reports operational
  count
};
inline constexpr int stages = static_cast<int>(Stage::count);
inline const char* name(Stage stage) {
  constexpr const char* names[] = {"identity", "program", "configuration", "links", "running"};
  return names[static_cast<int>(stage)];
}
inline std::optional<Stage> stage_of(std::uint16_t index) {
  if (index == 0x1000 || index == 0x1018 || (index >= 0x1008 && index <= 0x100A)) return Stage::identity;
  if (index >= 0x1F50 && index <= 0x1F5A) return Stage::program;
  if (index >= 0x1400 && index <= 0x1BFF) return Stage::links;
  const bool own = index >= 0x2000 && index < 0xA000;
  if (index == 0x1010 || index == 0x1017 || index == 0x1020 || own) return Stage::configuration;
  return std::nullopt;
}

enum class StageKind : std::uint8_t {
  overrun,         // the device loses a frame
  overrun_master,  // Berth loses a frame
  disturb,
  twice,  // a frame comes twice
  slow,
  deaf,
  reset,
  power,      // off for at most 2.5 s
  cut,        // its cable is cut
  away,       // off the bus for 3 to 15 s
  exchanged,  // for another device of its type
  berth,      // the active Berth ends, and begins again later
  count
};
inline constexpr int stage_kinds = static_cast<int>(StageKind::count);
inline const char* name(StageKind kind) {
  constexpr const char* names[] = {"overrun", "overrun master", "disturb",   "frame twice", "slow",      "deaf",
                                   "reset",   "power loss",     "cable cut", "away",        "exchanged", "Berth ended"};
  return names[static_cast<int>(kind)];
}

// Waits for `skip` frames of this stage, of any device, and strikes that device `delay` after the next one.
struct StageFault {
  StageKind kind = StageKind::overrun;
  Stage stage = Stage::identity;
  unsigned skip = 0;
  rt::Duration delay{0};
  rt::Duration back{0};
};

struct IntelligencePlan {
  std::uint64_t seed = 0;
  design::Machine machine;
  plant::PlantFile plant;  // each slot's device, then each slot's spare, which is not plugged in
  std::vector<StageFault> faults;
  std::vector<std::uint8_t> priorities;  // of the Berths; a single one is no flying master
  bool perturbed = false;
  [[nodiscard]] std::size_t slots() const noexcept { return machine.slots.size(); }
};

inline std::string controller_image(unsigned version) {
  return test::source_dir() + fmt::format("/examples/programs/controller-{}.bprg", version);
}
inline constexpr unsigned wanted_version = 2;

class IntelligencePlanner {
 public:
  // Another constant than that of `Planner`: the same seeds give other worlds.
  explicit IntelligencePlanner(std::uint64_t seed) : random_(seed * 0x9E3779B97F4A7C15ULL + 0x302) {
    plan_.seed = seed;
  }

  IntelligencePlan make() {
    constexpr std::uint32_t rates[] = {125'000, 250'000, 500'000, 1'000'000};
    plan_.machine = one_bus(rates[random_.below(4)]);
    plan_.plant = one_bus_plant(plan_.seed);
    timing();
    const auto count = 2 + random_.below(4);
    for (unsigned id = 1; id <= count; ++id) slot(id);
    links();
    for (const bool spare : {false, true}) {
      for (const auto& each : plan_.machine.slots) device(each.spec, spare);
    }
    plan_.priorities = {static_cast<std::uint8_t>(random_.below(3))};
    if (random_.below(2) == 0) plan_.priorities.push_back(static_cast<std::uint8_t>(random_.below(3)));
    const auto faults = 1 + random_.below(6);
    for (std::uint64_t i = 0; i < faults; ++i) fault();
    plan_.perturbed = random_.below(2) == 0;
    return std::move(plan_);
  }

 private:
  void timing() {
    auto& t = plan_.machine.buses.front().timing;
    t.heartbeat_period = 200ms;
    t.heartbeat_timeout = 700ms;
    t.probe_period = 400ms;
    t.sdo_timeout = 200ms;
    t.boot_timeout = 2s;
  }

  void slot(unsigned id) {
    constexpr TypeCode types[] = {type_controller, type_pump, type_io, type_io};
    add_slot(plan_.machine, id, types[random_.below(4)]);
    auto& slot = plan_.machine.slots.back();
    slot.queue = design::SendOrder::priority;  // Berth's actions are judged here, not the times of PDOs
    slot.spec.replacement = places::Replacement::automatic;
    if (slot.spec.type == type_controller) {
      slot.spec.software.programs = {{1, controller_image(wanted_version), {}}};
    } else if (slot.spec.type == type_pump) {
      slot.spec.config = example_eds("pump.dcf");
      slot.inhibit = 10ms;  // its PDOs have no inhibit time: without this no link has a bound
      if (random_.below(4) == 0) slot.spec.configuring.activate = places::Activate::reset;
    } else {
      slot.eds = slot.eds_path = example_eds("io.eds");
    }
  }

  // Links each module's inputs to the outputs of the next module.
  void links() {
    std::vector<std::string> modules;
    for (const auto& slot : plan_.machine.slots) {
      if (slot.spec.type == type_io) modules.push_back(slot.spec.name.name);
    }
    for (std::size_t i = 0; modules.size() > 1 && i < modules.size(); ++i) {
      design::Link link;
      link.from = {modules[i], "6000h:01"};
      link.to = {{modules[(i + 1) % modules.size()], "6200h:01"}};
      link.deadline = 50ms;
      plan_.machine.links.push_back(link);
    }
  }

  void device(const places::SlotSpec& spec, bool spare) {
    const auto number = static_cast<std::uint32_t>(plan_.plant.devices.size() + 1);
    auto& d = add_device(plan_.plant, fmt::format("{}{}", spare ? "spare " : "d", spec.id.value()), spec.type, number);
    d.plugged = !spare;
    if (spec.type == type_io) d.eds = d.eds_path = example_eds("io.eds");
    d.response.min = between(0us, 2ms);
    d.response.max = d.response.min + between(0us, 3ms);
    d.boot = between(1ms, 150ms);
    d.reset = between(1ms, 80ms);
    d.storing.time = between(1ms, 150ms);
    d.storing.deaf = random_.below(3) == 0;
    d.controller.queue = random_.below(2) == 0 ? plant::QueueKind::in_order : plant::QueueKind::priority;
    // With a server that takes two segments of a block at a time, a download would last minutes.
    d.controller.rx_depth = random_.below(4) == 0 && spec.type != type_controller ? 2 : 16;
    d.controller.drift_ppm = static_cast<std::int32_t>(random_.between(-200, 200));
    if (spec.type == type_controller) programs(d);
  }

  void programs(plant::PlantDevice& d) {
    auto& p = d.storing.programs;
    p.count = 1;
    p.size = 16'384;
    p.images = static_cast<std::uint32_t>(1 + random_.below(2));
    p.erase = between(1ms, 30ms);
    p.write = between(1us, 20us);
    const auto loaded = static_cast<unsigned>(random_.below(3));  // none, the older one, the right one
    if (loaded != 0) p.loaded = p.loaded_path = controller_image(loaded);
  }

  void fault() {
    StageFault f;
    f.kind = static_cast<StageKind>(random_.below(stage_kinds));
    do {
      f.stage = static_cast<Stage>(random_.below(stages));
    } while (!occurs(f.stage));
    f.skip = static_cast<unsigned>(random_.below(random_.below(2) == 0 ? 4 : f.stage == Stage::program ? 300 : 15));
    // Half of them directly after that frame.
    if (random_.below(2) == 0) f.delay = between(0us, f.stage == Stage::program ? 300ms : 5ms);
    f.back = between(1ms, 2500ms);
    if (f.kind == StageKind::away) f.back = between(3s, 15s);
    if (f.kind == StageKind::berth && random_.below(2) == 0) f.back = between(2s, 10s);
    plan_.faults.push_back(f);
  }

  [[nodiscard]] bool occurs(Stage stage) const {
    if (stage == Stage::links) return !plan_.machine.links.empty();
    return stage != Stage::program || std::ranges::any_of(plan_.machine.slots, [](const design::Slot& slot) {
             return slot.spec.type == type_controller;
           });
  }

  rt::Duration between(rt::Duration low, rt::Duration high) {
    return rt::Duration(random_.between(low.count(), high.count()));
  }

  Random random_;
  IntelligencePlan plan_;
};

}  // namespace berth::harness

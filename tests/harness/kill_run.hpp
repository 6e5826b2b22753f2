// One machine, brought up by a Berth that dies at a chosen point, perhaps again while it recovers, and then by one that
// survives: what must hold meanwhile and at the end.
#pragma once

#include <stdlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "berth/harness/end_judge.hpp"
#include "berth/harness/run_world.hpp"
#include "berth/traffic/link_network.hpp"
#include "tests/harness/mortal.hpp"
#include "tests/harness/program_watch.hpp"
#include "tests/harness/rig.hpp"

namespace berth::harness {

enum class Scenario : std::uint8_t {
  blank,       // two devices of one type without a node-ID
  taken,       // one blank, the other came with the first one's node-ID stored
  crossed,     // each came with the other's node-ID stored
  replaced,    // one left; its replacement has stored a node-ID of no slot, and the user gives `berth replace`
  stranger,    // beside the two, a device without a slot holds a slot's node-ID
  configured,  // one of the two gets a configuration, which it saves
  away,        // a device that loses power stays away for 60 s, and a spare of its type is plugged in meanwhile
  gone,        // the same, forever
  programmed,  // one of the two has an older program than its slot's, and gets the slot's
  linked,      // an input of one is linked to outputs of the other: PDOs in both
  first,       // as blank, and without a store at first: only the points of its file
  count,
};
inline const char* name(Scenario s) {
  constexpr const char* names[] = {"blank", "taken", "crossed",    "replaced", "stranger", "configured",
                                   "away",  "gone",  "programmed", "linked",   "first"};
  return names[static_cast<int>(s)];
}
inline constexpr int scenarios = static_cast<int>(Scenario::count);

// Which of them dies at a point of a device's memory.
enum class Victim : std::uint8_t { berth, device, both };

// How one run of Berth ends; empty: it may survive.
struct Death {
  std::optional<std::uint64_t> at;    // this point of the axe's trace
  std::optional<std::uint64_t> disk;  // this step of the store's disk
  std::optional<std::uint64_t> torn;  // after so many bytes of device memory, counted per device
  std::string torn_device;
  bool torn_program = false;  // in the memory of its programs
  std::string off;            // at `at` this device loses power; Berth dies with `Victim::both` only
  std::string loses;          // at `at` this device, or "master", loses the frame; Berth lives
  Victim victim = Victim::berth;
  store::Loss loss = store::Loss::none;  // what becomes of the unsynced writes
  bool restart_late = false;             // the next Berth begins after the devices' timeouts, otherwise at once
};

struct Life {
  bool died = false;    // the axe fell, or the disk crashed
  bool struck = false;  // what was planned happened
  std::string failure;  // it survived, and did not finish
  std::vector<PointKind> trace;
  std::uint64_t disk_steps = 0;
};

inline constexpr std::uint8_t older_program = 3;
inline constexpr std::uint8_t wanted_program = 5;
// A program short enough for a test of every byte of it, and its image as a file.
inline std::vector<std::uint8_t> small_program(std::uint8_t number) {
  std::vector<std::uint8_t> content(150);
  for (std::size_t i = 0; i < content.size(); ++i) content[i] = static_cast<std::uint8_t>(i * number + number);
  return content;
}
inline std::string small_image(std::uint8_t number) {
  static const std::string folder = [] {
    std::string pattern = (std::filesystem::temp_directory_path() / "berth-kill-XXXXXX").string();
    return std::string(::mkdtemp(pattern.data()));
  }();
  const std::string path = folder + "/program-" + std::to_string(number);
  if (std::filesystem::exists(path)) return path;
  const auto bytes = device::make_program_image({}, small_program(number));
  std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::ssize(bytes));
  return path;
}

class KillWorld final {
 public:
  explicit KillWorld(Scenario scenario)
      : scenario_(scenario),
        store_(axe_, disk_),
        rig_(machine(scenario), plant(scenario), &store_),
        machine_(machine(scenario)),
        watch_(rig_.world(), machine_, nullptr),
        configured_(rig_.world(), machine_, store_),
        judge_(rig_, machine_, watch_, configured_),
        programs_(rig_.world(), crc32(small_program(wanted_program))) {
    for (const auto& d : rig_.world().devices()) {
      memories_.push_back(std::make_unique<Memory>(*this, *d));
      d->memory().watch(memories_.back().get());
      if (auto* const programs = program_memory(*d)) programs->watch(memories_.back().get());
    }
    if (scenario == Scenario::linked) {
      const auto settings = traffic::settings_of(traffic::plan_links(machine_));
      rig_.settle(settings);
      configured_.add(settings);
    }
    rig_.put_between([this](can::Port& port, const std::string& bus) {
      mortal_ = std::make_unique<MortalPort>(axe_, port);
      port_ = std::make_unique<HeardPort>(watch_, bus, *mortal_);
      return port_.get();
    });
    if (scenario != Scenario::first) {
      disk_.put_back(disk_with_store());
      disk_.after_crash(store::Loss::all, random_);
    }
    if (scenario == Scenario::replaced) replace();
  }
  ~KillWorld() { rig_.kill(); }

  // One run of Berth: from a new process to its death, or to the end of the job.
  Life live(const Death& death) {
    Life life;
    begin(death);
    const std::string refused = store_.open();
    if (!refused.empty() && !axe_.fallen()) life.failure = "the store does not open: " + refused;
    if (refused.empty()) run(life);
    life.died = axe_.fallen();
    life.struck = life.died || struck_;
    life.trace = axe_.trace();
    life.disk_steps = disk_.steps();
    if (life.died) end(death);
    if (!watch_.failure().empty()) life.failure = watch_.failure();
    if (!configured_.failure().empty()) life.failure = configured_.failure();
    if (!programs_.failure().empty()) life.failure = programs_.failure();
    return life;
  }

  // Devices stay away in these scenarios: the seats depend on when they left.
  [[nodiscard]] static bool departs(Scenario s) { return s == Scenario::away || s == Scenario::gone; }

  // Checks the requirements after a run that finished. Empty: they hold.
  std::string check() {
    std::string wrong = judge_.wrong();
    if (wrong.empty() && departs(scenario_)) return check_rows();
    if (wrong.empty()) wrong = check_devices();
    if (wrong.empty()) wrong = check_store();
    return wrong;
  }
  [[nodiscard]] std::string log() const { return rig_.log(); }
  [[nodiscard]] static bool has(Scenario scenario, const std::string& device) {
    return plant(scenario).device(device) != nullptr;
  }

 private:
  class Memory final : public device::SimFlash::Watcher {
   public:
    Memory(KillWorld& world, plant::SimDevice& device) : world_(&world), device_(&device) {}
    void write_began() noexcept override { world_->memory_point(PointKind::memory_begin, *device_); }
    void write_ended() noexcept override { world_->memory_point(PointKind::memory_end, *device_); }
    void cut() noexcept override { world_->power_lost(*device_); }

   private:
    KillWorld* world_;
    plant::SimDevice* device_;
  };

  static TypeCode first_type(Scenario scenario) {
    if (scenario == Scenario::configured) return type_pump;
    if (scenario == Scenario::programmed) return type_controller;
    if (scenario == Scenario::linked) return type_io;
    const bool same = scenario == Scenario::blank || scenario == Scenario::first || departs(scenario);
    return same ? type_b : type_a;
  }

  static design::Machine machine(Scenario scenario) {
    design::Machine m = one_bus(250'000);
    add_slot(m, 1, first_type(scenario));
    if (scenario == Scenario::configured) m.slots.back().spec.config = example_eds("pump.dcf");
    if (scenario == Scenario::programmed) {
      m.slots.back().spec.software.programs = {
          {.number = 1, .file = small_image(wanted_program), .identification = {}}};
    }
    add_slot(m, 2, scenario == Scenario::linked ? type_io : type_b);
    if (scenario == Scenario::linked) {
      for (auto& slot : m.slots) slot.eds = slot.eds_path = example_eds("io.eds");
      design::Link link;
      link.from = {"s1", "6000h:01"};
      link.to = {{"s2", "6200h:01"}};
      link.deadline = 20ms;
      m.links.push_back(link);
    }
    auto& t = m.buses.front().timing;
    t.lss_timeout = 20ms;
    t.store_timeout = 100ms;
    t.save_timeout = 100ms;
    t.sdo_timeout = 40ms;
    t.guard_timeout = 20ms;
    t.rand_response = 4ms;
    t.boot_timeout = 500ms;
    t.heartbeat_period = 200ms;
    t.heartbeat_timeout = 500ms;
    t.probe_period = 400ms;
    return m;
  }

  static plant::PlantFile plant(Scenario scenario) {
    plant::PlantFile p = one_bus_plant(7);
    const auto stored = [](plant::PlantDevice& d, std::uint8_t id) {
      d.source = plant::NodeIdSource::nonvolatile;
      d.node_id = NodeId(id);
    };
    auto& d1 = add_device(p, "d1", first_type(scenario), 0x11);
    if (scenario == Scenario::crossed) stored(d1, 2);
    if (scenario == Scenario::programmed) add_programs(d1);
    auto& d2 = add_device(p, "d2", scenario == Scenario::linked ? type_io : type_b, 0x22);
    if (scenario == Scenario::taken || scenario == Scenario::crossed) stored(d2, 1);
    if (scenario == Scenario::replaced) {
      auto& d3 = add_device(p, "d3", type_b, 0x21);
      stored(d3, 5);
      d3.plugged = false;
    }
    if (departs(scenario)) {
      add_device(p, "d3", type_b, 0x33).plugged = false;
      add_device(p, "d4", type_b, 0x44).plugged = false;
    }
    if (scenario == Scenario::stranger) stored(add_device(p, "x", type_c, 0x33), 2);
    for (auto& d : p.devices) {
      if (d.address.type() == type_io) d.eds = d.eds_path = example_eds("io.eds");
      d.response = {300us, 900us, 0, 0ms};
      d.boot = 20ms;
      d.reset = 8ms;
      d.storing.time = 6ms;
    }
    return p;
  }

  static void add_programs(plant::PlantDevice& d) {
    auto& programs = d.storing.programs;
    programs.count = 1;
    programs.size = programs.sector = 256;
    programs.erase = 4ms;
    programs.write = 20us;
    programs.loaded = programs.loaded_path = small_image(older_program);
  }

  // Before the test: the machine ran, then d2 left it and d3 came while no Berth ran.
  void replace() {
    const Life before = live({});
    if (!before.failure.empty()) setup_failure_ = "setup: " + before.failure;
    rig_.kill();
    store_.close();
    rig_.device("d2").unplug();
    rig_.device("d3").plug();
    rig_.run_for(100ms);
  }

  void begin(const Death& death) {
    std::function<Axe::Instead()> instead;
    if (!death.off.empty()) instead = [this] { return switched_off(); };
    if (!death.loses.empty()) instead = [this] { return frame_lost(); };
    axe_.life(death.at, std::move(instead));
    disk_.crash_at(death.disk);
    death_ = death;
    struck_ = false;
    for (const auto& d : rig_.world().devices()) {
      d->memory().never_cut();
      if (auto* const programs = program_memory(*d)) programs->never_cut();
    }
    if (death.torn) {
      auto& device = rig_.device(death.torn_device);
      auto& memory = death.torn_program ? *program_memory(device) : device.memory();
      memory.cut_after(*death.torn, static_cast<int>(*death.torn * 37 % 256));
    }
  }

  void run(Life& life) {
    watch_.berth_began();
    if (!rig_.try_begin()) {
      if (!axe_.fallen()) life.failure = "the slot table cannot be read";
      return;
    }
    const auto settled = [this] {
      if (axe_.fallen() || !watch_.failure().empty()) return true;
      if (scenario_ == Scenario::replaced) say_replaced();
      return ended();
    };
    if (departs(scenario_)) {
      if (!comes_to_rest()) life.failure = "no rest after 120 s: " + judge_.wrong() + "; " + states();
    } else if (!rig_.run_until(settled, 40s)) {
      life.failure = "not operational after 40 s: " + states();
    }
    if (!setup_failure_.empty()) life.failure = setup_failure_;
  }

  // All devices that come back are back, everything is as it must be, and stays so.
  [[nodiscard]] bool comes_to_rest() {
    const auto over = [this] { return axe_.fallen() || !watch_.failure().empty(); };
    for (const rt::Time limit = rig_.now() + 120s; rig_.now() < limit && !over();) {
      if (rig_.run_until(over, 100ms) || returning_ > 0 || !rig_.idle() || !judge_.wrong().empty()) continue;
      if (rig_.run_until(over, 3s) || !rig_.run_until([&] { return over() || rig_.idle(); }, 20s)) continue;
      if (over() || judge_.wrong().empty()) return true;
    }
    return over();
  }

  // Gives `berth replace s2` while the table shows that the old device sits there and is silent.
  void say_replaced() {
    if (!rig_.network().idle() || rig_.device("d2").powered()) return;
    for (const auto& s : rig_.network().report()) {
      const bool silent =
          s.name == "s2" && s.state == places::SlotState::absent && s.device && s.device->address.serial == 0x22;
      if (silent) watch_.replaced_by_a_person("d2");
      if (silent && !rig_.network().replace("s2", std::nullopt)) axe_.fall();  // its store has just failed
    }
  }

  [[nodiscard]] bool ended() {
    if (!rig_.network().operational() || !rig_.network().idle()) return false;
    if (scenario_ == Scenario::stranger) {
      const auto x = rig_.device("x").truth();
      const auto blanks = store_.unfinished_blanks();
      return x.powered && !x.booting && x.persistent == NodeId() && blanks && blanks->empty();
    }
    return std::ranges::all_of(rig_.world().devices(), [](const auto& d) { return d->powered() || !d->plugged(); });
  }

  // The process ends at once, without cleanup. Then time passes, and the disk has only what it kept.
  void end(const Death& death) {
    rig_.kill();
    store_.die();
    disk_.after_crash(death.loss, random_);
    rig_.run_for(death.restart_late ? 900ms : 2ms);
  }

  void memory_point(PointKind kind, plant::SimDevice& device) noexcept {
    if (axe_.fallen() || !axe_.hit(kind)) return;
    struck_ = true;
    if (death_.victim != Victim::berth) power_lost(device);
    if (death_.victim != Victim::device) axe_.fall();
  }

  // At a point of Berth's: after the instant, so that what is under way in it still ends.
  Axe::Instead switched_off() {
    struck_ = true;
    rig_.world().sim().after(0ms, [this, device = &rig_.device(death_.off)] { power_lost(*device); });
    return death_.victim == Victim::both ? Axe::Instead::nothing : Axe::Instead::lives;
  }
  Axe::Instead frame_lost() {
    struck_ = true;
    if (death_.loses == plant::master_name) return Axe::Instead::loses_frame;
    plant::SimDevice& device = rig_.device(death_.loses);
    sim::Fault fault;
    fault.kind = sim::Fault::Kind::overrun;
    fault.trigger.when = [master = rig_.port().number()](const sim::FrameStart& start) {
      return start.sender == master;
    };
    fault.victims = {&device.controller()};
    device.bus().inject(std::move(fault));
    return Axe::Instead::lives;
  }

  void power_lost(plant::SimDevice& device) noexcept {
    struck_ = true;
    device.power(false);
    if (death_.torn && death_.victim == Victim::both) axe_.fall();
    plant::SimDevice* const back = &device;
    if (departs(scenario_)) {
      // A device that is present stays: each strike brings one spare at most.
      plant::SimDevice& spare = rig_.device(rig_.device("d3").plugged() ? "d4" : "d3");
      rig_.world().sim().after(500ms, [spare = &spare] { spare->plug(); });
    }
    if (scenario_ == Scenario::gone) return;
    ++returning_;
    rig_.world().sim().after(scenario_ == Scenario::away ? rt::Duration(60s) : rt::Duration(300ms), [this, back] {
      --returning_;
      back->power(true);
    });
  }

  [[nodiscard]] std::string states() {
    std::string text;
    for (const auto& s : rig_.network().report()) {
      text += (text.empty() ? "" : ", ") + s.name + " " + places::name(s.state) +
              (s.reason.empty() ? "" : " (" + s.reason + ")");
    }
    return text;
  }

  // Slot -> serial number of the device that must sit there in any case.
  [[nodiscard]] std::map<unsigned, std::uint32_t> expected() const {
    return {{1U, 0x11U}, {2U, scenario_ == Scenario::replaced ? 0x21U : 0x22U}};
  }

  [[nodiscard]] std::string check_devices() {
    std::map<unsigned, std::string> holders;
    const auto seats = expected();
    for (const auto& t : rig_.world().truth()) {
      if (!t.powered) continue;
      if (t.active != t.persistent) {
        return t.name + " uses node-ID " + std::to_string(t.active.value()) + " and has stored " +
               std::to_string(t.persistent.value());
      }
      if (t.active.configured() && !holders.emplace(t.active.value(), t.name).second) {
        return "two devices hold node-ID " + std::to_string(t.active.value());
      }
      const auto seat = std::ranges::find(seats, t.address.serial, [](const auto& s) { return s.second; });
      const unsigned wanted = seat == seats.end() ? 255U : seat->first;
      if (t.active.value() != wanted) return t.name + " has node-ID " + std::to_string(t.active.value());
      if (seat != seats.end() && t.state != NmtState::operational) return t.name + " is not operational";
    }
    return check_configuration();
  }

  // The configuration is in use, also after the next power-on.
  [[nodiscard]] std::string check_configuration() {
    auto& d1 = rig_.device("d1");
    if (scenario_ == Scenario::programmed) return programs_.check(d1);
    if (scenario_ == Scenario::linked) {
      const std::string first = configured_.check(d1, machine_.slots.front());
      return first.empty() ? configured_.check(rig_.device("d2"), machine_.slots.back()) : first;
    }
    if (scenario_ != Scenario::configured) return {};
    std::string wrong = configured_.check(d1, machine_.slots.front());
    if (!wrong.empty()) return "d1: " + wrong;
    const auto records = store_.load("rig");
    const bool done =
        records && records->front().configured && records->front().configured->stage == places::Configured::Stage::done;
    if (!done) return "the store does not say that d1 is configured";
    rig_.kill();
    d1.power(false);
    rig_.run_for(50ms);
    d1.power(true);
    rig_.run_for(100ms);
    wrong = configured_.check(d1, machine_.slots.front());
    return wrong.empty() ? std::string() : "d1 has not saved it: " + wrong;
  }

  // For devices that stay away: what the store holds is on the disk.
  [[nodiscard]] std::string check_rows() {
    const auto before = store_.load("rig");
    rig_.kill();
    store_.die();
    disk_.after_crash(store::Loss::all, random_);
    axe_.life({});
    const std::string refused = store_.open();
    if (!refused.empty()) return "the store does not open at the end: " + refused;
    const auto after = store_.load("rig");
    store_.close();
    if (!before || !after || before->size() != after->size()) return "the store cannot be read at the end";
    for (std::size_t i = 0; i < after->size(); ++i) {
      const auto& was = (*before)[i];
      const auto& is = (*after)[i];
      if (is.intended != was.intended || is.confirmed != was.confirmed)
        return "slot " + is.name.name + " was not safely on the disk";
    }
    return {};
  }

  // Berth's state equals what the next process would read, and is true.
  [[nodiscard]] std::string check_store() {
    const auto seats = expected();
    const auto before = store_.load("rig");
    rig_.kill();
    store_.die();
    disk_.after_crash(store::Loss::all, random_);
    axe_.life({});
    const std::string refused = store_.open();
    if (!refused.empty()) return "the store does not open at the end: " + refused;
    const auto after = store_.load("rig");
    const auto blanks = store_.unfinished_blanks();
    const auto history = store_.history(std::nullopt);
    store_.close();
    if (!before || !after || !blanks || !history) return "the store cannot be read at the end";
    if (after->size() != 2 || before->size() != 2) return "the store has not two slots";
    for (std::size_t i = 0; i < 2; ++i) {
      const auto& r = (*after)[i];
      if (r.intended) return "slot " + r.name.name + " has an intention left in the store";
      const auto seat = seats.find(static_cast<unsigned>(i) + 1);
      if (!r.confirmed || r.confirmed->device.address.serial != seat->second ||
          r.confirmed->id.value() != seat->first) {
        return "slot " + r.name.name + " is not confirmed for its device in the store";
      }
      if (r.confirmed != (*before)[i].confirmed) return "slot " + r.name.name + " was not safely on the disk";
    }
    if (!blanks->empty()) return "an intention to blank is left in the store";
    std::int64_t last = 0;
    for (const auto& h : *history) {
      if (h.sequence <= last) return "the history is not in order";
      last = h.sequence;
    }
    return {};
  }

  static constexpr TypeCode type_controller{0x0000'0001, 0x0000'0060};
  static constexpr TypeCode type_io{0x0000'0001, 0x0000'0003};

  Scenario scenario_;
  store::CrashVfs disk_{"kill"};
  Random random_{11};
  Axe axe_;
  MortalStore store_;
  std::unique_ptr<MortalPort> mortal_;
  std::unique_ptr<HeardPort> port_;
  Rig rig_;
  design::Machine machine_;
  DuplicateWatch watch_;
  ConfigWatch configured_;
  EndJudge judge_;
  ProgramWatch programs_;
  int returning_ = 0;  // devices without power that will come back
  std::vector<std::unique_ptr<Memory>> memories_;
  Death death_;
  std::string setup_failure_;
  bool struck_ = false;
};

}  // namespace berth::harness

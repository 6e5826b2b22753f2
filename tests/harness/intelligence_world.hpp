// One world of intelligence_plan.hpp from beginning to end. Requirements (docs/faults.md): no device is operational
// with anything but its slot's program and configuration, no running device is started again, and at the end all run,
// and the links transfer their values.
#pragma once

#include <array>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "berth/harness/config_watch.hpp"
#include "berth/operate/programming.hpp"
#include "berth/traffic/link_network.hpp"
#include "tests/harness/berths.hpp"
#include "tests/harness/intelligence_plan.hpp"
#include "tests/harness/program_watch.hpp"

namespace berth::harness {

// Checks that a device running alone under a slot's node-ID is as the slot wants it, whenever a device changes.
class SlotWatch final : private plant::World::Observer {
 public:
  SlotWatch(plant::World& world, const design::Machine& machine, const manager::SlotSettings& linked)
      : world_(&world), machine_(&machine), wanted_(machine, linked) {
    program_ = operate::load_program(controller_image(wanted_version))->identification;
    world.add_observer(*this);
  }
  ~SlotWatch() { world_->remove_observer(*this); }
  SlotWatch(const SlotWatch&) = delete;
  SlotWatch& operator=(const SlotWatch&) = delete;

  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }
  // Empty: its program and its configuration are the slot's.
  [[nodiscard]] std::string check(plant::SimDevice& device, const design::Slot& slot) const {
    if (slot.spec.type == type_controller) {
      const auto has = program_of(device);
      if (has != program_) return fmt::format("it has program {:08X}h instead of {:08X}h", has, program_);
      if (!device.device().programs()->runs()) return "it does not run its program";
    }
    return wanted_.check(device, slot);
  }

 private:
  void plant_changed(const plant::SimDevice& changed) noexcept override {
    const auto t = changed.truth();
    const bool runs = t.powered && t.state == NmtState::operational;
    const design::Slot* const slot = machine_->slot(t.bus, t.active);
    if (!runs || !failure_.empty() || slot == nullptr || slot->spec.type != t.address.type()) return;
    // Does not judge another device under the slot's node-ID.
    const auto alone = std::ranges::count_if(
        world_->devices(), [&](const auto& d) { return d->powered() && d->device().node_id() == t.active; });
    if (alone != 1) return;
    const auto wrong = check(*world_->find(t.name), *slot);
    if (!wrong.empty())
      failure_ = fmt::format("{} is operational in slot {}, and {}", t.name, slot->spec.name.name, wrong);
  }

  plant::World* world_;
  const design::Machine* machine_;
  SlotConfigurations wanted_;
  std::uint32_t program_ = 0;
  std::string failure_;
};

struct IntelligenceOutcome {
  std::string failure;  // empty: good
  std::uint64_t hash = 0;
  std::array<std::array<unsigned, stages>, stage_kinds> hits{};
  std::string log;
};

class IntelligenceWorld final : private can::Tap {
 public:
  // `frames`: the log also has every frame.
  explicit IntelligenceWorld(const IntelligencePlan& plan, bool frames = false)
      : plan_(plan),
        frames_(frames),
        berths_(plan.machine, plan.plant, plan.priorities, plan.priorities.size() > 1),
        settings_(links_of(plan.machine)),
        watch_(berths_.world(), plan_.machine, settings_),
        random_(plan.seed ^ 0xFA17),
        waiting_(plan.faults) {
    berths_.settle(settings_);
    if (plan.perturbed) berths_.world().executor().perturb(plan.seed);
    berths_.world().bus("backbone")->add_tap(*this);
  }
  ~IntelligenceWorld() {
    for (std::size_t i = 0; i < berths_.count(); ++i) {
      if (berths_.runs(i)) berths_.kill(i);
    }
    berths_.world().bus("backbone")->remove_tap(*this);
  }

  IntelligenceOutcome go() {
    for (std::size_t i = 0; i < berths_.count(); ++i) berths_.begin(i);
    // Until each fault could strike, and the devices that come back are back.
    const auto over = [this] { return !sound() || (waiting_.empty() && returning_ == 0); };
    berths_.run_until(over, 25s);
    waiting_.clear();
    berths_.run_until(over, 20s);
    if (sound()) ending();
    if (!watch_.failure().empty()) outcome_.failure = watch_.failure();
    if (outcome_.failure.empty() && berths_.second_starts != 0)
      outcome_.failure = "a device that ran was started again";
    outcome_.hash = berths_.world().sim().trace_hash();
    outcome_.log = told_ + berths_.log();
    return std::move(outcome_);
  }

 private:
  static manager::SlotSettings links_of(const design::Machine& machine) {
    if (machine.links.empty()) return {};
    const auto links = traffic::plan_links(machine);
    for (const auto& finding : links.findings) {
      if (finding.severity == Finding::Severity::error) std::fprintf(stderr, "%s\n", to_string(finding).c_str());
    }
    if (has_errors(links.findings)) std::abort();
    return traffic::settings_of(links);
  }
  [[nodiscard]] bool sound() const noexcept { return watch_.failure().empty() && berths_.second_starts == 0; }

  // ---- when faults strike ----

  void frame(const can::Frame& frame, rt::Time at, int sender) noexcept override {
    if (frames_) {
      told_ += fmt::format("{:12.6f} s  {:2}  {}\n", std::chrono::duration<double>(at - rt::Time{}).count(), sender,
                           can::to_string(frame));
    }
    if (frame.extended || frame.size < 1) return;
    const NodeId node(static_cast<std::uint8_t>(frame.id & 0x7FU));
    const std::uint32_t kind = frame.id & 0x780U;
    if (kind == 0x700 && frame.data[0] == 0x05) return meets(Stage::running, node);
    if (kind != 0x600 || frame.size != 8) return;
    const auto command = static_cast<unsigned>(frame.data[0] >> 5U);
    const bool names_object = command == 1 || command == 2 || (command >= 5 && (frame.data[0] & 3U) == 0);
    const auto named = stage_of(static_cast<std::uint16_t>(frame.data[1] | frame.data[2] << 8U));
    if (names_object && named) stage_[node.value()] = *named;
    const auto stage = stage_.find(node.value());
    if (stage != stage_.end()) meets(stage->second, node);
  }

  void meets(Stage stage, NodeId node) {
    const auto& devices = berths_.world().devices();
    const auto device =
        std::ranges::find_if(devices, [&](const auto& d) { return d->powered() && d->device().node_id() == node; });
    if (device == devices.end()) return;
    const auto fault = std::ranges::find(waiting_, stage, &StageFault::stage);
    if (fault == waiting_.end()) return;
    if (fault->skip > 0) {
      --fault->skip;
      return;
    }
    const StageFault f = *fault;
    waiting_.erase(fault);
    later(f.delay, [this, f, device = device->get()] { strike(f, *device); });
  }

  // Done later, but before the end.
  void later(rt::Duration delay, std::function<void()> deed) {
    ++returning_;
    berths_.world().sim().after(delay, [this, deed = std::move(deed)] {
      --returning_;
      deed();
    });
  }

  // ---- the faults ----

  void strike(const StageFault& f, plant::SimDevice& device) {
    ++outcome_.hits[static_cast<std::size_t>(f.kind)][static_cast<std::size_t>(f.stage)];
    if (frames_) told_ += fmt::format("--- {} at {}, in {}\n", name(f.kind), device.name(), name(f.stage));
    switch (f.kind) {
      case StageKind::overrun: return by_plant(FaultKind::overrun, device);
      case StageKind::overrun_master: return by_plant(FaultKind::overrun_master, device);
      case StageKind::disturb: return by_plant(FaultKind::disturb, device);
      case StageKind::twice: return by_plant(FaultKind::twice, device);
      case StageKind::slow: return by_plant(FaultKind::slow, device);
      case StageKind::deaf: return by_plant(FaultKind::deaf, device);
      case StageKind::reset: return device.reset();
      case StageKind::power: device.power(false); return later(f.back, [&device] { device.power(true); });
      case StageKind::cut: berths_.cut_off(device); return later(f.back, [this] { berths_.join(); });
      case StageKind::away:
        if (!device.plugged()) return;
        device.unplug();
        // Unless its partner was plugged in meanwhile.
        return later(f.back, [this, &device] {
          if (!partner(device).plugged()) device.plug();
        });
      case StageKind::exchanged: {
        auto& other = partner(device);
        device.unplug();
        return other.plug();
      }
      case StageKind::berth: return end_berth(f.back);
      case StageKind::count: return;
    }
  }

  void by_plant(FaultKind kind, const plant::SimDevice& device) {
    auto& world = berths_.world();
    const auto now = world.executor().now().time_since_epoch();
    for (const auto& e : events_of(kind, device.name(), "backbone", now, random_)) world.perform(e);
  }

  // The spare of the device's slot; for a spare, the slot's device.
  [[nodiscard]] plant::SimDevice& partner(const plant::SimDevice& device) {
    const auto& devices = berths_.world().devices();
    const auto place = std::ranges::find(devices, &device, [](const auto& d) { return d.get(); }) - devices.begin();
    const auto slots = static_cast<std::ptrdiff_t>(plan_.slots());
    return *devices[static_cast<std::size_t>(place < slots ? place + slots : place - slots)];
  }

  void end_berth(rt::Duration back) {
    for (std::size_t i = 0; i < berths_.count(); ++i) {
      if (!berths_.runs(i) || !berths_.leads(i)) continue;
      berths_.kill(i);
      return later(back, [this, i] {
        if (!berths_.runs(i)) berths_.begin(i);
      });
    }
  }

  // ---- the end ----

  // The Berth that leads alone; none: there is none, or there are several.
  [[nodiscard]] operate::Network* leader() {
    operate::Network* found = nullptr;
    for (std::size_t i = 0; i < berths_.count(); ++i) {
      if (!berths_.runs(i) || !berths_.leads(i)) continue;
      if (found != nullptr) return nullptr;
      found = &berths_.network(i);
    }
    return found;
  }
  [[nodiscard]] bool good() {
    auto* const network = leader();
    return network != nullptr && network->operational() && network->idle();
  }

  // Without further faults everything becomes operational in bounded bus time, and stays so.
  void ending() {
    berths_.join();
    for (std::size_t i = 0; i < plan_.slots(); ++i) {
      auto& device = *berths_.world().devices()[i];
      auto& other = partner(device);
      if (!device.plugged() && !other.plugged()) device.plug();
      for (auto* const each : {&device, &other}) {
        if (each->plugged()) each->power(true);
      }
    }
    for (std::size_t i = 0; i < berths_.count(); ++i) {
      if (!berths_.runs(i)) berths_.begin(i);
    }
    berths_.run_for(10s);  // Berth misses by then what was exchanged last
    const auto done = [this] { return good() || !sound(); };
    if (!berths_.run_until(done, 60s)) answer();
    if (!berths_.run_until(done, 120s)) {
      outcome_.failure = "not operational 190 s after the last fault: " + states();
      return;
    }
    berths_.run_for(10s);
    if (!sound()) return;
    // Berth may be searching just now.
    if (leader() == nullptr || !leader()->operational() || !berths_.run_until(done, 10s))
      outcome_.failure = "did not stay operational: " + states();
    if (outcome_.failure.empty()) outcome_.failure = devices_at_the_end();
    if (outcome_.failure.empty()) outcome_.failure = links_at_the_end();
  }

  // Two new devices fit the same slots: the user says which sits where.
  void answer() {
    auto* const network = leader();
    if (network == nullptr) return;
    std::set<const plant::SimDevice*> said;
    for (const auto& slot : network->report()) {
      if (slot.state == places::SlotState::operational) continue;
      for (const auto& device : berths_.world().devices()) {
        const bool waits = device->plugged() && device->device().state() != NmtState::operational;
        const auto address = device->truth().address;
        if (!waits || said.contains(device.get()) || address.type() != slot.type) continue;
        said.insert(device.get());
        static_cast<void>(network->replace(slot.name, address, true));
        break;
      }
    }
  }

  [[nodiscard]] std::string states() {
    auto* const network = leader();
    if (network == nullptr) return "no master is active, or several are";
    std::string text;
    for (const auto& s : network->report()) {
      if (s.state == places::SlotState::operational) continue;
      text += fmt::format("{}{} is {}: {}", text.empty() ? "" : "; ", s.name, places::name(s.state), s.reason);
    }
    return text.empty() ? "it does not come to rest" : text;
  }

  [[nodiscard]] std::string devices_at_the_end() {
    if (!berths_.world().duplicates().empty()) return "two devices use one node-ID";
    for (const auto& device : berths_.world().devices()) {
      if (!device->plugged()) continue;
      const auto t = device->truth();
      const design::Slot* const slot = plan_.machine.slot(t.bus, t.active);
      if (slot == nullptr || t.state != NmtState::operational) return t.name + " is not operational in a slot";
      const auto wrong = watch_.check(*device, *slot);
      if (!wrong.empty()) return t.name + ": " + wrong;
    }
    return {};
  }

  [[nodiscard]] plant::SimDevice& at(const std::string& slot) {
    const auto id = plan_.machine.slot(slot)->spec.id;
    for (const auto& device : berths_.world().devices()) {
      if (device->plugged() && device->device().node_id() == id) return *device;
    }
    std::abort();  // `devices_at_the_end` was asked before
  }
  // Twice: each input gets another value, and each output must get it.
  [[nodiscard]] std::string links_at_the_end() {
    for (std::uint8_t round = 1; round <= 2; ++round) {
      std::uint8_t value = static_cast<std::uint8_t>(16 * round);
      for (const auto& link : plan_.machine.links) {
        auto& from = at(link.from.slot).device();
        from.values().set(ObjectRef{0x6000, 1}, ++value);
        from.services().changed({0x6000, 1});
      }
      berths_.run_for(1s);
      for (const auto& link : plan_.machine.links) {
        const auto sent = at(link.from.slot).device().values().bytes({0x6000, 1});
        const auto has = at(link.to.front().slot).device().values().bytes({0x6200, 1});
        if (!std::ranges::equal(sent, has)) {
          return fmt::format("the link from {} to {} carries {:02X}h instead of {:02X}h", link.from.slot,
                             link.to.front().slot, has.front(), sent.front());
        }
      }
    }
    return {};
  }

  const IntelligencePlan plan_;
  bool frames_;
  std::string told_;
  Berths berths_;
  manager::SlotSettings settings_;
  SlotWatch watch_;
  Random random_;
  std::vector<StageFault> waiting_;
  std::map<unsigned, Stage> stage_;  // by node-ID
  unsigned returning_ = 0;
  IntelligenceOutcome outcome_;
};

inline IntelligenceOutcome run_intelligence_world(const IntelligencePlan& plan, bool frames = false) {
  return IntelligenceWorld(plan, frames).go();
}

}  // namespace berth::harness

// A machine, a plant, and Berth between them, for tests and for the programs that try many worlds. One bus, unless the
// machine has more: then `begin` makes one network for each, and calls that name no bus mean the first.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/harness/milestone.hpp"
#include "berth/operate/network.hpp"
#include "berth/operate/slot_rows.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"

namespace berth::harness {

using namespace std::chrono_literals;

inline constexpr TypeCode type_a{0x01000001, 0x00000001};
inline constexpr TypeCode type_b{0x00000001, 0x00000001};
inline constexpr TypeCode type_c{0x00000001, 0x00000005};

// The pump of examples/: a type whose devices have a configuration.
inline constexpr TypeCode type_pump{0x00000001, 0x00000030};

inline design::Machine one_bus(std::uint32_t bit_rate) {
  design::Machine m;
  m.name = "rig";
  design::Bus bus;
  bus.name = "backbone";
  bus.bitrate = bit_rate;
  m.buses.push_back(bus);
  return m;
}

inline void add_slot(design::Machine& m, unsigned id, TypeCode type, const std::string& bus = "backbone") {
  design::Slot slot;
  slot.spec.name = {m.name, bus, (bus == "backbone" ? "s" : bus + " s") + std::to_string(id)};
  slot.spec.id = NodeId(static_cast<std::uint8_t>(id));
  slot.spec.type = type;
  m.slots.push_back(slot);
}

inline plant::PlantFile one_bus_plant(std::uint64_t seed) {
  plant::PlantFile p;
  p.seed = seed;
  p.buses.push_back({"backbone", 0});
  return p;
}

// Without a description file.
inline plant::PlantDevice& add_plain_device(plant::PlantFile& p, const std::string& name, TypeCode type,
                                            std::uint32_t serial, const std::string& bus = "backbone") {
  plant::PlantDevice d;
  d.name = name;
  d.bus = bus;
  d.address = {type.vendor, type.product, 0, serial};
  d.response = {500us, 2ms, 0, 0ms};
  p.devices.push_back(d);
  return p.devices.back();
}

class Rig {
 public:
  Rig(design::Machine machine, plant::PlantFile file, places::SlotStore* store = nullptr)
      : machine_(std::move(machine)), file_(std::move(file)), store_(store != nullptr ? store : &memory_) {
    Findings findings;
    std::vector<plant::BusRate> rates;
    for (const auto& bus : machine_.buses) rates.push_back({bus.name, bus.bitrate});
    world_ = plant::World::make(file_, rates, findings);
    for (const auto& f : findings) std::fprintf(stderr, "%s\n", to_string(f).c_str());
    if (!world_) std::abort();
    world_->start();
  }
  ~Rig() { kill(); }

  // Bus time at which every bus was operational for the first time.
  std::optional<rt::Duration> first_operational;

  // A layer between Berth and its controller of this bus, from the next `begin` on; it must exist until `kill`.
  using Between = std::function<can::Port*(can::Port&, const std::string& bus)>;
  void put_between(Between between) { between_ = std::move(between); }
  // Before each step of a binding, from the next `begin` on. Must not end Berth.
  using OnStep = std::function<void(const std::string& bus, const places::Binding&)>;
  void on_step(OnStep on_step) { on_step_ = std::move(on_step); }

  // Called with every event.
  void on_event(std::function<void(const operate::Event&)> on_event) { on_event_ = std::move(on_event); }

  // The settings that the machine's links need in the slots' devices, from the next `begin` on.
  void settle(manager::SlotSettings settings) { settings_ = std::move(settings); }

  // The place for what SDO clients write to 1F20h and 1F22h, from the next `begin` on.
  void keep_written(operate::WrittenFiles::Place place) { written_ = std::move(place); }

  // Begins a Berth that knows only the store and the bus, as a new process would.
  void begin() {
    if (!try_begin()) std::abort();
  }
  // False: the store cannot be read or written.
  bool try_begin() {
    for (const auto& bus : machine_.buses) {
      masters_.push_back(std::make_unique<Master>());
      Master& master = *masters_.back();
      master.port = world_->attach_master(bus.name);
      can::Port& port = between_ ? *between_(*master.port, bus.name) : *master.port;
      operate::NetworkObserver observer{[this](const operate::Event& e) {
                                          events_.push_back(e);
                                          if (on_event_) on_event_(e);
                                        },
                                        [this](operate::Milestone m) {
                                          const bool all = m == operate::Milestone::operational && operational();
                                          if (all && !first_operational) first_operational = now().time_since_epoch();
                                          world_->milestone(after(m));
                                        }};
      if (on_step_) observer.before_step = [this, name = bus.name](const auto& binding) { on_step_(name, binding); };
      master.network = std::make_unique<operate::Network>(world_->executor(), port, machine_.name, bus,
                                                          machine_.specs(bus.name), *store_, std::move(observer));
      operate::SlotDescriptions descriptions;
      for (const auto& slot : machine_.slots) {
        const bool described = slot.spec.name.bus == bus.name && !slot.eds_path.empty();
        if (described) descriptions.emplace(slot.spec.name.name, slot.eds_path);
      }
      if (!master.network->open(settings_, descriptions, operate::WrittenFiles(written_))) return false;
      master.network->start();
    }
    return true;
  }
  // Ends Berth at once, as a crash does.
  void kill() {
    for (auto& master : masters_) master->network.reset();
    masters_.clear();
  }

  bool run_until(const std::function<bool()>& done, rt::Duration limit) { return world_->sim().run_until(done, limit); }
  void run_for(rt::Duration time) { world_->sim().run_for(time); }
  bool until_operational(rt::Duration limit) {
    return run_until([this] { return operational() && idle(); }, limit);
  }
  [[nodiscard]] bool operational() const noexcept {
    return std::ranges::all_of(masters_, [](const auto& m) { return m->network->operational(); });
  }
  [[nodiscard]] bool idle() const noexcept {
    return std::ranges::all_of(masters_, [](const auto& m) { return m->network->idle(); });
  }

  // Slot id -> serial number of the device that the store has confirmed there.
  [[nodiscard]] std::vector<std::pair<unsigned, std::uint32_t>> seats() {
    std::vector<std::pair<unsigned, std::uint32_t>> result;
    const auto records = store_->load(machine_.name);
    for (const auto& r : *records) {
      if (r.confirmed) result.emplace_back(r.confirmed->id.value(), r.confirmed->device.address.serial);
    }
    std::ranges::sort(result);
    return result;
  }
  [[nodiscard]] places::SlotState state(unsigned id) const {
    for (const auto& s : masters_.front()->network->report()) {
      if (s.id.value() == id) return s.state;
    }
    return places::SlotState::unknown;
  }
  [[nodiscard]] std::string log() const {
    std::string text;
    for (const auto& e : events_) text += operate::to_line(e) + "\n";
    for (const auto& master : masters_) {
      if (!master->network) continue;
      for (const auto& line : operate::to_table(master->network->report())) text += line + "\n";
    }
    return text;
  }

  [[nodiscard]] plant::World& world() noexcept { return *world_; }
  [[nodiscard]] plant::SimDevice& device(const std::string& name) { return *world_->find(name); }
  [[nodiscard]] operate::Network& network(std::size_t bus = 0) noexcept { return *masters_[bus]->network; }
  [[nodiscard]] std::size_t networks() const noexcept { return masters_.size(); }
  [[nodiscard]] bool runs() const noexcept { return !masters_.empty(); }
  [[nodiscard]] sim::Controller& port() noexcept { return *masters_.front()->port; }
  [[nodiscard]] places::SlotStore& store() noexcept { return *store_; }
  [[nodiscard]] const std::vector<operate::Event>& events() const noexcept { return events_; }
  [[nodiscard]] rt::Time now() const noexcept { return world_->executor().now(); }

 private:
  design::Machine machine_;
  plant::PlantFile file_;
  places::MemoryStore memory_;
  places::SlotStore* store_;
  std::unique_ptr<plant::World> world_;
  struct Master {
    std::unique_ptr<sim::Controller> port;
    std::unique_ptr<operate::Network> network;
  };
  std::vector<std::unique_ptr<Master>> masters_;
  Between between_;
  OnStep on_step_;
  std::function<void(const operate::Event&)> on_event_;
  manager::SlotSettings settings_;
  operate::WrittenFiles::Place written_;
  std::vector<operate::Event> events_;
};

}  // namespace berth::harness

// An example machine of examples/, run by `tree::Session` on its plant.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "../paths.hpp"
#include "berth/design/machine.hpp"
#include "berth/harness/milestone.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"
#include "berth/tree/session.hpp"

namespace berth::golden {

/// The milestones reach the plant as `berth up` has it, so that its events happen.
class Example {
 public:
  explicit Example(const std::string& name, std::uint32_t bit_rate = 0) {
    const std::string path = berth::test::source_dir() + "/examples/" + name;
    auto machine = design::load_machine(path + ".toml");
    auto plant = plant::load_plant(path + ".plant.toml");
    if (!machine.machine || !plant.plant) return;
    machine_ = std::move(*machine.machine);
    auto& bus = machine_.buses.front();
    if (bit_rate != 0) bus.bitrate = bit_rate;
    bus.discovery = "rand";  // as published; the default asks by Berth's planner
    Findings findings;
    const plant::BusRate rate{bus.name, bus.bitrate};
    world_ = plant::World::make(*plant.plant, {&rate, 1}, findings);
    if (!world_) return;
    port_ = world_->attach_master(bus.name);
    session_ = std::make_unique<tree::Session>(world_->executor(), machine_, store_);
    session_->on_milestone([this](operate::Milestone m) { world_->milestone(harness::after(m)); });
    ready_ = session_->connect(bus.name, *port_).has_value() && session_->open().has_value();
  }
  ~Example() {
    session_.reset();
    port_.reset();
  }
  Example(const Example&) = delete;
  Example& operator=(const Example&) = delete;

  [[nodiscard]] bool ready() const noexcept { return ready_; }
  void start() {
    world_->start();
    session_->start();
  }
  template <class Done>
  bool run_until(Done done, rt::Duration limit) {
    return world_->sim().run_until(done, limit);
  }
  [[nodiscard]] sim::Bus& bus() { return *world_->bus(machine_.buses.front().name); }
  [[nodiscard]] tree::Session& session() { return *session_; }
  [[nodiscard]] plant::World& world() { return *world_; }

 private:
  design::Machine machine_;
  places::MemoryStore store_;
  std::unique_ptr<plant::World> world_;
  std::unique_ptr<sim::Controller> port_;
  std::unique_ptr<tree::Session> session_;
  bool ready_ = false;
};

/// Hears a bus as long as it lives.
template <class Ear>
class Hearing {
 public:
  explicit Hearing(sim::Bus& bus) : bus_(bus) { bus_.add_tap(ear); }
  ~Hearing() { bus_.remove_tap(ear); }
  Hearing(const Hearing&) = delete;
  Hearing& operator=(const Hearing&) = delete;
  Ear ear;

 private:
  sim::Bus& bus_;
};

}  // namespace berth::golden

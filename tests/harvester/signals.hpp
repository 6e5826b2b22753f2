/// A machine of links across gateways (examples/signals), in one simulated world, with Berth on each bus that has a
/// port.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "berth/design/machine.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"
#include "berth/text/file.hpp"
#include "berth/traffic/link_network.hpp"
#include "berth/tree/session.hpp"
#include "tests/paths.hpp"

namespace berth::test {

using namespace std::chrono_literals;

inline std::string signals_file(const std::string& name) { return source_dir() + "/examples/signals/" + name; }

inline std::string lines_of(const Findings& findings) {
  std::string text;
  for (const auto& each : findings) text += to_string(each) + "\n";
  return text;
}

class SignalMachine {
 public:
  /// Of the texts of the machine file and of the plant file, before they are read.
  using Change = std::function<void(std::string& machine, std::string& plant)>;
  explicit SignalMachine(const Change& change = {})
      : SignalMachine(signals_file("machine.toml"), signals_file("plant.toml"), change) {}
  SignalMachine(const std::string& machine_file, const std::string& plant_file, const Change& change = {}) {
    Findings findings;
    auto machine_text = text::read_file(machine_file, findings).value_or("");
    auto plant_text = text::read_file(plant_file, findings).value_or("");
    if (change) change(machine_text, plant_text);
    auto read = design::read_machine(machine_text, machine_file, design::eds_loader());
    auto plant = plant::read_plant(plant_text, plant_file);
    EXPECT_TRUE(read.machine && plant.plant) << lines_of(read.findings) << lines_of(plant.findings);
    if (!read.machine || !plant.plant) return;
    machine = std::move(*read.machine);
    links = traffic::plan_links(machine);
    EXPECT_FALSE(has_errors(links.findings)) << lines_of(links.findings);
    std::vector<plant::BusRate> rates;
    for (const auto* const bus : machine.all_buses()) rates.push_back({bus->name, bus->bitrate});
    world = plant::World::make(*plant.plant, rates, findings);
    EXPECT_TRUE(world) << lines_of(findings);
    if (!world) return;
    for (const auto& bus : machine.buses) ports[bus.name] = world->attach_master(bus.name);
    world->start();
    session = std::make_unique<tree::Session>(world->executor(), machine, store);
    for (const auto& [bus, port] : ports) EXPECT_TRUE(session->connect(bus, *port));
    session->configure_with(traffic::settings_of(links));
    EXPECT_TRUE(session->open());
    session->start();
  }
  ~SignalMachine() {
    session.reset();
    ports.clear();
  }
  SignalMachine(const SignalMachine&) = delete;
  SignalMachine& operator=(const SignalMachine&) = delete;

  bool up() {
    if (!session) return false;
    const bool good = run_until([&] { return session->operational(); }, 60s);
    world->sim().run_for(1s);
    return good;
  }
  bool run_until(const std::function<bool()>& over, rt::Duration limit) { return world->sim().run_until(over, limit); }
  device::Device& device(const std::string& name) { return world->find(name)->device(); }
  template <class T>
  T value(const std::string& name, ObjectRef object) {
    return device(name).values().get_or<T>(object, T{});
  }
  /// Its application has another value.
  template <class T>
  void measure(const std::string& name, ObjectRef object, T now) {
    ASSERT_EQ(device(name).values().set<T>(object, now), od::AbortCode::none);
    device(name).services().changed(object);
  }
  std::string log() {
    std::string text;
    for (const auto& each : session->report().events) text += operate::to_line(each) + "\n";
    return text;
  }
  design::Machine machine;
  traffic::LinkPlan links;
  places::MemoryStore store;
  std::unique_ptr<plant::World> world;
  std::map<std::string, std::unique_ptr<can::Port>> ports;
  std::unique_ptr<tree::Session> session;
};

}  // namespace berth::test

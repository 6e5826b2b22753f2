// A machine of many buses and its plant, both as files have them, with Berth on the buses that have a port.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"
#include "berth/tree/session.hpp"

namespace berth::tree_tests {

class Rig {
 public:
  Rig(const std::string& machine_text, const std::string& plant_text) {
    auto machine = design::read_machine(machine_text, "machine.toml", {});
    // Descriptions that tests write stand there.
    const std::vector<std::string> allowed{std::filesystem::temp_directory_path().string()};
    auto plant = plant::read_plant(plant_text, "plant.toml", allowed);
    for (const auto& each : machine.findings) ADD_FAILURE() << to_string(each);
    for (const auto& each : plant.findings) {
      // Equal LSS addresses are a note: devices as shops sell them have these.
      if (each.severity != Finding::Severity::note) ADD_FAILURE() << to_string(each);
    }
    machine_ = std::move(*machine.machine);
    Findings findings;
    std::vector<plant::BusRate> rates;
    for (const auto* const bus : machine_.all_buses()) rates.push_back({bus->name, bus->bitrate});
    world_ = plant::World::make(*plant.plant, rates, findings);
    for (const auto& each : findings) ADD_FAILURE() << to_string(each);
    for (const auto& bus : machine_.buses) ports_.push_back(world_->attach_master(bus.name));
    world_->start();
    begin();
  }
  ~Rig() { session_.reset(); }

  // Berth begins, as a new process would: nothing but the store and the buses.
  void begin() {
    session_.reset();
    session_ = std::make_unique<tree::Session>(world_->executor(), machine_, store_);
    for (std::size_t i = 0; i < ports_.size(); ++i) EXPECT_TRUE(session_->connect(machine_.buses[i].name, *ports_[i]));
    EXPECT_TRUE(session_->open());
    session_->on_event([this](const operate::Event& event) { events_.push_back(event); });
    session_->start();
  }
  void end() { session_.reset(); }

  bool run_until(const std::function<bool()>& done, rt::Duration most) { return world_->sim().run_until(done, most); }
  void run_for(rt::Duration time) { world_->sim().run_for(time); }
  bool up(rt::Duration most = std::chrono::minutes(2)) {
    return run_until([this] { return session_->operational(); }, most);
  }
  plant::SimDevice& device(const std::string& name) { return *world_->find(name); }
  plant::World& world() { return *world_; }
  can::Port& port() { return *ports_.front(); }
  tree::Session& session() { return *session_; }
  const design::Machine& machine() const { return machine_; }
  operate::SlotReport slot(const std::string& name) const {
    const auto slots = session_->slots();
    const auto it = std::ranges::find(slots, name, &operate::SlotReport::name);
    return it == slots.end() ? operate::SlotReport{} : *it;
  }
  places::SlotState state(const std::string& name) const { return slot(name).state; }

  void forget_events() { events_.clear(); }
  const std::vector<operate::Event>& events() const { return events_; }
  // What was told of a slot since then.
  std::vector<std::string> told(const std::string& slot) const {
    std::vector<std::string> lines;
    for (const auto& event : events_) {
      if (event.slot == slot) lines.push_back(event.text);
    }
    return lines;
  }
  std::string log() const {
    std::string text;
    for (const auto& event : events_) text += operate::to_line(event) + "\n";
    return text;
  }

 private:
  design::Machine machine_;
  places::MemoryStore store_;
  std::unique_ptr<plant::World> world_;
  std::vector<std::unique_ptr<sim::Controller>> ports_;
  std::unique_ptr<tree::Session> session_;
  std::vector<operate::Event> events_;
};

// A chain of buses, each beneath a gateway with node-ID 3 on the one above: "top", "bus1", ..., with one valve (node-ID
// 5) on each, or so many with node-IDs from 5 on, each of a type of its own.
struct Chain {
  std::string machine;
  std::string plant;
};
inline Chain chain(int gateways, unsigned bitrate = 250'000, int valves = 1) {
  Chain made;
  const auto rate = "bitrate = " + std::to_string(bitrate) + "\n";
  made.machine = "[machine]\nname = \"chain\"\n[bus.top]\nport = \"sim\"\n" + rate;
  made.plant = "[plant]\n[bus.top]\n";
  const auto add = [&](int level, int product, const std::string& name, int id) {
    const std::string bus = level == 0 ? "top" : "bus" + std::to_string(level);
    const auto type = "type = { vendor = 1, product = " + std::to_string(product) + " }\n";
    made.machine +=
        "[[slot]]\nbus = \"" + bus + "\"\nid = " + std::to_string(id) + "\nname = \"" + name + "\"\n" + type;
    made.plant += "[[device]]\nbus = \"" + bus + "\"\nname = \"" + name + "\"\n" + type +
                  "serial = " + std::to_string(100 * level + id) + "\n";
  };
  std::string gates;
  for (int level = 1; level <= gateways; ++level) {
    const std::string name = "bus" + std::to_string(level);
    const std::string above = level == 1 ? "top" : "bus" + std::to_string(level - 1);
    made.machine += "[bus." + name + "]\nport = \"gateway\"\n" + rate + "master_id = 1\n" + "gateway = { bus = \"" +
                    above + "\", slot = 3 }\n";
    made.plant += "[bus." + name + "]\n";
    gates += "[[gateway]]\nabove = \"gateway " + std::to_string(level) + "\"\nbeneath = [\"port " +
             std::to_string(level) + "\"]\n";
  }
  for (int level = 0; level <= gateways; ++level) {
    if (level < gateways) add(level, 88, "gateway " + std::to_string(level + 1), 3);
    for (int i = 0; i < valves; ++i) {
      const auto name = "valve " + std::to_string(level) + (i == 0 ? "" : "-" + std::to_string(i));
      add(level, 7 + i, name, 5 + i);
    }
    if (level == 0) continue;
    made.plant += "[[device]]\nbus = \"bus" + std::to_string(level) + "\"\nname = \"port " + std::to_string(level) +
                  "\"\ntype = { vendor = 1, product = 89 }\nserial = " + std::to_string(100 * level + 1) +
                  "\nnode_id = 1\nsource = \"hard-coded\"\nmaster = { flying = false }\n";
  }
  made.plant += gates;
  return made;
}

}  // namespace berth::tree_tests

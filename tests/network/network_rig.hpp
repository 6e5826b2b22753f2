// A simulated bus with whole devices as slaves, and a manager on it.
#pragma once

#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/device/device.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/network/managed_bus.hpp"
#include "berth/network/network_boot.hpp"
#include "berth/sim/world.hpp"

namespace berth::network::test {

using namespace std::chrono_literals;

inline constexpr std::uint32_t slave_type = 0x0003'0191;
inline constexpr auto slave_heartbeat = 100ms;

inline const std::shared_ptr<const od::Description>& slave_description(bool beats = true) {
  const auto make = [](std::uint16_t heartbeat_ms) {
    od::DescriptionBuilder b;
    device::add_device(b, {.type = slave_type, .name = "Slave", .heartbeat_ms = heartbeat_ms});
    device::add_storage(b);
    b.variable(0x2000, {.name = "Limit"});
    return b.build();
  };
  static const auto beating = make(std::chrono::milliseconds(slave_heartbeat).count());
  static const auto silent = make(0);
  return beats ? beating : silent;
}

// One device on a controller of its own.
struct Station {
  Station(sim::World& world, sim::Bus& bus, std::uint8_t id, std::shared_ptr<const od::Description> description,
          std::vector<device::Preset> presets = {})
      : controller(bus.attach({.queue_depth = 16, .rx_depth = 16})),
        dispatcher(world.executor(), *controller),
        flash(world.executor(), device::memory_size(*description), 1ms),
        device(dispatcher, std::move(description), &flash,
               {.address = {0x11, 0x22, 0x0002'0005, id},
                .source = device::NodeIdSource::fixed,
                .node_id = NodeId(id),
                .presets = std::move(presets)}) {}
  void on() {
    controller->power(true);
    device.power_on();
  }
  void off() {
    device.power_off();
    controller->power(false);
  }
  [[nodiscard]] NmtState state() const { return device.state(); }
  std::unique_ptr<sim::Controller> controller;
  can::Dispatcher dispatcher;
  device::SimFlash flash;
  device::Device device;
};

struct NetworkRig : can::Tap {
  explicit NetworkRig(std::uint64_t perturbation = 0) {
    if (perturbation != 0) world.executor().perturb(perturbation);
    wire.add_tap(*this);
    managed.on_apply([this](co::NmtCommand command) {
      applied.push_back(command);
      if (applies) applies(command);
    });
    managed.lead_to(&network.error_control());
    network.observe([this](const NetworkEvent& event) {
      events.push_back(event);
      if (heard) heard(event);
    });
    plan.startup.master = true;
    plan.own = NodeId(127);
  }
  virtual ~NetworkRig() { wire.remove_tap(*this); }
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    frames.push_back(can::to_string(frame));
    times.push_back(at);
  }

  // A device, switched on, and a slave of the plan: booted on error, heartbeat supervised.
  Station& add(std::uint8_t id, bool mandatory = false, bool beats = true) {
    auto& station = stations[id];
    station = std::make_unique<Station>(world, wire, id, slave_description(beats));
    station->on();
    plan.slaves.push_back({NodeId(id), rules(mandatory, beats), &managed.target(NodeId(id)), &source});
    return *station;
  }
  static SlaveRules rules(bool mandatory, bool beats = true) {
    SlaveRules r{.assigned = true, .boots = true, .mandatory = mandatory};
    r.device_type = slave_type;
    if (beats) r.heartbeat = 3 * slave_heartbeat;
    return r;
  }
  SlaveRules& rules_of(std::uint8_t id) {
    return std::ranges::find(plan.slaves, NodeId(id), &NetworkSlave::node)->rules;
  }
  void begin() {
    world.run_for(50ms);  // the devices are up
    forget();
    const auto begun = network.begin(plan);
    ASSERT_TRUE(begun) << describe(begun.error());
  }
  void forget() {
    frames.clear();
    times.clear();
    events.clear();
    applied.clear();
  }
  void run(rt::Duration time) { world.run_for(time); }
  bool run_to(NetworkBoot::Phase phase, rt::Duration limit = 30s) {
    return world.run_until([&] { return network.phase() == phase; }, limit);
  }
  [[nodiscard]] const SlaveStatus& status(std::uint8_t id) { return *network.find(NodeId(id)); }
  [[nodiscard]] std::size_t count(std::string_view frame) const {
    return static_cast<std::size_t>(std::ranges::count(frames, frame));
  }
  [[nodiscard]] std::size_t count(NetworkEvent::Kind kind, std::uint8_t id = 255) const {
    return static_cast<std::size_t>(std::ranges::count_if(
        events, [&](const auto& e) { return e.kind == kind && (id == 255 || e.node == NodeId(id)); }));
  }
  [[nodiscard]] rt::Time time_of(std::string_view frame) const {
    const auto it = std::ranges::find(frames, frame);
    EXPECT_NE(it, frames.end()) << frame;
    return it == frames.end() ? rt::never : times[static_cast<std::size_t>(it - frames.begin())];
  }
  // NMT commands on the wire, in their order.
  [[nodiscard]] std::vector<std::string> commands() const {
    std::vector<std::string> found;
    std::ranges::copy_if(frames, std::back_inserter(found), [](auto& f) { return f.starts_with("000#"); });
    return found;
  }

  sim::World world;
  sim::Bus& wire = world.add_bus("bus", 500'000);
  std::unique_ptr<sim::Controller> controller = wire.attach({.queue_depth = 16, .rx_depth = 64});
  can::Dispatcher dispatcher{world.executor(), *controller};
  ManagedBus managed{dispatcher};
  NetworkBoot network{world.executor(), managed};
  BootSource source;
  NetworkPlan plan;
  std::map<std::uint8_t, std::unique_ptr<Station>> stations;
  std::vector<std::string> frames;
  std::vector<rt::Time> times;
  std::vector<NetworkEvent> events;
  std::vector<co::NmtCommand> applied;
  std::function<void(co::NmtCommand)> applies;
  std::function<void(const NetworkEvent&)> heard;
};

}  // namespace berth::network::test

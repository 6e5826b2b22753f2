// A simulated bus with whole devices on it, and a client's network: what the tests of this room run on.
#pragma once

#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/client/remote_node.hpp"
#include "berth/device/device.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/rt/scope.hpp"
#include "berth/sim/world.hpp"

namespace berth::client::test {

using namespace std::chrono_literals;

// 2000h + code of each data type: an object of that type and name. 2100h.. for limits, access and names.
inline std::shared_ptr<const od::Description> dictionary() {
  using od::Access, od::DataType, od::Literal, od::ObjectCode;
  od::DescriptionBuilder b;
  device::add_device(b, {.name = "Test device", .heartbeat_ms = 100});
  for (const auto type : od::all_data_types()) {
    if (!od::known(type)) continue;
    const auto index = static_cast<std::uint16_t>(0x2000 + static_cast<unsigned>(type));
    b.variable(index, {.name = od::name(type), .type = type, .mappable = od::byte_size(type) != 0, .capacity = 4000});
  }
  b.variable(0x2100, {.name = "Limited",
                      .type = DataType::integer16,
                      .low = Literal::number(od::wrap(DataType::integer16, static_cast<std::uint64_t>(-10))),
                      .high = Literal::number(100)});
  b.variable(0x2101, {.name = "Read only", .access = Access::ro, .initial = Literal::number(7)});
  b.variable(0x2102, {.name = "Write only", .access = Access::wo});
  b.variable(0x2103, {.name = "Above the node-ID", .type = DataType::unsigned8, .low = Literal::node_id_plus(1)});
  b.object(0x2104, ObjectCode::record, "Axis");
  b.sub(0x2104, {.sub = 1, .name = "Position", .type = DataType::integer32, .mappable = true});
  b.sub(0x2104, {.sub = 2, .name = "Speed", .type = DataType::integer16, .mappable = true});
  b.object(0x2105, ObjectCode::record, "Other axis");
  b.sub(0x2105, {.sub = 1, .name = "Position", .type = DataType::integer32, .mappable = true});
  b.sub(0x2105,
        {.sub = 2, .name = "Torque", .type = DataType::unsigned8, .mappable = true, .initial = Literal::number(9)});
  device::add_tpdo(b, 1, {.map = {{{0x2104, 1}, 32}, {{0x2001, 0}, 1}, {{0x2010, 0}, 24}}});
  device::add_tpdo(b, 2, {.map = {{{0x2104, 2}, 16}}});
  device::add_tpdo(b, 5, {.map = {{{0x2104, 2}, 16}}});  // not valid: no predefined identifier
  device::add_rpdo(b, 1, {.map = {{{0x2105, 2}, 8}, {{0x2104, 2}, 16}, {{0x2001, 0}, 1}}});
  return b.build();
}

struct Bus;

struct SimDevice {
  SimDevice(Bus& bus, std::uint8_t id, std::shared_ptr<const od::Description> description = dictionary());
  template <class T>
  T value(ObjectRef ref) {
    return device.values().get<T>(ref).value();
  }
  std::unique_ptr<sim::Controller> controller;
  can::Dispatcher dispatcher;
  device::Device device;
};

// Counts what is on the bus.
struct Bus final : can::Tap {
  explicit Bus(sim::World& w, const char* name = "bus")
      : world(w), bus(w.add_bus(name, 1'000'000)), port(bus.attach()), dispatcher(w.executor(), *port) {
    bus.add_tap(*this);
  }
  ~Bus() { bus.remove_tap(*this); }
  void frame(const can::Frame& frame, rt::Time, int) noexcept override { frames.push_back(can::to_string(frame)); }
  sim::World& world;
  sim::Bus& bus;
  std::unique_ptr<sim::Controller> port;
  can::Dispatcher dispatcher;
  std::vector<std::string> frames;
};

inline SimDevice::SimDevice(Bus& bus, std::uint8_t id, std::shared_ptr<const od::Description> description)
    : controller(bus.bus.attach()),
      dispatcher(bus.world.executor(), *controller),
      device(dispatcher, std::move(description), nullptr,
             {.address = {1, 2, 3, id}, .source = device::NodeIdSource::fixed, .node_id = NodeId(id)}) {
  device.power_on();
}

struct Flag final : rt::Job {
  void run() noexcept override { set = true; }
  bool set = false;
};

// One bus, device 5, network and remote node.
struct Rig {
  explicit Rig(NodeOptions options = {}, std::uint64_t perturbation = 0) : node_options(std::move(options)) {
    if (perturbation != 0) world.executor().perturb(perturbation);
    world.run_for(20ms);
    bus.frames.clear();
  }
  // Runs an operation or a task until it is done; its outcome.
  template <class Op>
  auto get(Op&& op, rt::Duration limit = 100s) {
    Flag flag;
    if (!op.begin(world.executor(), flag)) {
      EXPECT_TRUE(world.run_until([&] { return flag.set; }, limit)) << "it hangs";
    }
    return op.await_resume();
  }
  template <class T>
  T get(rt::Task<T> task, rt::Duration limit = 100s) {
    Flag flag;
    if (!task.start(world.executor(), flag)) {
      EXPECT_TRUE(world.run_until([&] { return flag.set; }, limit)) << "it hangs";
    }
    return task.take();
  }
  void run(rt::Duration time) { world.run_for(time); }
  void start() {
    const auto sent = get(node->nmt(co::NmtCommand::start));
    EXPECT_TRUE(sent.has_value());
    run(5ms);
  }

  NodeOptions node_options;
  sim::World world;
  Bus bus{world};
  std::unique_ptr<SimDevice> device = std::make_unique<SimDevice>(bus, 5);
  std::unique_ptr<Network> network = std::make_unique<Network>(bus.dispatcher);
  std::unique_ptr<RemoteNode> node =
      std::make_unique<RemoteNode>(*network, NodeId(5), device->device.values().shared_description(), node_options);
};

}  // namespace berth::client::test

// A device on a simulated bus, and a master that sends it frames.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/device/device.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/sim/world.hpp"

namespace berth::process {

/// A device with an RPDO of two variables and a TPDO of one.
struct Scene {
  /// `deadline_ms`: 1400h:05.
  explicit Scene(std::uint16_t deadline_ms = 0)
      : bus(world.add_bus("b", 250'000)), master(bus.attach({.name = "master"})), port(bus.attach({.name = "d"})) {
    od::DescriptionBuilder b;
    device::add_device(b, {.supervised = 2});
    b.object(0x1028, od::ObjectCode::array, "Emergency consumer");
    b.sub(0x1028, {.sub = 0, .name = "Highest", .type = od::DataType::unsigned8, .initial = od::Literal::number(9)});
    b.sub(0x1028,
          {.sub = 9, .name = "Node 9", .type = od::DataType::unsigned32, .initial = od::Literal::number(0x089)});
    b.object(0xA4C0, od::ObjectCode::array, "Output variables");
    for (std::uint8_t sub = 1; sub <= 2; ++sub) {
      b.sub(0xA4C0,
            {.sub = sub, .name = "v", .type = od::DataType::unsigned8, .access = od::Access::rww, .mappable = true});
    }
    b.object(0xA040, od::ObjectCode::array, "Input variables");
    b.sub(0xA040, {.sub = 1, .name = "v", .type = od::DataType::unsigned8, .access = od::Access::ro, .mappable = true});
    device::add_rpdo(b, 1, {.map = {{{0xA4C0, 1}, 8}, {{0xA4C0, 2}, 8}}, .event_timer_ms = deadline_ms});
    device::add_tpdo(b, 1, {.map = {{{0xA040, 1}, 8}}});
    dispatcher.emplace(world.executor(), *port);
    device.emplace(*dispatcher, b.build(), nullptr,
                   device::Options{.source = device::NodeIdSource::fixed, .node_id = NodeId(5)});
  }
  void run(rt::Duration time = std::chrono::milliseconds(3)) { world.run_for(time); }
  void send(std::string_view frame) {
    master->send(*can::parse_frame(frame), 0);
    run();
  }
  struct Tap final : can::Tap {
    void frame(const can::Frame& frame, rt::Time, int) noexcept override { text.push_back(can::to_string(frame)); }
    std::vector<std::string> text;
  };
  sim::World world;
  sim::Bus& bus;
  std::unique_ptr<sim::Controller> master;
  std::unique_ptr<sim::Controller> port;
  std::optional<can::Dispatcher> dispatcher;
  std::optional<device::Device> device;
};

}  // namespace berth::process

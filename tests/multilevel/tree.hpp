/// Buses, gateways between them and devices on them, in one simulated world.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/co/sdo_access.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/device/device.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/multilevel/gateway_access.hpp"
#include "berth/multilevel/sdo_gateway.hpp"
#include "berth/rt/scope.hpp"
#include "berth/sim/world.hpp"

namespace berth::multilevel::test {

using namespace std::chrono_literals;
using Bytes = std::vector<std::uint8_t>;
using Log = std::vector<std::string>;

inline Bytes numbers(std::size_t count, std::size_t from = 0) {
  Bytes bytes(count);
  for (std::size_t i = 0; i < count; ++i) bytes[i] = static_cast<std::uint8_t>((i + from) * 37 + ((i + from) >> 8U));
  return bytes;
}

/// A bus with what was on it, as candump text.
class Line final : public can::Tap {
 public:
  Line(sim::World& world, const std::string& name, std::uint32_t bit_rate = 500'000)
      : bus(world.add_bus(name, bit_rate)) {
    bus.add_tap(*this);
  }
  ~Line() { bus.remove_tap(*this); }
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    log.push_back(can::to_string(frame));
    times.push_back(at);
  }
  void clear() {
    log.clear();
    times.clear();
  }
  /// When it was there first; never: rt::never.
  [[nodiscard]] rt::Time when(const std::string& text) const {
    for (std::size_t i = 0; i < log.size(); ++i) {
      if (log[i] == text) return times[i];
    }
    return rt::never;
  }
  sim::Bus& bus;
  Log log;
  std::vector<rt::Time> times;
};

/// A port on a bus with a dispatcher.
struct Station {
  Station(sim::World& world, Line& line)
      : controller(line.bus.attach({.queue_depth = 64, .rx_depth = 64})), dispatcher(world.executor(), *controller) {}
  void send(const std::string& text) { controller->send(*can::parse_frame(text), 0); }
  std::unique_ptr<sim::Controller> controller;
  can::Dispatcher dispatcher;
};

/// A device with a few objects.
struct Leaf : Station {
  Leaf(sim::World& world, Line& line, unsigned id)
      : Station(world, line),
        device(dispatcher, description(), nullptr,
               {.address = {1, 2, 3, id}, .node_id = NodeId(static_cast<std::uint8_t>(id))}) {
    device.power_on();
  }
  static std::shared_ptr<const od::Description> description() {
    static const auto made = [] {
      od::DescriptionBuilder b;
      device::add_device(b, {.type = 0x0002'0192, .name = "Leaf"});
      b.variable(0x2000, {.name = "U8", .type = od::DataType::unsigned8});
      b.variable(0x2001, {.name = "U16", .type = od::DataType::unsigned16});
      b.variable(0x2002, {.name = "U32", .high = od::Literal::number(0x1000'0000)});
      b.variable(0x2003, {.name = "Octets", .type = od::DataType::octet_string, .capacity = 12});
      b.variable(0x2004, {.name = "Domain", .type = od::DataType::domain, .capacity = 20000});
      return b.build();
    }();
    return made;
  }
  device::Device device;
};

/// Two ports, a device on each, the SDO gateway between. The dictionary above has an additional SDO server (1201h,
/// 1202h) for other clients.
struct Gateway {
  Gateway(sim::World& world, Line& above, unsigned id_above, Line& beneath, unsigned id_beneath,
          const SdoGatewayOptions& options = {})
      : up(world, above),
        down(world, beneath),
        upper(up.dispatcher, description(), nullptr,
              {.address = {1, 1, 1, id_above}, .node_id = NodeId(static_cast<std::uint8_t>(id_above))}),
        lower(down.dispatcher, device::minimal_description(), nullptr,
              {.address = {1, 1, 2, id_above}, .node_id = NodeId(static_cast<std::uint8_t>(id_beneath))}),
        client(down.dispatcher),
        gateway(upper.values(), client, world.executor(), options) {
    gateway.set_own(NodeId(static_cast<std::uint8_t>(id_beneath)), lower.values());
    upper.on().state = [this](NmtState state) {
      if (state == NmtState::initialising) gateway.reset();
    };
    upper.power_on();
    lower.power_on();
  }
  static std::shared_ptr<const od::Description> description() {
    static const auto made = [] {
      od::DescriptionBuilder b;
      device::add_device(b, {.name = "Gateway"});
      add_sdo_gateway(b);
      for (const std::uint16_t index : {std::uint16_t{0x1201}, std::uint16_t{0x1202}}) {
        const auto number = index - 0x1200U;
        b.object(index, od::ObjectCode::record, "SDO server parameter", od::DataType::sdo_parameter);
        b.sub(index, {.sub = 1, .name = "COB-ID", .initial = od::Literal::number(0x330 + number)});
        b.sub(index, {.sub = 2, .name = "COB-ID", .initial = od::Literal::number(0x3B0 + number)});
      }
      return b.build();
    }();
    return made;
  }
  Station up;
  Station down;
  device::Device upper;
  device::Device lower;
  co::SdoClient client;
  SdoGateway gateway;
};

/// Gateways one beneath the other, a leaf (node 50) on the lowest bus, a client on the uppermost.
struct Chain {
  explicit Chain(unsigned depth, const SdoGatewayOptions& options = {}, std::uint32_t lowest_rate = 500'000) {
    for (unsigned i = 0; i <= depth; ++i) {
      const std::uint32_t rate = i == depth ? lowest_rate : 500'000;
      lines.push_back(std::make_unique<Line>(world, "bus" + std::to_string(i), rate));
    }
    for (unsigned i = 0; i < depth; ++i) {
      SdoGatewayOptions mine = options;
      mine.levels_beneath = depth - 1 - i;
      gateways.push_back(std::make_unique<Gateway>(world, *lines[i], 3 + i, *lines[i + 1], 1, mine));
      path.gateways.push_back({NodeId(static_cast<std::uint8_t>(3 + i))});
    }
    path.node = NodeId(50);
    leaf.emplace(world, *lines.back(), 50);
    master.emplace(world, *lines.front());
    client.emplace(master->dispatcher);
    world.run_for(50ms);
    for (auto& line : lines) line->clear();
  }
  sim::World world;
  std::vector<std::unique_ptr<Line>> lines;
  std::vector<std::unique_ptr<Gateway>> gateways;
  std::optional<Leaf> leaf;
  std::optional<Station> master;
  std::optional<co::SdoClient> client;
  Path path;
};

/// The additional channel 1..2 of a gateway, as its client has it.
inline co::SdoChannel extra_channel(unsigned number) { return {co::CobId(0x330 + number), co::CobId(0x3B0 + number)}; }

template <class T>
rt::Task<void> keep(rt::Task<T> task, std::optional<T>& into) {
  auto value = co_await task;
  into = std::move(value);
}

/// Runs a task in the world; what it gave.
template <class T>
T await(sim::World& world, rt::Task<T> task, rt::Duration limit = 60s) {
  std::optional<T> value;
  rt::Scope scope(world.executor());
  scope.spawn(keep(std::move(task), value));
  world.run_until([&] { return value.has_value(); }, limit);
  EXPECT_TRUE(value.has_value()) << "the task hangs";
  if (!value) throw std::runtime_error("the task hangs");
  return std::move(*value);
}

inline Bytes bytes_of(const Result<co::SdoValue>& value) {
  EXPECT_TRUE(value) << (value ? "" : describe(value.error()));
  if (!value) return {};
  return {value->bytes().begin(), value->bytes().end()};
}

}  // namespace berth::multilevel::test

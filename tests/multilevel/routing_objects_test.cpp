// The routing database as objects of the gateway (docs/multilevel.md §Objects): written by SDO, and what crosses then.
#include <gtest/gtest.h>
#include <array>
#include <memory>

#include "berth/multilevel/gateway_device.hpp"
#include "berth/multilevel/routing_objects.hpp"
#include "tree.hpp"

using namespace berth;
using namespace berth::multilevel;
using namespace berth::multilevel::test;

namespace {

// From 5F21h:02 beneath (port 1) to 5F21h:03 above, as the documentation lays it out.
constexpr std::uint64_t up_02_to_03 = 0x5F21'0300'5F21'0201;

struct Routed : ::testing::Test {
  Routed() {
    od::DescriptionBuilder upper, lower;
    device::add_device(upper, {.name = "Upper"});
    add_gateway_objects(upper);
    add_routing_objects(upper, 2);
    add_signal_places(upper, 4, 2);
    device::add_device(lower, {.name = "Lower"});
    add_signal_places(lower, 4, 2);
    // What a configuration would set: RPDO 1 beneath brings 5F21h:02, TPDO 1 above carries 5F21h:03.
    device::add_tpdo(upper, 1, {.map = {{{0x5F21, 3}, 16}}});
    device::add_rpdo(lower, 1, {.map = {{{0x5F21, 2}, 16}}});
    GatewayOptions options;
    options.description = upper.build();
    options.upper = {.node_id = NodeId(3), .send_tpdos_at_start = false};
    gateway = std::make_unique<GatewayDevice>(world.executor(), *up, options);
    BusOptions bus;
    bus.description = lower.build();
    bus.device = {.node_id = NodeId(1), .send_tpdos_at_start = false};
    gateway->add_bus(*down, bus);
    gateway->signals_from_objects();
    gateway->power_on();
    world.run_for(100ms);
  }
  template <class T>
  void write(ObjectRef object, T value) {
    ASSERT_EQ(gateway->upper().values().set<T>(object, value), od::AbortCode::none);
  }
  void start() {
    master.send("000#0100");
    worker.send("000#0100");
    world.run_for(20ms);
    above.clear();
  }
  /// Whether what comes beneath goes up.
  bool crosses(const std::string& bytes) {
    above.clear();
    worker.send("201#" + bytes);
    world.run_for(20ms);
    return above.when("183#" + bytes) != rt::never;
  }
  sim::World world;
  Line above{world, "above"};
  Line beneath{world, "beneath"};
  Station master{world, above};
  Station worker{world, beneath};
  std::unique_ptr<sim::Controller> up = above.bus.attach({.queue_depth = 64, .rx_depth = 64});
  std::unique_ptr<sim::Controller> down = beneath.bus.attach({.queue_depth = 64, .rx_depth = 64});
  std::unique_ptr<GatewayDevice> gateway;
};

}  // namespace

TEST(RoutingObjects, ARowIsLaidOutAsDocumented) {
  const RouteEntry entry{1, 0, {0x5F21, 2}, {0x5F21, 3}};
  EXPECT_EQ(entry.raw(), up_02_to_03);
  EXPECT_EQ(RouteEntry::of(up_02_to_03), entry);
  EXPECT_EQ(signal_places(1), 0x5F20);
  EXPECT_EQ(signal_places(8), 0x5F23);
  EXPECT_FALSE(signal_places(3));
}

// Rows count up to sub-index 0, and from the next start on.
TEST_F(Routed, WhatIsWrittenCountsFromTheNextStart) {
  start();
  EXPECT_FALSE(crosses("0102"));
  write<std::uint64_t>({RoutingObjects::routes, 1}, up_02_to_03);
  EXPECT_FALSE(crosses("0202"));
  master.send("000#8000");
  world.run_for(20ms);
  start();
  EXPECT_FALSE(crosses("0302")) << "no row counts";
  write<std::uint8_t>({RoutingObjects::routes, 0}, 1);
  master.send("000#8000");
  world.run_for(20ms);
  start();
  EXPECT_TRUE(crosses("0402"));
}

TEST_F(Routed, TheModeCountsAtOnce) {
  write<std::uint64_t>({RoutingObjects::routes, 1}, up_02_to_03);
  write<std::uint8_t>({RoutingObjects::routes, 0}, 1);
  write<std::uint32_t>({RoutingObjects::modes, 1}, 0b10);  // in mode 1 alone
  start();
  EXPECT_FALSE(crosses("0102"));
  master.send("603#2F105F0001000000");
  world.run_for(20ms);
  EXPECT_TRUE(crosses("0202"));
}

// A row that is wrong is told above once, and is over with the start that finds none.
TEST_F(Routed, AWrongRowIsTold) {
  write<std::uint64_t>({RoutingObjects::routes, 1}, up_02_to_03);
  write<std::uint64_t>({RoutingObjects::routes, 2}, (RouteEntry{1, 0, {0x5F21, 1}, {0x5F20, 1}}.raw()));
  write<std::uint8_t>({RoutingObjects::routes, 0}, 2);
  master.send("000#0100");
  worker.send("000#0100");
  world.run_for(50ms);
  EXPECT_NE(above.when("083#06FF810000000000"), rt::never);
  EXPECT_TRUE(crosses("0102")) << "the other row works";
  write<std::uint64_t>({RoutingObjects::routes, 2}, 0);
  master.send("000#8000");
  world.run_for(20ms);
  above.clear();
  master.send("000#0100");
  world.run_for(50ms);
  EXPECT_NE(above.when("083#00000000000006FF"), rt::never) << ::testing::PrintToString(above.log);
}

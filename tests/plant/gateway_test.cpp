// Devices of several ports in a plant file: paper 3's gateways (docs/plant-file.md).
#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "berth/plant/port_device.hpp"
#include "berth/plant/world.hpp"
#include "record.hpp"

namespace berth::plant::gateway_tests {
namespace {

using namespace std::chrono_literals;

constexpr const char* three_levels = R"(
[bus.backbone]
bitrate = 250_000
[bus.boom]
bitrate = 125_000
[bus.tool]
bitrate = 50_000

[[device]]
name = "boom gateway"
bus = "backbone"
type = { vendor = 1, product = 1 }
node_id = 3
[[device]]
name = "boom port"
bus = "boom"
type = { vendor = 1, product = 2 }
node_id = 1
[[device]]
name = "tool gateway"
bus = "boom"
type = { vendor = 1, product = 1 }
serial = 1
node_id = 4
[[device]]
name = "tool port"
bus = "tool"
type = { vendor = 1, product = 2 }
serial = 1
node_id = 1
[[device]]
name = "gripper"
bus = "tool"
type = { vendor = 1, product = 3 }
node_id = 9

[[gateway]]
above = "boom gateway"
beneath = ["boom port"]
[[gateway]]
above = "tool gateway"
beneath = ["tool port"]
)";

std::vector<std::string> errors_of(const std::string& text) {
  std::vector<std::string> messages;
  for (const auto& finding : read_plant(text, "x.plant.toml").findings) messages.push_back(finding.message);
  return messages;
}

struct Plant : ::testing::Test {
  Plant() {
    const auto result = read_plant(three_levels, "x.plant.toml");
    EXPECT_TRUE(result.plant);
    file = *result.plant;
    Findings findings;
    world = World::make(file, {}, findings);
    EXPECT_TRUE(world);
    port = world->attach_master("backbone", {.queue_depth = 16, .rx_depth = 16});
    record = std::make_unique<Record>(*world->bus("backbone"));
    world->start();
    world->sim().run_for(500ms);
  }
  ~Plant() override {
    record.reset();
    port.reset();
  }
  std::string ask(const char* frame, rt::Duration time = 100ms) {
    port->send(*can::parse_frame(frame), 0);
    world->sim().run_for(time);
    return record->text.empty() ? "" : record->text.back();
  }
  PlantFile file;
  std::unique_ptr<World> world;
  std::unique_ptr<sim::Controller> port;
  std::unique_ptr<Record> record;
};

}  // namespace

// 1018h:02 of the gripper, 3/4/9, in the seven accesses that paper 3 needs for two gateways.
TEST_F(Plant, TwoLevelsDown) {
  ask("603#2F305F0004000000");  // node 4 beneath
  ask("603#2F315F0009000000");  // there: its node-ID object
  EXPECT_EQ(ask("603#23325F002F305F00"), "583#60325F0000000000");
  ask("603#23315F0040181002");  // there: upload of 1018h:02
  EXPECT_EQ(ask("603#23325F0023325F00"), "583#60325F0000000000");
  EXPECT_EQ(ask("603#23325F0040315F00"), "583#60325F0000000000");
  EXPECT_EQ(ask("603#40315F0000000000"), "583#43315F0003000000");
}

// An emergency of the gripper, with its way in the sub-net bytes: the gateway beneath is known to speak the layout.
TEST_F(Plant, AnEmergencyFromBelow) {
  world->find("gripper")->device().errors().raise(0x2310, co::error_register::current);
  world->sim().run_for(100ms);
  EXPECT_EQ(record->text.back(), "083#1023030409000000");
}

// It is one device: what is beneath has power while the device above has.
TEST_F(Plant, PowerOfAllItsPorts) {
  SimDevice& above = *world->find("boom gateway");
  SimDevice& beneath = *world->find("boom port");
  EXPECT_TRUE(beneath.powered());
  above.power(false);
  world->sim().run_for(10ms);
  EXPECT_FALSE(beneath.powered());
  above.power(true);
  world->sim().run_for(100ms);
  EXPECT_TRUE(beneath.powered());
  above.unplug();
  world->sim().run_for(10ms);
  EXPECT_FALSE(beneath.plugged());
  above.plug();
  world->sim().run_for(500ms);
  EXPECT_TRUE(beneath.plugged());
}

// A reset of the gateway forgets what clients have said.
TEST_F(Plant, AReset) {
  ask("603#2F305F0004000000");
  ask("000#8203");
  EXPECT_EQ(ask("603#23325F0040001000"), "583#80325F0022000008");
}

TEST(PlantGateways, AreReadAndWritten) {
  auto result = read_plant(three_levels, "x.plant.toml");
  ASSERT_TRUE(result.plant);
  result.plant->gateways[0].layout = 9;
  result.plant->gateways[0].literal = true;
  result.plant->gateways[1].speaks_layout = {5, 6};
  const auto again = read_plant(write_plant(*result.plant), "x.plant.toml");
  ASSERT_TRUE(again.plant);
  EXPECT_EQ(*again.plant, *result.plant);
}

TEST(PlantGateways, WhatIsWrong) {
  const std::string good = three_levels;
  const auto with = [&](const std::string& gateway) { return errors_of(good + "[[gateway]]\n" + gateway); };
  using Messages = std::vector<std::string>;
  EXPECT_EQ(with("above = \"gripper\"\nbeneath = [\"nobody\"]"), Messages{"there is no device \"nobody\""});
  EXPECT_EQ(with("above = \"gripper\"\nbeneath = []"), Messages{"a gateway has 1 to 8 buses beneath it"});
  EXPECT_EQ(with("above = \"boom gateway\"\nbeneath = [\"gripper\"]"), Messages{"this device is a gateway already"});
  EXPECT_EQ(with("above = \"gripper\"\nbeneath = [\"tool port\"]"),
            (Messages{"\"tool port\" is a port already", "the gateway has bus \"tool\" twice"}));
  EXPECT_EQ(with("above = \"gripper\"\nbeneath = [\"boom gateway\"]\nlayout = 6").size(), 1U);
}

// ---- the same in processes of their own, on ports that they are given

namespace {

/// What `berth device --device NAME` is for these devices, on the ports of a simulated world.
struct Process {
  Process(sim::World& world, const PlantFile& plant, const std::vector<std::string>& names)
      : devices(world.executor()) {
    for (const auto& name : names) {
      const auto& plan = *plant.device(name);
      auto made = devices.add(plan, world.find_bus(plan.bus)->attach(), plant.bus(plan.bus)->bitrate, Random(1),
                              findings, plant.gateway_part(name));
      EXPECT_NE(made, nullptr) << name;
    }
    for (const auto& gateway : plant.gateways) {
      if (gateway.above != names.front()) continue;
      EXPECT_TRUE(devices.add_gateway(gateway, plant, findings));
    }
  }
  void power(bool on) {
    for (const auto& device : devices.all()) device->power(on);
  }
  Findings findings;
  PortDevices devices;
};

}  // namespace

TEST(GatewayProcesses, TwoLevelsDownAndTheirPower) {
  const auto file = *read_plant(three_levels, "x.plant.toml").plant;
  sim::World world{1};
  for (const auto& bus : file.buses) world.add_bus(bus.name, bus.bitrate);
  auto me = world.find_bus("backbone")->attach();
  Record backbone(*world.find_bus("backbone"));
  Record tool(*world.find_bus("tool"));
  Process boom(world, file, {"boom gateway", "boom port"});
  Process deeper(world, file, {"tool gateway", "tool port"});
  Process gripper(world, file, {"gripper"});
  for (Process* const process : {&gripper, &deeper, &boom}) process->power(true);
  world.run_for(500ms);
  const auto ask = [&](const char* frame) {
    me->send(*can::parse_frame(frame), 0);
    world.run_for(100ms);
    return backbone.text.back();
  };
  ask("603#2F305F0004000000");
  ask("603#2F315F0009000000");
  EXPECT_EQ(ask("603#23325F002F305F00"), "583#60325F0000000000");
  ask("603#23315F0040181002");
  EXPECT_EQ(ask("603#23325F0023325F00"), "583#60325F0000000000");
  EXPECT_EQ(ask("603#23325F0040315F00"), "583#60325F0000000000");
  EXPECT_EQ(ask("603#40315F0000000000"), "583#43315F0003000000");
  // An emergency goes up through both, with its way: the gateway beneath is known to speak the layout.
  gripper.devices.all().front()->device().errors().raise(0x2310, co::error_register::current);
  world.run_for(100ms);
  EXPECT_EQ(backbone.text.back(), "083#1023030409000000");
  // What is beneath has power while the device above has.
  const auto& above = deeper.devices.all()[0];
  const auto& beneath = deeper.devices.all()[1];
  above->power(false);
  world.run_for(10ms);
  EXPECT_FALSE(beneath->powered());
  EXPECT_FALSE(beneath->device().powered());
  above->power(true);
  world.run_for(200ms);
  EXPECT_TRUE(beneath->device().powered());
  EXPECT_TRUE(tool.has("701#00"));
}

// The device above boots when the bus beneath has, by the NMT master that its port is.
TEST(GatewayProcesses, BootsFromTheBottomUp) {
  constexpr const char* with_master = R"(
[bus.up]
bitrate = 250_000
[bus.down]
bitrate = 250_000
[[device]]
name = "gateway"
bus = "up"
type = { vendor = 1, product = 1 }
node_id = 3
[[device]]
name = "port"
bus = "down"
type = { vendor = 1, product = 2 }
node_id = 1
source = "hard-coded"
master = { flying = false, most = 4 }
boot = "300 ms"
[[gateway]]
above = "gateway"
beneath = ["port"]
)";
  const auto file = *read_plant(with_master, "x.plant.toml").plant;
  sim::World world{1};
  for (const auto& bus : file.buses) world.add_bus(bus.name, bus.bitrate);
  Record up(*world.find_bus("up"));
  Record down(*world.find_bus("down"));
  const auto hears_up = world.find_bus("up")->attach();  // a node that is alone is not acknowledged
  const auto hears_down = world.find_bus("down")->attach();
  Process process(world, file, {"gateway", "port"});
  process.power(true);
  EXPECT_TRUE(process.devices.all()[0]->powered());
  world.run_for(250ms);
  EXPECT_FALSE(up.has("703#00")) << "it takes 50 ms by itself";
  EXPECT_FALSE(process.devices.all()[0]->device().powered());
  world.run_for(1s);
  EXPECT_TRUE(up.has("703#00"));
  EXPECT_TRUE(down.has("701#00"));
}

}  // namespace berth::plant::gateway_tests

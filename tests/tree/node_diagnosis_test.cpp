// What an application that runs the manager in its own program is told of a bus and its nodes.
#include "berth/tree/node_diagnosis.hpp"

#include <gtest/gtest.h>

#include <chrono>

#include "../pch.hpp"
#include "rig.hpp"

namespace berth::tree_tests {
namespace {

using namespace std::chrono_literals;

const std::string machine = R"(
[machine]
name = "m"
[bus.field]
port = "sim"
bitrate = 250_000
[[slot]]
bus = "field"
id = 5
name = "left"
type = { vendor = 0x11, product = 0x22 }
[[slot]]
bus = "field"
id = 9
name = "right"
type = { vendor = 0x11, product = 0x33 }
optional = true
)";
const std::string plant_text = R"(
[plant]
seed = 1
[bus.field]
[[device]]
bus = "field"
name = "left"
type = { vendor = 0x11, product = 0x22 }
serial = 1
)";

// S5.23: statuses of the communication system and of the nodes, emergencies, configuration status.
TEST(NodeDiagnosis, S5_23_OfAManagerHasItsNodesAndItsBus) {
  Rig rig(machine, plant_text);
  auto now = tree::diagnosis_of(rig.session(), "field");
  EXPECT_EQ(now.nodes[5].configuration, BERTH_CONFIGURATION_UNKNOWN);
  ASSERT_TRUE(rig.up());
  ASSERT_TRUE(rig.run_until([&] { return rig.session().idle(); }, 1min));
  rig.run_for(2s);
  now = tree::diagnosis_of(rig.session(), "");
  EXPECT_EQ(now.node_id, 127);
  EXPECT_EQ(now.bus_up, 1);
  EXPECT_EQ(now.bus_off, 0);
  EXPECT_EQ(now.nodes[5].configuration, BERTH_CONFIGURED);
  EXPECT_EQ(now.nodes[5].nmt_state, 5);
  EXPECT_EQ(now.nodes[5].error_control, BERTH_ALIVE);
  EXPECT_EQ(now.nodes[5].boot, 0);
  EXPECT_EQ(now.nodes[9].configuration, BERTH_NO_DEVICE);
  EXPECT_EQ(now.nodes[9].nmt_state, 255);
  EXPECT_EQ(now.nodes[8].nmt_state, 255) << "no slot";

  rig.device("left").device().errors().raise(0x4210, co::error_register::temperature);
  rig.run_for(100ms);
  now = tree::diagnosis_of(rig.session(), "field");
  EXPECT_EQ(now.nodes[5].emcy, 0x4210);
  EXPECT_EQ(now.nodes[5].error_register, 0x09);
  EXPECT_EQ(now.nodes[5].emcy_count, 1U);
  rig.device("left").device().errors().clear(0x4210);
  rig.run_for(100ms);
  EXPECT_EQ(tree::diagnosis_of(rig.session(), "field").nodes[5].emcy, 0);

  rig.device("left").unplug();
  rig.run_for(10s);
  now = tree::diagnosis_of(rig.session(), "field");
  EXPECT_EQ(now.nodes[5].configuration, BERTH_NO_DEVICE);
  EXPECT_EQ(now.nodes[5].error_control, BERTH_LOST);

  EXPECT_EQ(tree::diagnosis_of(rig.session(), "other").bus_up, 0);
  EXPECT_EQ(tree::diagnosis_of(rig.session(), "other").node_id, 0);
}

}  // namespace
}  // namespace berth::tree_tests

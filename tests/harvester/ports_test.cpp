// The buses of examples/signals with ports of Berth's: it is their master, the gateway's own node there is a slot, and
// links cross the gateway all the same (`gateway = { node = ID }`).
#include "tests/harvester/signals.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "../pch.hpp"

namespace berth::test {
namespace {

void replace(std::string& text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  ASSERT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
}

// Berth has a port there, and the gateway's own node is blank and a slot like any other: node 9.
void own_port(const std::string& bus, const std::string& rate, const std::string& above, std::string& machine,
              std::string& plant) {
  const std::string begin = "[bus." + bus + "]\nport      = \"gateway\"\nbitrate   = " + rate + "\nmaster_id = 1\n";
  replace(machine, begin, "[bus." + bus + "]\nport = \"sim\"\nbitrate = " + rate + "\n");
  const std::string gateway = "gateway   = { bus = \"" + above + "\", slot = 3, ";
  replace(machine, gateway + "eds = \"eds/port.eds\" }", gateway + "node = 9 }");
  machine += "\n[[slot]]\nbus = \"" + bus + "\"\nid = 9\nname = \"" + bus +
             " port\"\neds = \"eds/port.eds\"\nreplacement = \"auto\"\nmandatory = true\n";
  const auto name = plant.find("\"" + bus + " port\"");
  const auto id = plant.find("node_id = 1\n", name);
  const auto end = plant.find("\n\n", id);
  ASSERT_NE(end, std::string::npos);
  plant.erase(id, end - id);
}

struct Ports {
  bool left;
  bool reel;
};

class WithPorts : public ::testing::TestWithParam<Ports>, public SignalMachine {
 protected:
  WithPorts()
      : SignalMachine([](std::string& machine, std::string& plant) {
          if (GetParam().left) own_port("left", "250_000", "backbone", machine, plant);
          if (GetParam().reel) own_port("reel", "125_000", "left", machine, plant);
        }) {}
  rt::Time operational(const std::string& slot) {
    for (const auto& each : session->report().events) {
      if (each.slot == slot && each.text == "operational") return each.at;
    }
    return rt::never;
  }
};

std::string name_of(const ::testing::TestParamInfo<Ports>& info) {
  return std::string(info.param.left ? "Left" : "") + (info.param.reel ? "Reel" : "");
}

}  // namespace

TEST_P(WithPorts, BootsFromTheBottomUp) {
  ASSERT_TRUE(up()) << log();
  for (const auto& each : world->devices()) {
    if (each->name().ends_with(" port") && each->device().node_id() == NodeId(1)) continue;  // a master of its own
    EXPECT_EQ(each->truth().state, NmtState::operational) << each->name() << "\n" << log();
  }
  EXPECT_LT(operational("torque sensor"), operational("reel gateway")) << log();
  EXPECT_LT(operational("reel gateway"), operational("left gateway")) << log();
  EXPECT_LT(operational("rear motor"), operational("left gateway")) << log();
}

// Later than any gateway is waited for (30 s): none of those above the lowest bus has been started, all are at last.
TEST_P(WithPorts, AGatewayWaitsForABusThatIsLate) {
  world->find("torque sensor")->unplug();
  for (int i = 0; i < 40; ++i) {
    world->sim().run_for(1s);
    ASSERT_NE(device("reel gateway").state(), NmtState::operational) << i << "\n" << log();
    ASSERT_NE(device("left gateway").state(), NmtState::operational) << i << "\n" << log();
  }
  world->find("torque sensor")->plug();
  EXPECT_TRUE(up()) << log();
}

TEST_P(WithPorts, ValuesArriveWithinTheBound) {
  ASSERT_TRUE(up()) << log();
  ASSERT_EQ(links.plan.crossings.size(), 3U);
  rt::Duration bound{};
  for (const auto& each : links.plan.crossings) bound = std::max(bound, each.worst.value_or(0ms));
  ASSERT_GT(bound, 0ms);
  for (std::int16_t torque = 101; torque < 106; ++torque) {
    measure<std::int16_t>("torque sensor", {0x7100, 0}, torque);
    const auto at = world->executor().now();
    ASSERT_TRUE(run_until([&] { return value<std::int16_t>("engine", {0x2002, 0}) == torque; }, 1s)) << log();
    EXPECT_LE(world->executor().now() - at, bound);
    EXPECT_EQ(value<std::int16_t>("front motor", {0x6042, 0}), torque);
    world->sim().run_for(37ms);
  }
  measure<std::uint16_t>("engine", {0x2001, 0}, std::uint16_t{1800});
  EXPECT_TRUE(run_until([&] { return value<std::uint16_t>("rear motor", {0x6040, 0}) == 1800; }, 50ms)) << log();
}

INSTANTIATE_TEST_SUITE_P(Buses, WithPorts, ::testing::Values(Ports{true, false}, Ports{false, true}, Ports{true, true}),
                         name_of);

}  // namespace berth::test

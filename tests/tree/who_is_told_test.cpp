// Who is told what an emergency from beneath means: its bytes name no port of a gateway, lose the deepest node-IDs, or
// name nobody at all. No slot is told anything that was not asked or heard of that slot.
#include <chrono>
#include <string>

#include "../pch.hpp"
#include "berth/co/emcy.hpp"
#include "berth/tree/emcy_origins.hpp"
#include "rig.hpp"

namespace berth::tree_tests {
namespace {

using namespace std::chrono_literals;
using places::SlotState;
using Lines = std::vector<std::string>;

// Two buses beneath one gateway, and a valve with node-ID 5 on each.
constexpr const char* sisters = R"(
[machine]
name = "sisters"
[bus.top]
port = "sim"
bitrate = 250_000
[bus.left]
port = "gateway"
bitrate = 250_000
master_id = 1
gateway = { bus = "top", slot = 3, port = 1 }
[bus.right]
port = "gateway"
bitrate = 250_000
master_id = 1
gateway = { bus = "top", slot = 3, port = 2 }
[[slot]]
bus = "top"
id = 3
name = "gateway"
type = { vendor = 1, product = 88 }
[[slot]]
bus = "left"
id = 5
name = "left valve"
type = { vendor = 1, product = 7 }
[[slot]]
bus = "right"
id = 5
name = "right valve"
type = { vendor = 1, product = 7 }
)";
constexpr const char* sisters_plant = R"(
[plant]
[bus.top]
[bus.left]
[bus.right]
[[device]]
bus = "top"
name = "gateway"
type = { vendor = 1, product = 88 }
serial = 1
[[device]]
bus = "left"
name = "left port"
type = { vendor = 1, product = 89 }
serial = 2
node_id = 1
source = "hard-coded"
master = { flying = false }
[[device]]
bus = "right"
name = "right port"
type = { vendor = 1, product = 89 }
serial = 3
node_id = 1
source = "hard-coded"
master = { flying = false }
[[device]]
bus = "left"
name = "left valve"
type = { vendor = 1, product = 7 }
serial = 11
[[device]]
bus = "right"
name = "right valve"
type = { vendor = 1, product = 7 }
serial = 12
[[gateway]]
above = "gateway"
beneath = ["left port", "right port"]
)";

struct Sisters : ::testing::Test {
  Sisters() : rig(sisters, sisters_plant) {
    EXPECT_TRUE(rig.up()) << rig.log();
    rig.run_for(5s);
  }
  Rig rig;
};

}  // namespace

// The gateway tells that node 5 beneath it is lost, and not on which of its buses.
TEST_F(Sisters, OnlyTheOneThatLeftIsToldAbsent) {
  for (const char* const name : {"right valve", "left valve"}) {
    const std::string other = name == std::string("right valve") ? "left valve" : "right valve";
    for (auto later = 0ms; later < 700ms; later += 37ms) {
      SCOPED_TRACE(name + std::to_string(later.count()));
      rig.run_for(later);
      rig.forget_events();
      rig.device(name).unplug();
      rig.run_for(5s);
      EXPECT_EQ(rig.state(name), SlotState::absent);
      EXPECT_EQ(rig.told(name).size(), 1U) << rig.log();
      EXPECT_EQ(rig.told(other), Lines{}) << rig.log();
      rig.device(name).plug();
      ASSERT_TRUE(rig.up()) << rig.log();
      rig.run_for(2s);
      EXPECT_EQ(rig.told(other), Lines{}) << rig.log();
    }
  }
}

// Another emergency is told of neither: of both, by name.
TEST_F(Sisters, AnErrorIsToldOfBoth) {
  rig.forget_events();
  rig.device("right valve").device().errors().raise(0x2310, co::error_register::current);
  rig.run_for(2s);
  EXPECT_EQ(rig.told("left valve"), Lines{});
  EXPECT_EQ(rig.told("right valve"), Lines{});
  const auto lines = rig.told("");
  ASSERT_EQ(lines.size(), 1U) << rig.log();
  EXPECT_TRUE(lines.front().starts_with("EMCY 3/5: 2310h")) << lines.front();
  EXPECT_NE(lines.front().find("3/5 left valve or 3.2/5 right valve"), std::string::npos) << lines.front();
}

// The manufacturer's bytes of a device that is no gateway are no path, and one beneath the gateway is told once.
TEST(WhoIsTold, ADeviceBesideTheGatewayTellsOfItself) {
  Rig rig(std::string(sisters) + R"(
[[slot]]
bus = "top"
id = 4
name = "lamp"
type = { vendor = 1, product = 9 }
)",
          std::string(sisters_plant) + R"(
[[device]]
bus = "top"
name = "lamp"
type = { vendor = 1, product = 9 }
serial = 4
)");
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(5s);
  rig.forget_events();
  rig.device("lamp").device().errors().raise(0x2310, co::error_register::current, {5, 6, 0, 0, 0});
  rig.run_for(2s);
  ASSERT_EQ(rig.told("lamp").size(), 1U) << rig.log();
  EXPECT_TRUE(rig.told("lamp").front().starts_with("EMCY 2310h ")) << rig.log();
  EXPECT_EQ(rig.told(""), Lines{}) << rig.log();
  rig.forget_events();
  rig.device("left valve").device().errors().raise(0x2310, co::error_register::current);
  rig.run_for(2s);
  EXPECT_EQ(rig.events().size(), 1U) << rig.log();
}

// S3.20: the words are those of the producer's device profile (paper 3 Figure 10), which its 1000h tells.
TEST(WhoIsTold, TheWordsOfTheProducersProfile) {
  const auto made = chain(1, 250'000, 3);
  Rig rig(made.machine, made.plant);
  const auto tell = [&](const char* name, std::uint32_t type) {
    rig.device(name).device().values().set<std::uint32_t>({0x1000, 0}, type);
  };
  ASSERT_TRUE(rig.up()) << rig.log();
  tell("valve 1", 0x0002'0192);  // a restart would take it back, and who they are is asked after this
  tell("valve 1-1", 0x0003'0191);
  rig.run_for(5s);
  for (const auto& [name, words] : {std::pair{"valve 1", "3210h DC link over-voltage"},
                                    std::pair{"valve 1-1", "3210h internal voltage too high"}}) {
    rig.forget_events();
    rig.device(name).device().errors().raise(0x3210, co::error_register::voltage);
    rig.run_for(1s);
    ASSERT_EQ(rig.told(name).size(), 1U) << rig.log();
    EXPECT_NE(rig.told(name).front().find(words), std::string::npos) << rig.told(name).front();
  }
}

// Figure 7 has room for six levels: of a node on the seventh the last node-ID is lost, and the gateway above it seems
// to be meant.
TEST(WhoIsTold, ANodeTooDeepForTheLayout) {
  const auto made = chain(6);
  Rig rig(made.machine, made.plant);
  ASSERT_TRUE(rig.up(10min)) << rig.log();
  rig.run_for(5s);
  rig.forget_events();
  rig.device("valve 6").unplug();
  rig.run_for(10s);
  EXPECT_EQ(rig.state("valve 6"), SlotState::absent) << rig.log();
  EXPECT_EQ(rig.told("valve 6").size(), 1U) << rig.log();
  for (const char* const name :
       {"gateway 1", "gateway 2", "gateway 4", "gateway 5", "gateway 6", "valve 1", "valve 5"}) {
    auto lines = rig.told(name);
    std::erase_if(lines, [](const std::string& line) { return line.find("FF04h") != std::string::npos; });
    EXPECT_EQ(lines, Lines{}) << name << "\n" << rig.log();
  }
}

// A gateway without a layout tells the loss beneath as its own, as does a device that misses somebody else's heartbeat.
TEST(WhoIsTold, ALossWithoutItsNode) {
  const auto made = chain(2);
  Rig rig(made.machine, made.plant);
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(5s);
  for (const char* const teller : {"gateway 2", "valve 1", "valve 2"}) {
    rig.forget_events();
    auto& errors = rig.device(teller).device().errors();
    errors.raise(co::emcy_code::life_guard_or_heartbeat, co::error_register::communication);
    rig.run_for(5s);
    for (const char* const name : {"gateway 2", "valve 1", "valve 2"}) {
      EXPECT_EQ(rig.told(name), Lines{}) << teller << "\n" << rig.log();
      EXPECT_EQ(rig.state(name), SlotState::operational);
    }
    errors.clear(co::emcy_code::life_guard_or_heartbeat);
    rig.run_for(1s);
  }
}

// And what such a gateway tells without a node is looked for beneath it at once.
TEST(WhoIsTold, ALossWithoutItsNodeIsLookedFor) {
  const auto made = chain(2);
  Rig rig(made.machine, made.plant);
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(5s);
  design::Machine machine = rig.machine();
  const auto origins = tree::origins_of(machine, "top", multilevel::EmcyLayout::source_and_exit,
                                        {.path = {NodeId(3), NodeId(3)}, .code = 0x8130});
  ASSERT_EQ(origins.named.size(), 1U);
  EXPECT_EQ(origins.named.front()->spec.name.name, "gateway 2");
  ASSERT_EQ(origins.beneath.size(), 1U);
  EXPECT_EQ(origins.beneath.front()->spec.name.name, "valve 2");
  EXPECT_FALSE(origins.may_be_deeper);
  const auto garbled = tree::origins_of(machine, "top", multilevel::EmcyLayout::source_and_exit,
                                        {.path = {NodeId(3), NodeId(5)}, .code = 0x8130, .garbled = true});
  EXPECT_EQ(garbled.named.size(), 0U) << "manufacturer data names no node";
  EXPECT_EQ(garbled.beneath.size(), 3U);
}

}  // namespace berth::tree_tests

// S1.30, S1.39, S1.40: the paper's preparation: node guarding to every slave, one by one. 30 slaves at 50 kbit/s that
// answer after 4 ms. And S1.48 with as many slaves as CANopen has node-IDs for.
#include <gtest/gtest.h>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/co/guarding.hpp"
#include "berth/nodeid/paper1_times.hpp"
#include "tests/golden/example.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::golden;
using namespace berth::harness;
namespace paper1 = nodeid::paper1;

namespace {

constexpr paper1::Conditions conditions{};

struct Guarding {
  unsigned there = 0;
  unsigned asked = 0;
  rt::Duration time{};
};

rt::Task<void> guard_all(can::Dispatcher& dispatcher, unsigned last, Guarding& result) {
  const rt::Time began = dispatcher.executor().now();
  for (unsigned id = 1; id <= last; ++id) {
    const auto node = NodeId(static_cast<std::uint8_t>(id));
    const auto answer = co_await co::guard_once(dispatcher, node, 100ms, 1);
    ++result.asked;
    if (answer.has_value()) ++result.there;
  }
  result.time = dispatcher.executor().now() - began;
}

Guarding guard(unsigned plugged, unsigned asked) {
  auto plant = one_bus_plant(1);
  for (unsigned i = 1; i <= plugged; ++i) {
    auto& device = add_device(plant, "d" + std::to_string(i), type_b, i);
    device.response = {4ms, 4ms, 0, 0ms};
    device.source = plant::NodeIdSource::hard_coded;
    device.node_id = NodeId(static_cast<std::uint8_t>(i));
  }
  Findings findings;
  const plant::BusRate rate{"backbone", conditions.bit_rate};
  const auto world = plant::World::make(plant, {&rate, 1}, findings);
  Guarding result;
  if (!world) return result;
  world->start();
  const auto port = world->attach_master("backbone");
  can::Dispatcher dispatcher(world->executor(), *port);
  world->sim().run_for(1s);
  rt::Scope scope(world->executor());
  scope.spawn(guard_all(dispatcher, asked, result));
  world->sim().run_until([&] { return scope.running() == 0; }, 1min);
  return result;
}

// Between the slaves' own times and formula (1) for each with the longest frames there are. Formula (2), which waits
// T_resp once for all, is less than the slaves' own times alone would be: it cannot be had by asking one by one.
TEST(Preparation, S1_30_S1_39_S1_40_GuardingThirtySlavesOneByOne) {
  const auto result = guard(conditions.slaves, conditions.slaves);
  EXPECT_EQ(result.there, 30U);
  EXPECT_LE(result.time, conditions.slaves * paper1::t_detect(paper1::bound, conditions));
  EXPECT_GE(result.time, conditions.slaves * conditions.t_resp + 30 * (44 + 3 + 52 + 3) * 20us);
  EXPECT_GT(result.time, paper1::t_detect_all(paper1::bound, conditions));
  EXPECT_LT(result.time, paper1::Printed::detect_all);
}

TEST(Preparation, S1_30_WhoIsSilentIsMissed) {
  const auto result = guard(3, 5);
  EXPECT_EQ(result.asked, 5U);
  EXPECT_EQ(result.there, 3U);
}

// S1.30: guarding is the last question of three. A device that is stopped speaks neither SDO nor, here, heartbeat: it
// is there all the same, and keeps its slot.
TEST(Preparation, S1_30_AStoppedDeviceWithoutHeartbeatKeepsItsSlot) {
  struct Guards final : can::Tap {
    void frame(const can::Frame& frame, rt::Time, int) noexcept override {
      if (!frame.extended && frame.remote && frame.id == 0x702) ++count;
    }
    unsigned count = 0;
  };
  Rig rig(five_slots(), five_slaves());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  rig.kill();
  ASSERT_EQ(rig.device("d2").device().values().write({0x1017, 0}, std::array<std::uint8_t, 2>{}), od::AbortCode{});
  rig.device("d2").device().apply(co::NmtCommand::stop);
  const Hearing<Guards> guards(rig.device("d2").bus());
  const auto before = rig.seats();
  rig.begin();
  rig.run_until([&] { return rig.network().phase() == operate::Phase::discovery; }, 60s);
  EXPECT_GT(guards.ear.count, 0U);
  EXPECT_NE(rig.state(2), places::SlotState::absent) << rig.log();
  rig.run_for(30s);
  EXPECT_EQ(rig.seats(), before) << rig.log();
}

// S1.48, S1.5: 126 slaves and the master are all node-IDs there are.
TEST(Emulation, S1_48_HundredTwentySixSlavesAndTheMaster) {
  auto machine = one_bus(500'000);
  auto plant = one_bus_plant(7);
  const TypeCode types[] = {type_a, type_b, type_c};
  for (unsigned id = 1; id <= 126; ++id) {
    add_slot(machine, id, types[id % 3]);
    add_device(plant, "d" + std::to_string(id), types[id % 3], 1000 + id * 77);
  }
  Rig rig(machine, plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(5min)) << rig.log();
  // Rule 2: of each type, the larger serial number has the larger slot.
  std::vector<std::pair<unsigned, std::uint32_t>> expected;
  for (unsigned id = 1; id <= 126; ++id) expected.emplace_back(id, 1000 + id * 77);
  EXPECT_EQ(rig.seats(), expected);
  for (const auto& truth : rig.world().truth()) EXPECT_EQ(truth.state, NmtState::operational) << truth.name;
}

}  // namespace

// Several Berths as flying masters of one bus (`[bus.NAME.flying_master]`; docs/flying-master.md): one works, the
// others stand by and send nothing, and take over what is there.
#include <gtest/gtest.h>

#include <map>

#include "tests/harness/berths.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace {

bool only_agrees(const std::map<std::uint32_t, unsigned>& frames) {
  return std::ranges::all_of(frames, [](const auto& f) { return f.first >= 0x71 && f.first <= 0x76; });
}

}  // namespace

TEST(Masters, OneWorksAndTheOtherStandsByInSilence) {
  Berths berths(five_slots(), five_slaves(), {1, 1});
  berths.begin(0);
  berths.begin(1);
  // Of one priority the lower node-ID's slot time is over first: that is 126, the second.
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(1) && berths.operational(1); })) << berths.log();
  EXPECT_FALSE(berths.leads(0));
  EXPECT_TRUE(only_agrees(berths.sent_by(0)));
  const auto master = berths.network(0).services().master;
  ASSERT_TRUE(master && master->active);
  EXPECT_EQ(master->active->node, NodeId(126));
  EXPECT_EQ(master->text(), "backbone: node 126 is the active NMT master (priority 1)");
  EXPECT_EQ(berths.network(1).services().master->text(),
            "backbone: node 126 is the active NMT master (priority 1), this Berth");
  for (const auto& slot : berths.network(0).report()) {
    EXPECT_EQ(slot.state, SlotState::unknown);
    EXPECT_EQ(slot.reason, "node 126 is the active NMT master");
  }
  berths.run_for(30s);
  EXPECT_TRUE(only_agrees(berths.sent_by(0)));
  EXPECT_EQ(berths.left_operational, 0U);
  EXPECT_EQ(berths.second_starts, 0U);
}

// The standby's slot table is empty: it knows the devices by what they are and have.
TEST(Masters, TheStandbyTakesOverADeadBerthsMachine) {
  Berths berths(five_slots(), five_slaves(), {0, 1});
  berths.begin(0);
  berths.begin(1);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(0) && berths.operational(0); })) << berths.log();
  berths.run_for(5s);
  berths.forget();
  berths.kill(0);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(1) && berths.operational(1); }, 60s)) << berths.log();
  berths.run_for(10s);
  EXPECT_EQ(berths.left_operational, 0U);
  EXPECT_EQ(berths.second_starts, 0U);
  // That for devices without a node-ID, which the dead one may have lent one, and no other.
  EXPECT_EQ(berths.commands, std::vector<std::string>{"000#82FF"});
  for (const auto& slot : berths.network(1).report()) EXPECT_EQ(slot.state, SlotState::operational) << berths.log();
}

// Whatever the dead one was in the middle of: searching, lending node-IDs, binding, storing, starting.
TEST(Masters, TakeOverAtAnyInstant) {
  for (const auto instant :
       {20ms, 150ms, 400ms, 700ms, 900ms, 1100ms, 1300ms, 1500ms, 1700ms, 2000ms, 2300ms, 3000ms}) {
    SCOPED_TRACE(std::to_string(instant / 1ms) + " ms after it became active");
    Berths berths(five_slots(), five_slaves(), {0, 1});
    berths.begin(0);
    berths.begin(1);
    ASSERT_TRUE(berths.run_until([&] { return berths.leads(0); }, 10s));
    berths.run_for(instant);
    berths.kill(0);
    ASSERT_TRUE(berths.run_until([&] { return berths.leads(1) && berths.operational(1); }, 180s)) << berths.log();
    EXPECT_TRUE(berths.world().duplicates().empty());
    EXPECT_EQ(berths.second_starts, 0U) << berths.log();
    EXPECT_EQ(berths.left_operational, 0U) << berths.log();
  }
}

TEST(Masters, ABetterOneTakesOver) {
  Berths berths(five_slots(), five_slaves(), {2, 0});
  berths.begin(0);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(0) && berths.operational(0); })) << berths.log();
  berths.begin(1);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(1) && berths.operational(1); }, 60s)) << berths.log();
  EXPECT_FALSE(berths.leads(0));
  berths.forget();
  berths.run_for(20s);
  EXPECT_TRUE(only_agrees(berths.sent_by(0))) << berths.log();
  EXPECT_EQ(berths.left_operational, 0U);
  EXPECT_EQ(berths.second_starts, 0U);
  // The former one takes it back when the better one is gone, with what its slot table knows.
  berths.kill(1);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(0) && berths.operational(0); }, 60s)) << berths.log();
  EXPECT_EQ(berths.left_operational, 0U);
  EXPECT_EQ(berths.second_starts, 0U);
}

// The dead one had told a device to store, which takes long. Its answer looks like one to the next master's own 17h.
namespace {

struct StoreEar final : can::Tap {
  explicit StoreEar(Berths& berths) : berths_(berths) { berths.world().bus("backbone")->add_tap(*this); }
  ~StoreEar() { berths_.world().bus("backbone")->remove_tap(*this); }
  void frame(const can::Frame& f, rt::Time at, int) noexcept override {
    if (f.extended || f.size == 0 || f.data[0] != 0x17) return;
    if (f.id == 0x7E5) asked.push_back(at);
    if (f.id == 0x7E4) answered.push_back(at);
  }
  std::vector<rt::Time> asked;
  std::vector<rt::Time> answered;

 private:
  Berths& berths_;
};

}  // namespace

TEST(Masters, TheNextOneStoresNothingBeforeWhatTheDeadOneToldIsStored) {
  auto machine = five_slots();
  machine.buses[0].timing.store_timeout = 20s;
  auto plant = five_slaves();
  for (auto& device : plant.devices) device.storing.time = 15s;
  Berths berths(machine, plant, {0, 1});
  StoreEar ear(berths);
  berths.begin(0);
  berths.begin(1);
  ASSERT_TRUE(berths.run_until([&] { return !ear.asked.empty(); }, 60s)) << berths.log();
  berths.kill(0);
  ASSERT_TRUE(berths.run_until([&] { return ear.asked.size() > 1; }, 120s)) << berths.log();
  ASSERT_FALSE(ear.answered.empty());
  EXPECT_GT(ear.asked[1], ear.answered[0]) << berths.log();
  EXPECT_TRUE(berths.run_until([&] { return berths.leads(1) && berths.operational(1); }, 300s)) << berths.log();
}

// A device that is exchanged while the one is active is known to the other by what it finds.
TEST(Masters, ThreeOfThemOneAfterTheOther) {
  Berths berths(five_slots(), five_slaves(), {0, 1, 2});
  for (std::size_t i = 0; i < 3; ++i) berths.begin(i);
  for (std::size_t i = 0; i < 3; ++i) {
    ASSERT_TRUE(berths.run_until([&] { return berths.leads(i) && berths.operational(i); }, 60s)) << i << berths.log();
    for (std::size_t other = i + 1; other < 3; ++other) EXPECT_TRUE(only_agrees(berths.sent_by(other)));
    berths.kill(i);
  }
  EXPECT_EQ(berths.left_operational, 0U);
  EXPECT_EQ(berths.second_starts, 0U);
}

// A device of the plant is the standby master: it keeps the devices running, and Berth gets its role back.
TEST(Masters, ADeviceStandsInForBerth) {
  auto file = five_slaves();
  auto& standby = add_device(file, "standby", {7, 7}, 1);
  standby.node_id = NodeId(100);
  standby.source = plant::NodeIdSource::hard_coded;
  standby.speaks = {};
  standby.heartbeat = 500ms;
  standby.does.master =
      plant::PlantMaster{.flying = true, .most = 5, .priority = 1, .slaves = {1, 2, 3, 4, 5}, .keep_alive = true};
  Berths berths(five_slots(), file, {0});
  berths.begin(0);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(0) && berths.operational(0); })) << berths.log();
  berths.run_for(5s);
  const auto& device = *berths.world().find("standby");
  EXPECT_EQ(device.truth().active_master, NodeId(127));
  berths.kill(0);
  ASSERT_TRUE(berths.run_until([&] { return device.truth().leads; }, 30s)) << berths.log();
  berths.run_for(10s);
  EXPECT_EQ(berths.left_operational, 0U);
  berths.begin(0);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(0) && berths.operational(0); }, 60s)) << berths.log();
  EXPECT_FALSE(device.truth().leads);
  EXPECT_EQ(device.truth().active_master, NodeId(127));
  EXPECT_EQ(berths.second_starts, 0U);
}

// A device behind a cut cable goes on as it was. Whenever the cable is mended, it is asked what it does before it is
// started: it answers questions before its next heartbeat tells that it runs.
TEST(Masters, ADeviceThatWasOutOfReachIsNotStartedAgain) {
  for (int at = 0; at < 40; ++at) {
    SCOPED_TRACE("mended " + std::to_string(50 * at) + " ms later");
    Berths berths(five_slots(), five_slaves(), {0});
    berths.begin(0);
    ASSERT_TRUE(berths.run_until([&] { return berths.leads(0) && berths.operational(0); })) << berths.log();
    berths.run_for(2s);
    berths.cut(0);
    ASSERT_TRUE(berths.run_until([&] { return !berths.network(0).operational(); }, 10s));
    berths.run_for(50ms * at);
    berths.join();
    ASSERT_TRUE(berths.run_until([&] { return berths.operational(0); }, 60s)) << berths.log();
    berths.run_for(5s);
    EXPECT_EQ(berths.second_starts, 0U) << berths.log();
    EXPECT_EQ(berths.left_operational, 0U);
  }
}

// Its NMT start was heard and its next heartbeat was not: what is not known is no reason to start it a second time.
TEST(Masters, ADeviceThatIsNotHeardBehindItsStartIsNotStartedAgain) {
  Berths berths(five_slots(), five_slaves(), {0});
  berths.begin(0);
  const auto& last = berths.world().find("d5")->device();
  ASSERT_TRUE(berths.run_until([&] { return last.state() == NmtState::operational; })) << berths.log();
  sim::Fault fault;
  fault.kind = sim::Fault::Kind::overrun;
  const std::uint32_t heartbeat = 0x700U + last.node_id().value();
  fault.trigger.when = [heartbeat](const sim::FrameStart& start) { return start.frame.key() == heartbeat; };
  fault.victims = {&berths.controller(0)};
  berths.world().bus("backbone")->inject(std::move(fault));
  ASSERT_TRUE(berths.run_until([&] { return berths.operational(0); }, 30s)) << berths.log();
  EXPECT_EQ(berths.second_starts, 0U) << berths.log();
}

// The slots' devices are watched whatever else runs: while a long search has the turn, a loss shows within the
// heartbeat time-out, a device that restarts is started again, and a person's command does not wait for the search.
#include <gtest/gtest.h>
#include <string>

#include "berth/rt/scope.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using plant::Speaks;

namespace {

// d0 speaks RAND and runs at once; the others speak plain LSS alone and are searched for among all serial numbers, on a
// slow bus.
constexpr unsigned searched_for = 40;

design::Machine slow_machine() {
  design::Machine m = one_bus(20'000);
  add_slot(m, 1, type_a);
  for (unsigned i = 0; i < searched_for; ++i) add_slot(m, 10 + i, type_b);
  return m;
}

plant::PlantFile slow_plant() {
  auto p = one_bus_plant(7);
  add_device(p, "d0", type_a, 0x0A);
  for (unsigned i = 0; i < searched_for; ++i) {
    add_device(p, "p" + std::to_string(i), type_b, 0x9E37'79B9U * (i + 1)).speaks = {plant::Speaks::lss};
  }
  return p;
}

// Returns when d0 runs and the search for the others goes on, and will for a while.
void into_the_search(Rig& rig) {
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(1) == SlotState::operational; }, 120s)) << rig.log();
  ASSERT_TRUE(rig.run_until([&] { return rig.network().phase() == operate::Phase::discovery; }, 60s)) << rig.log();
  rig.run_for(2s);
  ASSERT_EQ(rig.network().phase(), operate::Phase::discovery) << rig.log();
}

rt::Task<void> turn_of(operate::Network& network, bool& had) {
  co_await network.services().turn.take();
  const rt::Held held(network.services().turn);
  had = true;
}

rt::Task<void> stop_node(operate::Network& network, NodeId node) {
  const auto sent = co_await network.services().nmt.send(co::NmtCommand::stop, node);
  EXPECT_TRUE(sent);
}

// One device runs, and `count` others of a slow bus (a published window is too short for the slowest), which are
// searched for by the same method, are plugged in.
struct Searched {
  Searched(const std::string& method, plant::SpeaksSet speaks, unsigned count, std::uint32_t bit_rate = 20'000)
      : devices(count), rig(machine(method, count, bit_rate), plant(speaks, count)) {}

  static design::Machine machine(const std::string& method, unsigned count, std::uint32_t bit_rate) {
    design::Machine m = one_bus(bit_rate);
    m.buses[0].discovery = method;
    add_slot(m, 1, type_a);
    for (unsigned i = 0; i < count; ++i) add_slot(m, 10 + i, type_b);
    return m;
  }
  static plant::PlantFile plant(plant::SpeaksSet speaks, unsigned count) {
    auto p = one_bus_plant(7);
    add_device(p, "d0", type_a, 0x0A).speaks = speaks;
    for (unsigned i = 0; i < count; ++i) {
      auto& device = add_device(p, "p" + std::to_string(i), type_b, 0x9E37'79B9U * (i + 1));
      device.speaks = speaks;
      device.plugged = false;
    }
    return p;
  }
  [[nodiscard]] unsigned found() {
    unsigned count = 0;
    const std::string log = rig.log();
    for (auto at = log.find(" found 0"); at != std::string::npos; at = log.find(" found 0", at + 1)) ++count;
    return count;
  }
  // Into the middle of the search for the others.
  void begin() {
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return rig.state(1) == SlotState::operational; }, 60s)) << rig.log();
    for (unsigned i = 0; i < devices; ++i) rig.device("p" + std::to_string(i)).plug();
    const auto searches = [&] {
      return rig.network().phase() == operate::Phase::discovery && rig.network().services().turn.taken();
    };
    ASSERT_TRUE(rig.run_until(searches, 60s)) << rig.log();
    rig.run_for(400ms);
    ASSERT_EQ(rig.network().phase(), operate::Phase::discovery) << rig.log();
  }
  // A command has its turn, and the search then finds the rest.
  void interrupt() {
    ASSERT_NO_FATAL_FAILURE(begin());
    bool had = false;
    rt::Scope scope(rig.world().executor());
    scope.spawn(turn_of(rig.network(), had));
    ASSERT_TRUE(rig.run_until([&] { return had; }, 4s)) << "it waited for the search\n" << rig.log();
    EXPECT_LT(found(), devices + 1) << "the search was over before\n" << rig.log();
    bool rested = false;
    for (rt::Duration time{0}; time < 600s && !rested && found() < devices + 1; time += 100ms) {
      rig.run_for(100ms);
      rested = rig.idle();
    }
    EXPECT_FALSE(rested && found() < devices + 1) << "the others waited for the next look\n" << rig.log();
    ASSERT_TRUE(rig.until_operational(600s)) << rig.log();
    EXPECT_EQ(found(), devices + 1) << "each once\n" << rig.log();
  }

  unsigned devices;
  Rig rig;
};

}  // namespace

TEST(Supervision, ALossShowsWhileASearchHasTheTurn) {
  Rig rig(slow_machine(), slow_plant());
  ASSERT_NO_FATAL_FAILURE(into_the_search(rig));
  const auto timeout = rig.network().bus().timing.heartbeat_timeout;
  rig.device("d0").unplug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(1) == SlotState::absent; }, timeout + 500ms)) << rig.log();
  EXPECT_EQ(rig.network().phase(), operate::Phase::discovery) << "it was told beside the search";
}

TEST(Supervision, ADeviceThatRestartsIsStartedAgainBeforeTheSearchIsOver) {
  Rig rig(slow_machine(), slow_plant());
  ASSERT_NO_FATAL_FAILURE(into_the_search(rig));
  rig.device("d0").power(false);
  rig.run_for(200ms);
  rig.device("d0").power(true);
  ASSERT_TRUE(rig.run_until([&] { return rig.state(1) == SlotState::present; }, 3s)) << rig.log();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(1) == SlotState::operational; }, 8s)) << rig.log();
  EXPECT_FALSE(rig.operational()) << "the search was over before";
}

TEST(Supervision, AStateShowsWhileASearchHasTheTurn) {
  Rig rig(slow_machine(), slow_plant());
  ASSERT_NO_FATAL_FAILURE(into_the_search(rig));
  rig.network().commanded(co::NmtCommand::stop, NodeId(1));
  rt::Scope scope(rig.world().executor());
  scope.spawn(stop_node(rig.network(), NodeId(1)));
  const auto period = rig.network().bus().timing.heartbeat_period;
  ASSERT_TRUE(rig.run_until([&] { return rig.state(1) == SlotState::present; }, 2 * period)) << rig.log();
  EXPECT_NE(rig.log().find("NMT stopped by command"), std::string::npos);
}

TEST(Supervision, ACommandWaitsForAnExchangeAndNotForASearch) {
  Rig rig(slow_machine(), slow_plant());
  ASSERT_NO_FATAL_FAILURE(into_the_search(rig));
  bool had = false;
  rt::Scope scope(rig.world().executor());
  scope.spawn(turn_of(rig.network(), had));
  ASSERT_TRUE(rig.run_until([&] { return had; }, 8s)) << rig.log();
  EXPECT_FALSE(rig.operational()) << "the search was over before";
}

// A device that boots every second does not hold the search up for ever.
TEST(Supervision, ADeviceThatBootsAgainAndAgainDoesNotEndTheSearch) {
  Rig rig(slow_machine(), slow_plant());
  ASSERT_NO_FATAL_FAILURE(into_the_search(rig));
  const auto others = [&] {
    unsigned running = 0;
    for (unsigned i = 0; i < searched_for; ++i) running += rig.state(10 + i) == SlotState::operational ? 1U : 0U;
    return running == searched_for;
  };
  for (unsigned i = 0; i < 600 && !others(); ++i) {
    rig.device("d0").power(false);
    rig.run_for(100ms);
    rig.device("d0").power(true);
    rig.run_for(900ms);  // a report at each event would be most of the time
  }
  EXPECT_TRUE(others()) << rig.log();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
}

// By each method: what it found before it was broken off is kept, and it finds the others afterwards.
TEST(Supervision, ASearchByRandIsBrokenOffAndGoesOn) { Searched("auto", {Speaks::lss, Speaks::rand}, 80).interrupt(); }
TEST(Supervision, ASearchByThePlannerOfRandIsBrokenOffAndGoesOn) {
  Searched("planner-rand", {Speaks::lss, Speaks::rand}, 80).interrupt();
}
TEST(Supervision, ASearchByResumeIsBrokenOffAndGoesOn) {
  Searched("auto", {Speaks::lss, Speaks::rand_resume}, 80).interrupt();
}
TEST(Supervision, ASearchByRandAsPublishedIsBrokenOffAndGoesOn) {
  Searched("rand", {Speaks::lss, Speaks::rand}, 40).interrupt();
}
TEST(Supervision, ASearchByAndIsBrokenOffAndGoesOn) {
  Searched("and", {Speaks::lss, Speaks::and_protocol}, 30).interrupt();
}
TEST(Supervision, ASearchByFastscanIsBrokenOffAndGoesOn) { Searched("auto", {Speaks::fastscan}, 20).interrupt(); }
TEST(Supervision, ASearchByThePlannerOfFastscanIsBrokenOffAndGoesOn) {
  Searched("planner-fastscan", {Speaks::fastscan}, 20).interrupt();
}
TEST(Supervision, ASearchByFeedbackIsBrokenOffAndGoesOn) {
  Searched("planner-feedback", {Speaks::feedback_29}, 60).interrupt();
}
TEST(Supervision, ASearchByFastscanAsPublishedIsBrokenOffAndGoesOn) {
  Searched("fastscan", {Speaks::fastscan}, 10, 125'000).interrupt();
}
TEST(Supervision, ALossEndsASearchByRandForAWhile) {
  Searched searched("rand", {Speaks::lss, Speaks::rand}, 40);
  ASSERT_NO_FATAL_FAILURE(searched.begin());
  Rig& rig = searched.rig;
  rig.device("d0").power(false);
  rig.run_for(100ms);
  rig.device("d0").power(true);
  ASSERT_TRUE(rig.run_until([&] { return rig.state(1) == SlotState::present; }, 3s)) << rig.log();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(1) == SlotState::operational; }, 4s)) << rig.log();
  EXPECT_LT(searched.found(), searched.devices + 1) << "the search was over before";
  ASSERT_TRUE(rig.until_operational(600s)) << rig.log();
}

// A cable came off for a second, and `replacement = "auto"` had freed the slot: the device ran on, and is bound there
// again and not started a second time.
TEST(Supervision, ADeviceThatRanOnOutOfReachIsNotStartedAgain) {
  struct Starts final : can::Tap {
    void frame(const can::Frame& f, rt::Time, int) noexcept override { count += f.key() == 0 && f.data[0] == 1; }
    unsigned count = 0;
  };
  auto machine = one_bus(125'000);
  add_slot(machine, 3, type_b);
  machine.slots.back().spec.replacement = places::Replacement::automatic;
  auto plant = one_bus_plant(1);
  add_device(plant, "d", type_b, 7);
  Rig rig(machine, plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  Starts starts;
  auto& bus = *rig.world().bus("backbone");
  bus.add_tap(starts);
  std::vector<sim::Controller*> side{&rig.device("d").controller()};
  bus.split(side);
  ASSERT_TRUE(rig.run_until([&] { return rig.state(3) == SlotState::empty; }, 20s)) << rig.log();
  bus.join();
  EXPECT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(starts.count, 0U) << rig.log();
  // One that restarted meanwhile is.
  bus.split(side);
  ASSERT_TRUE(rig.run_until([&] { return rig.state(3) == SlotState::empty; }, 20s)) << rig.log();
  rig.device("d").reset();
  bus.join();
  EXPECT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(rig.device("d").truth().state, NmtState::operational);
  EXPECT_EQ(starts.count, 1U) << rig.log();
  bus.remove_tap(starts);
}

// It was asked who it is, and waits for its heartbeat to be set while another device's binding takes long: the
// heartbeat of its life before runs out meanwhile.
TEST(Supervision, ADeviceThatRebootsWhileOthersAreBoundIsNotToldAbsent) {
  auto machine = one_bus(125'000);
  add_slot(machine, 5, type_a);
  add_slot(machine, 6, type_b);
  auto plant = one_bus_plant(1);
  add_device(plant, "own", type_a, 1);
  auto& slow = add_device(plant, "slow", type_b, 1);
  slow.storing.time = 4s;
  slow.plugged = false;
  const auto begin = [](Rig& rig) {
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::operational; }, 30s)) << rig.log();
    rig.run_for(2s);
    rig.device("slow").plug();
  };
  rt::Duration until_bound{};
  {
    Rig rig(machine, plant);
    begin(rig);
    const auto plugged = rig.now();
    ASSERT_TRUE(rig.run_until([&] { return rig.state(6) == SlotState::binding; }, 60s)) << rig.log();
    until_bound = rig.now() - plugged;
  }
  for (auto before = 0ms; before < 800ms; before += 20ms) {
    if (before > until_bound) break;
    Rig rig(machine, plant);
    begin(rig);
    rig.run_for(until_bound - before);
    rig.device("own").reset();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    EXPECT_EQ(rig.log().find("s5: absent"), std::string::npos) << before.count() << " ms before" << rig.log();
  }
}

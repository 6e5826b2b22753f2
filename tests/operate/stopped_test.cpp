// Devices that are in NMT stopped when Berth begins: they answer no SDO, and their heartbeat is all that tells of them.
#include <gtest/gtest.h>

#include <string>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace {

class Stopped : public ::testing::Test {
 protected:
  explicit Stopped(bool starts = false) : rig_(machine(starts), plant()) {}

  // A person stopped the one device, and Berth was started again.
  void begin_beside_a_stopped_device() {
    rig_.begin();
    ASSERT_TRUE(rig_.until_operational(60s)) << rig_.log();
    rig_.kill();
    rig_.device("left").device().apply(co::NmtCommand::stop);
    rig_.run_for(2s);
    rig_.begin();
  }
  [[nodiscard]] std::string reason() {
    for (const auto& slot : rig_.network().report()) {
      if (slot.id == NodeId(1)) return slot.reason;
    }
    return {};
  }
  [[nodiscard]] long states_told() {
    return std::ranges::count_if(rig_.events(), [](const operate::Event& e) {
      return e.kind == operate::EventKind::state && e.slots == std::vector<std::string>{"s1"};
    });
  }

  Rig rig_;

 private:
  static design::Machine machine(bool starts) {
    design::Machine m = one_bus(125'000);
    m.buses[0].startup.starts_stopped = starts;
    add_slot(m, 1, type_b);
    add_slot(m, 2, type_b);
    return m;
  }
  static plant::PlantFile plant() {
    auto p = one_bus_plant(3);
    add_device(p, "left", type_b, 11);
    add_device(p, "right", type_b, 12);
    return p;
  }
};

class StartedWhenStopped : public Stopped {
 protected:
  StartedWhenStopped() : Stopped(true) {}
};

}  // namespace

TEST_F(Stopped, ItIsToldAsStoppedAndStaysSo) {
  begin_beside_a_stopped_device();
  ASSERT_TRUE(rig_.run_until(
      [&] { return rig_.state(1) == SlotState::present && rig_.state(2) == SlotState::operational; }, 30s))
      << rig_.log();
  EXPECT_NE(reason().find("NMT stopped; `berth nmt start 1` starts it"), std::string::npos) << reason();
  const auto told = states_told();
  rig_.run_for(300s);
  EXPECT_EQ(rig_.state(1), SlotState::present) << rig_.log();
  EXPECT_EQ(states_told(), told) << "it is not told again and again\n" << rig_.log();
  EXPECT_EQ(rig_.device("left").device().state(), NmtState::stopped);
}

TEST_F(Stopped, APersonStartsIt) {
  begin_beside_a_stopped_device();
  rig_.run_for(20s);
  bool sent = false;
  rt::Scope scope(rig_.world().executor());
  scope.spawn([](operate::Network& network, bool& into) -> rt::Task<void> {
    const auto done = co_await network.services().nmt.send(co::NmtCommand::start, NodeId(1));
    if (done) network.commanded(co::NmtCommand::start, NodeId(1));
    into = done.has_value();
  }(rig_.network(), sent));
  ASSERT_TRUE(rig_.until_operational(10s)) << rig_.log();
  EXPECT_TRUE(sent);
}

TEST_F(Stopped, ItsLossShows) {
  begin_beside_a_stopped_device();
  rig_.run_for(20s);
  ASSERT_EQ(rig_.state(1), SlotState::present) << rig_.log();
  rig_.device("left").power(false);
  EXPECT_TRUE(rig_.run_until([&] { return rig_.state(1) == SlotState::absent; }, 10s)) << rig_.log();
  rig_.device("left").power(true);
  EXPECT_TRUE(rig_.until_operational(20s)) << rig_.log();
}

// It booted while it was stopped, or another came: its boot-up message says so.
TEST_F(Stopped, ItsBootUpIsActedOn) {
  begin_beside_a_stopped_device();
  rig_.run_for(20s);
  rig_.device("left").device().apply(co::NmtCommand::reset_node);
  EXPECT_TRUE(rig_.until_operational(20s)) << rig_.log();
}

TEST_F(StartedWhenStopped, TheMachineFileMaySayThatItIsStarted) {
  begin_beside_a_stopped_device();
  EXPECT_TRUE(rig_.until_operational(30s)) << rig_.log();
}

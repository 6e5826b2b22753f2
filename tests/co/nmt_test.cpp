// NMT: slave state machine and master (docs/protocols/cia301.md §NMT; HC2.8, HC2.10).
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "berth/co/nmt_master.hpp"
#include "berth/co/nmt_slave.hpp"
#include "wire.hpp"

using namespace berth;
using namespace berth::test;
using co::NmtCommand;

namespace {

struct Owner final : co::NmtSlave::Owner {
  void reset(co::NmtReset what, rt::Time) noexcept override {
    events.push_back(what == co::NmtReset::node ? "reset node" : "reset communication");
    if (id && slave != nullptr) slave->initialised(*id);
  }
  void state_changed(NmtState from, NmtState to, rt::Time) noexcept override {
    events.push_back(std::string(name(from)) + " -> " + name(to));
  }
  co::NmtSlave* slave = nullptr;
  std::optional<NodeId> id;
  std::vector<std::string> events;
};

struct NmtSlaveTest : ::testing::Test, Bench {
  NmtSlaveTest() { owner.slave = &slave; }
  void boot() {
    owner.id = NodeId(5);
    slave.power_on();
    run(10ms);
    owner.events.clear();
    wire.log.clear();
  }
  NmtState after(const char* frame) {
    master.send(frame);
    run(10ms);
    return slave.state();
  }
  Station device{wire};
  Peer master{wire, can::all_base};
  Owner owner;
  co::NmtSlave slave{device.dispatcher, owner};
};

TEST_F(NmtSlaveTest, A4_1_BootsWithOneBootUpMessageIntoPreOperational) {
  owner.id = NodeId(5);
  slave.power_on();
  run(1s);
  EXPECT_EQ(wire.log, (Log{"705#00"}));
  EXPECT_EQ(slave.state(), NmtState::pre_operational);
  EXPECT_EQ(owner.events,
            (Log{"reset node", std::string(name(NmtState::initialising)) + " -> " + name(NmtState::pre_operational)}));
}

// HU.5: an unconfigured node waits, and leaves the initial state as soon as it gets an id.
TEST_F(NmtSlaveTest, A3_6_UnconfiguredStaysInInitialisingWithoutBootUp) {
  owner.id = NodeId();
  slave.power_on();
  run(1s);
  EXPECT_TRUE(wire.log.empty());
  EXPECT_EQ(slave.state(), NmtState::initialising);
  EXPECT_EQ(after("000#0100"), NmtState::initialising);
  EXPECT_EQ(after("000#01FF"), NmtState::initialising);
  wire.log.clear();
  slave.initialised(NodeId(9));
  run(1s);
  EXPECT_EQ(wire.log, (Log{"709#00"}));
  EXPECT_EQ(slave.state(), NmtState::pre_operational);
}

TEST_F(NmtSlaveTest, A3_2_EveryCommandFromEveryState) {
  boot();
  const std::map<std::string, NmtState> commands{{"01", NmtState::operational},
                                                 {"02", NmtState::stopped},
                                                 {"80", NmtState::pre_operational},
                                                 {"81", NmtState::pre_operational},
                                                 {"82", NmtState::pre_operational}};
  for (const auto& [first, from] : commands) {
    for (const auto& [second, to] : commands) {
      for (const char* target : {"00", "05"}) {
        ASSERT_EQ(after(("000#" + first + target).c_str()), from) << first;
        ASSERT_EQ(after(("000#" + second + target).c_str()), to) << first << " then " << second;
      }
    }
  }
}

TEST_F(NmtSlaveTest, HC2_8_ResetNodeAndResetCommunicationDiffer) {
  boot();
  after("000#8205");
  ASSERT_EQ(owner.events.size(), 3U);
  EXPECT_EQ(owner.events[1], "reset communication");
  EXPECT_EQ(wire.log, (Log{"000#8205", "705#00"}));
  owner.events.clear();
  after("000#8105");
  ASSERT_EQ(owner.events.size(), 3U);
  EXPECT_EQ(owner.events[1], "reset node");
}

TEST_F(NmtSlaveTest, A3_1_OtherNodesWrongLengthsRemoteAndUnknownAreNotHeard) {
  boot();
  for (const char* frame : {"000#0106", "000#01", "000#010500", "000#", "000#R2", "000#0305", "000#8305", "000#0185",
                            "000#01FF", "00000000#0105", "001#0105"}) {
    ASSERT_EQ(after(frame), NmtState::pre_operational) << frame;
  }
  EXPECT_TRUE(owner.events.empty());
}

RC_GTEST_PROP(NmtSlaveProperty, RandomFramesNeverBreakIt, (std::vector<std::array<std::uint8_t, 3>> frames)) {
  Bench b;
  Station device(b.wire);
  Owner owner;
  co::NmtSlave slave(device.dispatcher, owner);
  owner.slave = &slave;
  owner.id = NodeId(5);
  slave.power_on();
  Station master(b.wire);
  for (const auto& f : frames) {
    master.dispatcher.send(can::Frame::base(0, std::span(f).first(f[2] % 4)));
    b.run(1ms);
    RC_ASSERT(slave.state() != NmtState::initialising);
  }
  master.send("000#0105");
  b.run(1ms);
  RC_ASSERT(slave.state() == NmtState::operational);
}

// HU.18: the boot-up message is not lost to a full queue; the node does not count as booted before it is queued.
TEST_F(NmtSlaveTest, BootUpWaitsForThePort) {
  device.port.refuses = can::Queued::full;
  owner.id = NodeId(5);
  slave.power_on();
  run(50ms);
  EXPECT_EQ(slave.state(), NmtState::initialising);
  device.port.refuses = can::Queued::bus_off;
  run(50ms);
  device.port.refuses.reset();
  run(500ms);
  EXPECT_EQ(wire.log, (Log{"705#00"}));
  EXPECT_EQ(slave.state(), NmtState::pre_operational);
}

TEST_F(NmtSlaveTest, A4_8_OD_1029_ErrorBehaviour1029) {
  boot();
  const auto from = [&](NmtCommand command, std::uint8_t value) {
    slave.apply(command);
    slave.apply_error_behaviour(value);
    return slave.state();
  };
  EXPECT_EQ(from(NmtCommand::start, 0), NmtState::pre_operational);
  EXPECT_EQ(from(NmtCommand::stop, 0), NmtState::stopped);  // only if operational
  EXPECT_EQ(from(NmtCommand::start, 1), NmtState::operational);
  EXPECT_EQ(from(NmtCommand::start, 2), NmtState::stopped);
  EXPECT_EQ(from(NmtCommand::enter_pre_operational, 2), NmtState::stopped);
}

// docs/protocols/cia301.md §NMT: the table of services.
TEST(NmtServices, A3_3_AsTheTableSays) {
  using co::services_in;
  EXPECT_EQ(services_in(NmtState::initialising), (co::Services{false, false, false, false, false}));
  EXPECT_EQ(services_in(NmtState::pre_operational), (co::Services{false, true, true, true, true}));
  EXPECT_EQ(services_in(NmtState::operational), (co::Services{true, true, true, true, true}));
  EXPECT_EQ(services_in(NmtState::stopped), (co::Services{false, false, false, false, true}));
}

// docs/protocols/cia301.md §CAN-IDs: identifiers never to be configured (HC2.2).
TEST(CobIds, RestrictedIdentifiers) {
  for (const std::uint32_t id : {0x000U, 0x07FU, 0x101U, 0x180U, 0x581U, 0x5FFU, 0x601U, 0x67FU, 0x6E0U, 0x6FFU, 0x701U,
                                 0x77FU, 0x780U, 0x7FFU}) {
    EXPECT_TRUE(co::restricted(id)) << id;
  }
  for (const std::uint32_t id : {0x080U, 0x0FFU, 0x100U, 0x181U, 0x580U, 0x600U, 0x680U, 0x6DFU, 0x700U}) {
    EXPECT_FALSE(co::restricted(id)) << id;
  }
}

struct NmtMasterTest : ::testing::Test, Bench {
  Station station{wire};
  Peer slave{wire, can::only(0)};
};

TEST_F(NmtMasterTest, A3_1_FiveCommandsToOneAndToAll) {
  co::NmtMaster master(station.dispatcher);
  master.queue(NmtCommand::start, co::NmtTarget::all());
  master.queue(NmtCommand::stop, NodeId(1));
  master.queue(NmtCommand::enter_pre_operational, NodeId(127));
  master.queue(NmtCommand::reset_node, NodeId(16));
  master.queue(NmtCommand::reset_communication, co::NmtTarget::all());
  run(1s);
  EXPECT_EQ(slave.heard, (Log{"000#0100", "000#0201", "000#807F", "000#8110", "000#8200"}));
  EXPECT_EQ(master.waiting(), 0U);
}

// 102Ah: the inhibit time lies between commands.
TEST_F(NmtMasterTest, OD_102A_InhibitTime) {
  co::NmtMaster master(station.dispatcher);
  master.set_inhibit(20ms);
  for (int i = 0; i < 3; ++i) master.queue(NmtCommand::start, NodeId(3));
  run(1s);
  ASSERT_EQ(wire.times.size(), 3U);
  EXPECT_EQ(wire.times[1] - wire.times[0], 20ms + wire.frame_time);
  EXPECT_EQ(wire.times[2] - wire.times[1], 20ms + wire.frame_time);
}

TEST_F(NmtMasterTest, SendTellsWhenItWasOnTheWire) {
  co::NmtMaster master(station.dispatcher);
  run(5ms);
  auto op = master.send(NmtCommand::start, NodeId(3));
  const auto sent = await(*this, op);
  ASSERT_TRUE(sent);
  EXPECT_EQ(*sent, at(5ms) + wire.frame_time);
}

// HU.21: "never left" is told, and the commands behind it still go.
TEST_F(NmtMasterTest, NeverLeftIsBus) {
  co::NmtMaster master(station.dispatcher);
  station.port.mute = true;
  auto op = master.send(NmtCommand::start, NodeId(3));
  const auto sent = await(*this, op);
  ASSERT_FALSE(sent);
  EXPECT_EQ(sent.error().code, Errc::bus);
  EXPECT_EQ(executor.now(), at(1s));
  EXPECT_EQ(station.port.queued(), 0U);
  station.port.mute = false;
  station.port.refuses = can::Queued::bus_off;
  auto off = master.send(NmtCommand::start, NodeId(3));
  const auto refused = await(*this, off);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::bus);
  EXPECT_EQ(master.lost(), 2U);
  station.port.refuses = can::Queued::full;
  master.queue(NmtCommand::stop, NodeId(4));
  run(20ms);
  station.port.refuses.reset();
  run(20ms);
  EXPECT_EQ(slave.heard, (Log{"000#0204"}));
}

TEST_F(NmtMasterTest, UnconfiguredTargetIsRefused) {
  co::NmtMaster master(station.dispatcher);
  auto op = master.send(NmtCommand::start, NodeId());
  EXPECT_EQ(await(*this, op).error().code, Errc::invalid);
  master.queue(NmtCommand::start, NodeId());
  run(1s);
  EXPECT_TRUE(wire.log.empty());
}

TEST_F(NmtMasterTest, DestroyingASendCancelsItAndTheOthersGoOn) {
  co::NmtMaster master(station.dispatcher);
  Flag flag;
  {
    auto first = master.send(NmtCommand::start, NodeId(1));
    auto second = master.send(NmtCommand::start, NodeId(2));
    first.begin(executor, flag);
    second.begin(executor, flag);
    master.queue(NmtCommand::start, NodeId(3));
    executor.advance(executor.now());  // the first is in the port's queue now
    EXPECT_EQ(station.port.queued(), 1U);
  }
  run(1s);
  EXPECT_EQ(slave.heard, (Log{"000#0103"}));
  EXPECT_FALSE(flag.set);
}

TEST_F(NmtMasterTest, DestroyingTheMasterEndsWaiters) {
  std::optional<co::NmtMaster> master(std::in_place, station.dispatcher);
  Flag flag;
  auto op = master->send(NmtCommand::start, NodeId(1));
  op.begin(executor, flag);
  master.reset();
  run(1s);
  EXPECT_TRUE(flag.set);
  EXPECT_EQ(op.await_resume().error().code, Errc::cancelled);
}

}  // namespace

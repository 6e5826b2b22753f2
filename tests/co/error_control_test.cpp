// Heartbeat and guarding (docs/protocols/cia301.md §Error control; HC2.6, HC2.7, HU.23, HU.24).
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/co/guarding.hpp"
#include "berth/co/heartbeat.hpp"
#include "wire.hpp"

using namespace berth;
using namespace berth::test;

namespace {

struct Observer final : co::HeartbeatConsumer::Observer, co::GuardingMaster::Observer, co::GuardingSlave::Observer {
  void heartbeat(const co::HeartbeatEvent& e, rt::Time t) noexcept override {
    add(std::to_string(e.node.value()) + " " + name(e.kind) + " " + name(e.state), t);
    if (!e.supervised) log.back() += " (unsupervised)";
  }
  void guarding(const co::GuardingEvent& e, rt::Time t) noexcept override {
    add(std::to_string(e.node.value()) + " " + name(e.kind) + " " + name(e.state), t);
  }
  void life_guarding(bool lost, rt::Time t) noexcept override { add(lost ? "lost" : "resolved", t); }
  void add(std::string text, rt::Time t) {
    log.push_back(std::move(text));
    times.push_back(t);
  }
  Log take() { return std::exchange(log, {}); }
  Log log;
  std::vector<rt::Time> times;
};

std::string event(int node, const char* kind, NmtState state) {
  return std::to_string(node) + " " + kind + " " + name(state);
}
constexpr auto pre = NmtState::pre_operational, op = NmtState::operational, stopped = NmtState::stopped,
               init = NmtState::initialising;

struct Heartbeats : ::testing::Test, Bench {
  Station station{wire};
  Station other{wire};
  Observer observer;
  co::HeartbeatConsumer consumer{station.dispatcher, observer};
  void beat(const char* text) {
    other.send(text);
    run(1ms);
  }
};

// docs/protocols/cia301.md §Error control: the first heartbeat one period after the boot-up, then every period, with
// the state of the moment.
TEST_F(Heartbeats, A4_2_OD_1017_ProducerTiming) {
  co::HeartbeatProducer producer(other.dispatcher);
  producer.set_period(100ms);
  run(50ms);
  producer.start(NodeId(5));
  run(99ms);
  EXPECT_TRUE(wire.log.empty());
  run(101ms);
  producer.set_state(op);
  run(105ms);
  ASSERT_EQ(wire.log, (Log{"705#7F", "705#7F", "705#05"}));
  EXPECT_EQ(wire.times[0], at(150ms) + wire.frame_time);
  EXPECT_EQ(wire.times[2], at(350ms) + wire.frame_time);
  producer.set_period(0ms);
  run(1s);
  EXPECT_EQ(wire.log.size(), 3U);
  EXPECT_FALSE(producer.active());
  producer.set_period(10ms);  // 1017h written non-zero: the period starts
  run(11ms);
  EXPECT_EQ(wire.log.size(), 4U);
  producer.stop();
  run(1s);
  EXPECT_EQ(wire.log.size(), 4U);
}

TEST_F(Heartbeats, ProducerNeverFillsTheQueue) {
  co::HeartbeatProducer producer(other.dispatcher);
  other.port.mute = true;
  producer.set_period(10ms);
  producer.start(NodeId(5));
  run(1s);
  EXPECT_EQ(other.port.queued(), 1U);
  producer.set_state(stopped);
  run(20ms);
  other.port.mute = false;
  wire.wake();
  run(5ms);
  EXPECT_EQ(wire.log, (Log{"705#04"}));
}

// Supervision starts with the first heartbeat, not with the entry and not with the boot-up message.
TEST_F(Heartbeats, A4_3_HC2_6_ConsumerStartsWithTheFirstHeartbeat) {
  EXPECT_EQ(consumer.set_entry(1, 0x00050000 | 100), od::AbortCode::none);
  run(10s);
  EXPECT_TRUE(observer.log.empty());
  beat("705#00");
  run(10s);
  EXPECT_EQ(observer.take(), (Log{event(5, "boot-up", init)}));
  EXPECT_FALSE(consumer.state(NodeId(5)));
  beat("705#7F");
  EXPECT_EQ(observer.take(), (Log{event(5, "started", pre)}));
  EXPECT_EQ(consumer.state(NodeId(5)), pre);
  run(98ms);
  EXPECT_TRUE(observer.log.empty());
  run(3ms);
  EXPECT_EQ(observer.take(), (Log{event(5, "lost", pre)}));
  EXPECT_TRUE(consumer.lost(NodeId(5)));
  EXPECT_FALSE(consumer.state(NodeId(5)));
  run(10s);
  EXPECT_TRUE(observer.log.empty()) << "lost is told once";
  beat("705#05");
  EXPECT_EQ(observer.take(), (Log{event(5, "recovered", op)}));
  EXPECT_FALSE(consumer.lost(NodeId(5)));
}

TEST_F(Heartbeats, A4_3_LostExactlyAfterTheTimeSinceTheLastOne) {
  consumer.supervise(NodeId(5), 100ms);
  beat("705#05");
  run(59ms);
  beat("705#05");
  const auto last = wire.times.back();
  run(1s);
  EXPECT_EQ(observer.take(), (Log{event(5, "started", op), event(5, "lost", op)}));
  EXPECT_EQ(observer.times.back(), last + 100ms);
}

TEST_F(Heartbeats, AShortTimeIsKeptBesideALongOne) {
  consumer.supervise(NodeId(5), 1000ms);
  consumer.supervise(NodeId(6), 50ms);
  beat("705#05");
  beat("706#05");
  const auto last = wire.times.back();
  observer.take();
  observer.times.clear();
  run(500ms);
  EXPECT_EQ(observer.take(), (Log{event(6, "lost", op)}));
  EXPECT_EQ(observer.times.front(), last + 50ms);
}

TEST_F(Heartbeats, StateChangesAndTheReservedBit) {
  consumer.supervise(NodeId(5), 100ms);
  for (const char* f : {"705#7F", "705#7F", "705#FF", "705#05", "705#85", "705#04"}) beat(f);
  EXPECT_EQ(observer.take(),
            (Log{event(5, "started", pre), event(5, "state changed", op), event(5, "state changed", stopped)}));
}

TEST_F(Heartbeats, HC2_6_BootUpOfASupervisedNodeIsARemoteReset) {
  consumer.supervise(NodeId(5), 100ms);
  beat("705#05");
  beat("705#00");
  EXPECT_EQ(observer.take(), (Log{event(5, "started", op), event(5, "boot-up", init)}));
  run(1s);
  EXPECT_TRUE(observer.log.empty()) << "after a reset supervision waits for a heartbeat";
  beat("705#7F");
  EXPECT_EQ(observer.take(), (Log{event(5, "started", pre)}));
}

// Lost, reset, back: recovered (CN#631: the alarm must end).
TEST_F(Heartbeats, RecoversThroughABootUp) {
  consumer.supervise(NodeId(5), 100ms);
  beat("705#05");
  run(200ms);
  beat("705#00");
  EXPECT_TRUE(consumer.lost(NodeId(5)));
  beat("705#7F");
  EXPECT_EQ(observer.take(), (Log{event(5, "started", op), event(5, "lost", op), event(5, "boot-up", init),
                                  event(5, "recovered", pre)}));
  EXPECT_FALSE(consumer.lost(NodeId(5)));
}

// HU.24: a node that was never seen is told apart, once, when asked for.
TEST_F(Heartbeats, HC2_6_HU_24_NeverSeenIsAnEventOfItsOwn) {
  consumer.set_never_seen_time(500ms);
  consumer.supervise(NodeId(5), 100ms);
  run(499ms);
  EXPECT_TRUE(observer.log.empty());
  run(10s);
  EXPECT_EQ(observer.take(), (Log{event(5, "never seen", init)}));
  EXPECT_FALSE(consumer.lost(NodeId(5)));
  beat("705#05");
  EXPECT_EQ(observer.take(), (Log{event(5, "started", op)}));
  beat("705#00");  // and after a boot-up too
  run(1s);
  EXPECT_EQ(observer.take(), (Log{event(5, "boot-up", init), event(5, "never seen", init)}));
}

// A first heartbeat comes no sooner than its time.
TEST_F(Heartbeats, NeverSeenWaitsAsLongAsTheHeartbeatTime) {
  consumer.set_never_seen_time(500ms);
  consumer.supervise(NodeId(5), 3s);
  run(2999ms);
  EXPECT_TRUE(observer.log.empty());
  run(2ms);
  EXPECT_EQ(observer.take(), (Log{event(5, "never seen", init)}));
}

// 1016h: two active entries for one node are refused with 0604 0043; unused forms; reserved bits.
TEST_F(Heartbeats, HC2_6_OD_1016_EntriesOf1016) {
  using od::AbortCode;
  EXPECT_EQ(consumer.set_entry(1, 0x00050064), AbortCode::none);
  EXPECT_EQ(consumer.set_entry(2, 0x00050064), AbortCode::parameter_incompatible);
  EXPECT_EQ(static_cast<std::uint32_t>(AbortCode::parameter_incompatible), 0x06040043U);
  EXPECT_EQ(consumer.entry(2), 0U);
  EXPECT_EQ(consumer.set_entry(2, 0x00050000), AbortCode::none) << "time 0 is an unused entry";
  EXPECT_EQ(consumer.set_entry(3, 0x00000064), AbortCode::none);
  EXPECT_EQ(consumer.set_entry(4, 0x00800064), AbortCode::none) << "node-ID above 127";
  EXPECT_EQ(consumer.set_entry(5, 0x01060064), AbortCode::invalid_value);
  EXPECT_EQ(consumer.set_entry(0, 0x00060064), AbortCode::no_sub_index);
  EXPECT_EQ(consumer.set_entry(128, 0x00060064), AbortCode::no_sub_index);
  EXPECT_EQ(consumer.set_entry(1, 0x000500C8), AbortCode::none) << "the same node in its own entry";
  EXPECT_TRUE(consumer.supervised(NodeId(5)));
  EXPECT_EQ(consumer.set_entry(1, 0x00060064), AbortCode::none);
  EXPECT_FALSE(consumer.supervised(NodeId(5)));
  EXPECT_EQ(consumer.set_entry(2, 0x00050064), AbortCode::none) << "free again";
  EXPECT_EQ(consumer.set_entry(2, 0), AbortCode::none);
  EXPECT_FALSE(consumer.supervised(NodeId(5)));
}

// Writing the value again begins supervision anew, once.
TEST_F(Heartbeats, HC2_6_RewritingAnEntryStartsOnce) {
  consumer.set_entry(1, 0x00050064);
  beat("705#05");
  consumer.set_entry(1, 0x00050064);
  run(1s);
  EXPECT_EQ(observer.take(), (Log{event(5, "started", op)})) << "no loss: it waits for a first heartbeat";
  beat("705#05");
  EXPECT_EQ(observer.take(), (Log{event(5, "started", op)}));
}

TEST_F(Heartbeats, MalformedFramesDoNotCount) {
  consumer.supervise(NodeId(5), 100ms);
  for (const char* f : {"705#R1", "705#", "705#0505", "705#03", "706#05", "00000705#05"}) beat(f);
  EXPECT_TRUE(observer.log.empty());
}

TEST_F(Heartbeats, BootUpsOfStrangersOnRequest) {
  beat("70A#00");
  EXPECT_TRUE(observer.log.empty());
  consumer.hear_all_boot_ups(true);
  beat("70A#00");
  beat("70A#05");
  EXPECT_EQ(observer.take(), (Log{event(10, "boot-up", init) + " (unsupervised)"}));
}

// 127 nodes with periods of their own; each is lost exactly once, at its own time, and CN#631/#632: "all active" only
// when all are.
TEST_F(Heartbeats, Supervises127Nodes) {
  for (unsigned id = 1; id <= 127; ++id) {
    ASSERT_EQ(consumer.set_entry(static_cast<std::uint8_t>(id), (id << 16) | (100 + id)), od::AbortCode::none);
  }
  for (unsigned id = 1; id <= 127; ++id) {
    other.dispatcher.send(can::Frame::base(0x700 + id, {0x05}));
    run(wire.frame_time);
  }
  run(1ms);
  EXPECT_TRUE(consumer.all_active());
  EXPECT_TRUE(consumer.all_operational());
  ASSERT_EQ(wire.times.size(), 127U);
  const auto heard = wire.times;
  observer.log.clear();
  observer.times.clear();
  run(10s);
  ASSERT_EQ(observer.log.size(), 127U);
  std::vector<rt::Time> expected;
  for (unsigned id = 1; id <= 127; ++id) expected.push_back(heard[id - 1] + std::chrono::milliseconds(100 + id));
  std::ranges::sort(expected);
  EXPECT_EQ(observer.times, expected);
  beat("701#05");
  EXPECT_FALSE(consumer.all_active());
  consumer.clear();
  EXPECT_TRUE(consumer.all_active());
}

// Against a model that keeps nothing but the last time: random beats, boot-ups and pauses.
RC_GTEST_PROP(HeartbeatProperty, AgreesWithAModel, (std::vector<std::pair<std::uint8_t, std::uint8_t>> script)) {
  Bench b;
  Station station(b.wire), other(b.wire);
  Observer observer;
  co::HeartbeatConsumer consumer(station.dispatcher, observer);
  struct Model {
    bool active = false, lost = false;
    rt::Time last{};
  } model[4];
  for (std::uint8_t i = 0; i < 4; ++i) consumer.supervise(NodeId(static_cast<std::uint8_t>(i + 1)), 40ms);
  for (const auto& [what, pause] : script) {
    const unsigned i = what % 4;
    const bool boot = (what & 0x80U) != 0;
    other.dispatcher.send(can::Frame::base(0x701 + i, {boot ? std::uint8_t{0} : std::uint8_t{5}}));
    b.run(1ms);
    for (auto& m : model) {
      if (m.active && b.wire.times.back() >= m.last + 40ms) m = {false, true, m.last};
    }
    model[i] = boot ? Model{false, model[i].lost, {}} : Model{true, false, b.wire.times.back()};
    b.run(std::chrono::milliseconds(pause % 64));
    for (auto& m : model) {
      if (m.active && b.executor.now() >= m.last + 40ms) m = {false, true, m.last};
    }
    for (std::uint8_t k = 0; k < 4; ++k) {
      const NodeId id(static_cast<std::uint8_t>(k + 1));
      RC_ASSERT(consumer.state(id).has_value() == model[k].active);
      RC_ASSERT(consumer.lost(id) == model[k].lost);
    }
  }
}

// ---- guarding

struct Guarding : ::testing::Test, Bench {
  Station device{wire};
  Peer master{wire, co::all_error_control};
  Observer observer;
  co::GuardingSlave slave{device.dispatcher, observer};
  std::string ask(const char* frame = "705#R1") {
    master.heard.clear();
    master.send(frame);
    run(5ms);
    return master.heard.empty() ? "" : master.heard.back();
  }
};

// docs/protocols/cia301.md §Error control: toggle 0 in the first answer after reset communication, then alternating;
// any DLC of the request.
TEST_F(Guarding, A4_4_HC2_7_SlaveTogglesFromZero) {
  slave.start(NodeId(5));
  EXPECT_EQ(ask(), "705#7F");
  EXPECT_EQ(ask("705#R0"), "705#FF");
  slave.set_state(op);
  EXPECT_EQ(ask("705#R8"), "705#05");
  EXPECT_EQ(ask(), "705#85");
  EXPECT_EQ(ask(), "705#05");
  slave.start(NodeId(5));  // reset communication
  EXPECT_EQ(ask(), "705#7F");
  slave.stop();
  EXPECT_EQ(ask(), "");
}

TEST_F(Guarding, A4_5_HC2_7_HeartbeatWins) {
  slave.set_life_time(100ms, 3);
  slave.start(NodeId(5));
  EXPECT_EQ(ask(), "705#7F");
  slave.set_heartbeat_active(true);
  EXPECT_EQ(ask(), "");
  run(10s);
  EXPECT_TRUE(observer.log.empty());
}

// Life time = 100Ch x 100Dh, from the first remote frame on.
TEST_F(Guarding, A4_4_HC2_7_OD_100C_OD_100D_LifeGuardingStartsAtTheFirstRequest) {
  slave.set_life_time(100ms, 3);
  slave.start(NodeId(5));
  run(10s);
  EXPECT_TRUE(observer.log.empty());
  ask();
  const auto asked = wire.times[0];
  run(10s);
  EXPECT_EQ(observer.take(), (Log{"lost"}));
  EXPECT_EQ(observer.times.back(), asked + 300ms);
  ask();
  EXPECT_EQ(observer.take(), (Log{"resolved"}));
  slave.set_life_time(100ms, 0);
  run(10s);
  slave.set_life_time(0ms, 3);
  run(10s);
  EXPECT_TRUE(observer.log.empty()) << "a factor or time of 0 switches it off";
}

TEST_F(Guarding, A4_7_MasterSupervisesASlave) {
  slave.start(NodeId(5));
  Station station(wire);
  co::GuardingMaster guards(station.dispatcher, observer);
  guards.guard(NodeId(5), 100ms, 3);
  run(1050ms);
  EXPECT_EQ(observer.take(), (Log{event(5, "started", pre)}));
  EXPECT_EQ(guards.state(NodeId(5)), pre);
  slave.set_state(op);
  run(100ms);
  EXPECT_EQ(observer.take(), (Log{event(5, "state changed", op)}));
  slave.stop();
  run(300ms);
  EXPECT_TRUE(observer.log.empty()) << "two missed of three";
  run(100ms);
  EXPECT_EQ(observer.take(), (Log{event(5, "lost", op)}));
  EXPECT_FALSE(guards.state(NodeId(5)));
  run(2s);
  EXPECT_TRUE(observer.log.empty());
  slave.start(NodeId(5));
  device.send("705#00");
  run(300ms);
  EXPECT_EQ(observer.take(), (Log{event(5, "boot-up", init), event(5, "recovered", pre)}));
  guards.end(NodeId(5));
  wire.log.clear();
  run(1s);
  EXPECT_TRUE(wire.log.empty());
}

TEST_F(Guarding, A4_7_MasterFindsAWrongToggle) {
  Peer stuck(wire, can::only(0x705), [](Peer& self, const can::Frame& f) {
    if (f.remote) self.send("705#05");
  });
  Station station(wire);
  co::GuardingMaster guards(station.dispatcher, observer);
  guards.guard(NodeId(5), 100ms, 3);
  run(550ms);
  // Six answers alike: the first is taken, then every one repeats the bit.
  ASSERT_EQ(observer.log.size(), 7U);
  EXPECT_EQ(observer.log[0], event(5, "started", op));
  EXPECT_EQ(std::ranges::count(observer.log, event(5, "toggle error", op)), 5);
  EXPECT_EQ(std::ranges::count(observer.log, event(5, "lost", op)), 1) << "a wrong toggle is no answer";
}

TEST_F(Guarding, MasterAcceptsAnyFirstToggleAndZeroAfterABootUp) {
  slave.start(NodeId(5));
  ask();  // now the slave would answer with toggle 1
  Station station(wire);
  co::GuardingMaster guards(station.dispatcher, observer);
  guards.guard(NodeId(5), 100ms, 1);
  run(150ms);
  EXPECT_EQ(observer.take(), (Log{event(5, "started", pre)}));
  slave.start(NodeId(5));
  device.send("705#00");
  run(200ms);
  EXPECT_EQ(observer.take(), (Log{event(5, "boot-up", init), event(5, "started", pre)}));
}

// S1.30: one question per node; a node that does not answer is asked again before it counts as absent.
TEST_F(Guarding, S1_30_ProbeFindsPresentAndAbsent) {
  slave.start(NodeId(5));
  Station station(wire);
  {
    auto there = co::guard_once(station.dispatcher, NodeId(5), 20ms, 3);
    const auto answer = await(*this, there);
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->state, pre);
    EXPECT_FALSE(answer->toggle);
  }
  wire.log.clear();
  auto absent = co::guard_once(station.dispatcher, NodeId(6), 20ms, 3);
  const auto begun = executor.now();
  const auto answer = await(*this, absent);
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, Errc::timeout);
  EXPECT_EQ(answer.error().node, 6);
  EXPECT_EQ(wire.log, (Log{"706#R1", "706#R1", "706#R1"}));
  EXPECT_GE(executor.now() - begun, 60ms);
}

TEST_F(Guarding, S1_30_ProbeSurvivesOneLostAnswer) {
  slave.start(NodeId(5));
  Station station(wire);
  int lost = 0;
  wire.lose = [&](const can::Frame& f) { return !f.remote && lost++ == 0; };
  auto op5 = co::guard_once(station.dispatcher, NodeId(5), 20ms, 3);
  EXPECT_TRUE(await(*this, op5));
  EXPECT_EQ(lost, 2);
}

// HU.21: silence of the node and of one's own port are two things; the window starts on the wire.
TEST_F(Guarding, ProbeTellsBusFromSilence) {
  slave.start(NodeId(5));
  Station station(wire);
  station.port.mute = true;
  auto never = co::guard_once(station.dispatcher, NodeId(5), 20ms, 3);
  EXPECT_EQ(await(*this, never).error().code, Errc::bus);
  EXPECT_EQ(station.port.queued(), 0U);
  station.port.mute = false;
  station.port.refuses = can::Queued::bus_off;
  auto off = co::guard_once(station.dispatcher, NodeId(5), 20ms, 3);
  EXPECT_EQ(await(*this, off).error().code, Errc::bus);
  station.port.refuses.reset();
  auto invalid = co::guard_once(station.dispatcher, NodeId(), 20ms, 3);
  EXPECT_EQ(await(*this, invalid).error().code, Errc::invalid);
  auto good = co::guard_once(station.dispatcher, NodeId(5), 20ms, 3);
  EXPECT_TRUE(await(*this, good));
}

}  // namespace

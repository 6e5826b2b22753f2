// What the doctor concludes from what it heard: frames written by hand, at times written by hand.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/doctor/diagnose.hpp"
#include "berth/doctor/questions.hpp"
#include "berth/lss/frames.hpp"
#include "berth/rt/scope.hpp"
#include "berth/sim/world.hpp"

namespace berth::doctor {
namespace {

using namespace std::chrono_literals;
using can::Frame;

std::string words(const std::vector<Diagnosis>& all) {
  std::string text;
  for (const auto& d : all) {
    text += std::string(name(d.kind)) + " " + name(d.certainty);
    if (d.node.configured()) text += " " + std::to_string(d.node.value());
    text += "; ";
  }
  return text;
}

/// A bus of 500 kbit/s, somebody who says what the test wants, a second node that acknowledges, and the doctor.
class Doctor : public ::testing::Test {
 protected:
  void at(rt::Duration when, const Frame& frame) {
    world_.at(rt::Time(when), [this, frame] { EXPECT_EQ(voice_->send(frame, 0), can::Queued::yes); });
  }
  void beats(unsigned node, rt::Duration first, rt::Duration period, rt::Duration until, unsigned state = 0x05) {
    for (auto t = first; t < until; t += period) at(t, Frame::base(0x700 + node, {static_cast<std::uint8_t>(state)}));
  }
  void emcy(rt::Duration when, unsigned node, unsigned code) {
    at(when, Frame::base(0x080 + node, {static_cast<std::uint8_t>(code & 0xFFU), static_cast<std::uint8_t>(code >> 8U),
                                        0x11, 0, 0, 0, 0, 0}));
  }
  void slot(unsigned id, places::Assign assign = places::Assign::lss) {
    places::SlotSpec s;
    s.name = {"m", "bus", "s" + std::to_string(id)};
    s.id = NodeId(static_cast<std::uint8_t>(id));
    s.type = {1, id};
    s.assign = assign;
    expected_.slots.push_back(s);
    expected_.heartbeat_period = 100ms;
    expected_.heartbeat_timeout = 300ms;
    expected_.bit_rate = 500'000;
  }
  std::vector<Diagnosis> listen(rt::Duration until) {
    world_.run_until(rt::Time(until));
    return diagnose(ear_.heard(), expected_, answers_);
  }

  sim::World world_;
  sim::Bus& bus_ = world_.add_bus("bus", 500'000);
  std::unique_ptr<sim::Controller> voice_ = bus_.attach({.name = "voice", .queue_depth = 200});
  std::unique_ptr<sim::Controller> other_ = bus_.attach({.name = "other"});
  std::unique_ptr<sim::Controller> port_ = bus_.attach({.name = "doctor"});
  can::Dispatcher dispatcher_{world_.executor(), *port_};
  Ear ear_{dispatcher_};
  Expected expected_{.bit_rate = 500'000};
  Answers answers_;
};

TEST_F(Doctor, AHealthyBusHasNoFindings) {
  slot(1);
  slot(2);
  beats(1, 10ms, 100ms, 5s);
  beats(2, 37ms, 100ms, 5s);
  const auto found = listen(5s);
  EXPECT_TRUE(found.empty()) << words(found);
  EXPECT_EQ(port_->statistics().attempts, 0U) << "passive: never a frame";
}

// SX.7, S4.21: two clocks under one node-ID. 70 and 30 ms in turn are two of 100 ms; evenly spaced ones of 50 ms may be
// one device with another 1017h.
TEST_F(Doctor, S4_21_TwoRhythmsAreTwoDevices) {
  slot(2);
  beats(2, 10ms, 100ms, 5s);
  beats(2, 40ms, 100ms, 5s);
  const auto found = listen(5s);
  ASSERT_EQ(found.size(), 1U) << words(found);
  EXPECT_EQ(found[0].kind, Kind::duplicate_node_id);
  EXPECT_EQ(found[0].node, NodeId(2));
  EXPECT_EQ(found[0].certainty, Certainty::likely);
  EXPECT_EQ(found[0].slot, "s2");
  EXPECT_FALSE(found[0].evidence.empty());
  EXPECT_FALSE(found[0].advice.empty());
}

TEST_F(Doctor, TwiceAsManyEvenlySpacedAreOnlyPossiblyTwo) {
  slot(2);
  beats(2, 10ms, 50ms, 5s);
  const auto found = listen(5s);
  EXPECT_EQ(words(found), "duplicate-node-id possible 2; ");
}

TEST_F(Doctor, APeriodThatChangesOnceIsNoDuplicate) {
  beats(9, 10ms, 500ms, 3s);
  beats(9, 3100ms, 100ms, 6s);
  const auto found = listen(6s);
  EXPECT_TRUE(found.empty()) << words(found);
}

// A device tells another state when it was told to, or booted; two devices tell theirs in turn.
TEST_F(Doctor, StatesInTurnAreTwoDevices) {
  beats(3, 10ms, 200ms, 3s, 0x05);
  beats(3, 110ms, 200ms, 3s, 0x7F);
  const auto found = listen(3s);
  EXPECT_EQ(words(found), "duplicate-node-id certain 3; ");
}

TEST_F(Doctor, StatesThatWereCommandedAreNone) {
  for (unsigned i = 0; i < 20; ++i) {
    const auto start = i * 200ms;
    at(start + 10ms, Frame::base(0x703, {static_cast<std::uint8_t>(i % 2 == 0 ? 0x7F : 0x05)}));
    at(start + 150ms, Frame::base(0x000, {static_cast<std::uint8_t>(i % 2 == 0 ? 0x01 : 0x80), 3}));
  }
  const auto found = listen(4s);
  EXPECT_TRUE(found.empty()) << words(found);
}

// A boot-up in the middle of a heartbeat that goes on is another device's; a device that boots begins anew.
TEST_F(Doctor, BootUpsBesideAHeartbeat) {
  slot(4);
  beats(4, 10ms, 100ms, 3s);
  at(1060ms, Frame::base(0x704, {0}));
  at(2060ms, Frame::base(0x704, {0}));
  const auto found = listen(3s);
  EXPECT_EQ(words(found), "duplicate-node-id certain 4; ");
}

TEST_F(Doctor, ARestartIsNone) {
  slot(4);
  beats(4, 10ms, 100ms, 1s);
  at(1060ms, Frame::base(0x704, {0}));
  beats(4, 1160ms, 100ms, 3s, 0x7F);
  const auto found = listen(3s);
  EXPECT_TRUE(found.empty()) << words(found);
}

// SX.7
TEST_F(Doctor, SX_7_IdentifierCollisionsAreTold) {
  emcy(500ms, 5, 0x8150);
  const auto found = listen(1s);
  ASSERT_EQ(words(found), "identifier-collision certain 5; ");
  EXPECT_EQ(found[0].count, 1U);
}

TEST_F(Doctor, TwoSyncProducers) {
  for (auto t = 10ms; t < 3s; t += 100ms) {
    at(t, Frame::base(0x080, {}));
    at(t + 25ms, Frame::base(0x080, {}));
  }
  const auto found = listen(3s);
  ASSERT_EQ(words(found), "identifier-collision likely; ");
  EXPECT_EQ(found[0].cob_id, 0x080U);
}

TEST_F(Doctor, OneSyncProducerIsNone) {
  for (auto t = 10ms; t < 3s; t += 10ms) at(t, Frame::base(0x080, {}));
  EXPECT_TRUE(listen(3s).empty());
}

// S4.1, docs/protocols/can-frames.md §Arbitration: a coincidence of two senders leaves two different frames of one
// identifier behind 16 errors.
TEST_F(Doctor, S4_1_ACoincidenceIsTakenForWhatItIs) {
  beats(1, 10ms, 100ms, 2s);
  world_.at(rt::Time(1045ms), [this] {
    voice_->send(Frame::base(0x181, {0x55, 0x00}), 0);
    other_->send(Frame::base(0x181, {0x55, 0x01}), 0);
  });
  const auto found = listen(2s);
  const auto it = std::ranges::find(found, Kind::identifier_collision, &Diagnosis::kind);
  ASSERT_NE(it, found.end()) << words(found);
  EXPECT_EQ(it->cob_id, 0x181U);
  EXPECT_EQ(std::ranges::count(found, Kind::wrong_bit_rate, &Diagnosis::kind), 0);
}

// S4.21
TEST_F(Doctor, S4_21_BlankNodesAnswerOthersQuestions) {
  slot(1);
  slot(2);
  beats(1, 10ms, 100ms, 2s);
  at(500ms, lss::request(lss::Command::identify_non_configured));
  at(502ms, lss::answer(lss::Command::non_configured));
  const auto found = listen(2s);
  EXPECT_EQ(words(found), "blank-node certain 2; missing-heartbeat certain 2; ");
}

// A device of another type than the slot that was not heard is not that slot's, and nothing binds it there.
TEST_F(Doctor, ABlankDeviceOfAnotherTypeIsNotTheMissingSlots) {
  slot(1);
  slot(2);
  beats(1, 10ms, 100ms, 2s);
  const auto told = [&](LssAddress device) {
    answers_ = {};
    answers_.asked = answers_.blank = true;
    answers_.present.push_back({device, NodeId(), true});
    const auto found = listen(2s);
    const auto blank = std::ranges::find(found, Kind::blank_node, &Diagnosis::kind);
    EXPECT_NE(blank, found.end()) << words(found);
    return blank == found.end() ? Diagnosis{} : *blank;
  };
  const auto own = expected_.slot(NodeId(2))->type;
  const Diagnosis same = told({own.vendor, own.product, 0, 7});
  EXPECT_EQ(same.node, NodeId(2));
  EXPECT_NE(same.advice.find("`berth bind`"), std::string::npos) << same.advice;
  const Diagnosis other = told({own.vendor, own.product + 1, 0, 7});
  EXPECT_FALSE(other.node.configured());
  EXPECT_EQ(other.advice.find("`berth bind`"), std::string::npos) << other.advice;
  EXPECT_NE(
      other.advice.find(fmt::format("also = [{{ vendor = 0x{:X}, product = 0x{:X} }}]", own.vendor, own.product + 1)),
      std::string::npos)
      << other.advice;
}

// Berth takes it; others may not.
TEST_F(Doctor, ShortLssAnswersAreNamed) {
  slot(1);
  beats(1, 10ms, 100ms, 2s);
  at(500ms, lss::request32(lss::Command::select_serial, 7));
  at(502ms, lss::short_answer(lss::answer(lss::Command::selected)));
  at(510ms, lss::request(lss::Command::store));
  at(520ms, lss::answer(lss::Command::store));
  const auto found = listen(2s);
  ASSERT_EQ(found.size(), 1U) << words(found);
  EXPECT_EQ(name(found[0].kind), std::string("short-lss-answer"));
  EXPECT_EQ(found[0].count, 1U);
  EXPECT_NE(found[0].evidence.at(0).find("44h with 1 of 8 bytes"), std::string::npos) << found[0].evidence[0];
}

// 4Fh alone is an answer to identify remote slave, too, which devices with a node-ID give.
TEST_F(Doctor, AnIdentifiedDeviceIsNotBlank) {
  slot(1);
  beats(1, 10ms, 100ms, 2s);
  at(500ms, lss::request32(lss::Command::identify_serial_high, 7));
  at(502ms, lss::answer(lss::Command::identified));
  EXPECT_TRUE(listen(2s).empty());
}

// 50h is a device's without a node-ID; 4Fh to Fastscan comes from Lely core's slaves with a node-ID, too.
TEST_F(Doctor, AnAnswerToFastscanAloneIsNotCertain) {
  slot(1);
  beats(1, 10ms, 100ms, 3s);
  const Frame anybody = Frame::base(lss::master_cob_id, {0x51, 0, 0, 0, 0, 0x80, 0, 0});
  at(500ms, anybody);
  at(502ms, lss::answer(lss::Command::identified));
  EXPECT_EQ(words(listen(1s)), "blank-node likely; ");
  at(1500ms, lss::request(lss::Command::identify_non_configured));
  at(1502ms, lss::answer(lss::Command::non_configured));
  EXPECT_EQ(words(listen(3s)), "blank-node certain; ");
}

// A master asks by guarding whether a node-ID is used twice. A heartbeat of long after is no answer to that, nor is one
// of those that come all the time.
TEST_F(Doctor, HeartbeatsBesideGuardingAreOneDevice) {
  slot(1);
  slot(2);
  expected_.heartbeat_period = 500ms;
  expected_.heartbeat_timeout = 1500ms;
  beats(1, 10ms, 500ms, 5s);
  beats(2, 20ms, 30ms, 5s);
  for (const unsigned node : {1U, 2U}) {
    for (const auto when : {600ms, 1600ms, 2600ms}) at(when + node * 1ms, Frame::request(0x700 + node, 1));
  }
  const auto found = listen(5s);
  EXPECT_EQ(words(found).find("duplicate-node-id likely"), std::string::npos) << words(found);
}

// Two devices that both answer guarding do so within its time-out.
TEST_F(Doctor, TwoAnswersToEachGuardingRequestAreTwoDevices) {
  slot(1);
  for (auto when = 1s; when <= 10s; when += 1s) {
    at(when, Frame::request(0x701, 1));
    at(when + 2ms, Frame::base(0x701, {0x05}));
    at(when + 5ms, Frame::base(0x701, {0x85}));
  }
  EXPECT_NE(words(listen(11s)).find("duplicate-node-id likely 1"), std::string::npos);
}

TEST_F(Doctor, ASilentSlotMayBeBlank) {
  slot(1);
  slot(2);
  slot(3, places::Assign::fixed);
  beats(1, 10ms, 100ms, 2s);
  const auto found = listen(2s);
  EXPECT_EQ(words(found), "blank-node possible 2; missing-heartbeat certain 2; missing-heartbeat certain 3; ");
}

TEST_F(Doctor, AskedAndSilentIsNotBlank) {
  slot(1);
  slot(2);
  beats(1, 10ms, 100ms, 2s);
  answers_.asked = true;
  EXPECT_EQ(words(listen(2s)), "missing-heartbeat certain 2; ");
}

// A cable that is out is told once, and not as so many silent nodes; an answer shows that the cable is in.
TEST_F(Doctor, ABusOnWhichNothingIsSaidIsOneFinding) {
  slot(2);
  slot(3);
  const auto found = listen(2s);
  ASSERT_EQ(found.size(), 1U) << words(found);
  EXPECT_EQ(found.front().kind, Kind::silent_bus);
  EXPECT_FALSE(found.front().node.configured());
  answers_.asked = answers_.blank = true;
  EXPECT_NE(words(listen(2s)).find("blank-node certain"), std::string::npos);
}

TEST_F(Doctor, HeartbeatsThatStopOrHaveGaps) {
  slot(1);
  slot(2);
  slot(3);
  beats(1, 10ms, 100ms, 2s);
  beats(2, 20ms, 100ms, 1s);
  beats(2, 1500ms, 100ms, 2s);
  at(100ms, Frame::base(0x183, {1}));  // a PDO, and never a heartbeat
  beats(7, 30ms, 100ms, 1s);           // of no slot
  const auto found = listen(2s);
  EXPECT_EQ(words(found), "missing-heartbeat certain 2; missing-heartbeat certain 3; missing-heartbeat likely 7; ");
}

TEST_F(Doctor, AGuardedDeviceNeedsNoHeartbeat) {
  slot(1);
  for (auto t = 10ms; t < 2s; t += 100ms) {
    at(t, Frame::request(0x701, 1));
    at(t + 5ms, Frame::base(0x701, {static_cast<std::uint8_t>((t / 100ms) % 2 == 0 ? 0x05 : 0x85)}));
  }
  EXPECT_TRUE(listen(2s).empty());
}

TEST_F(Doctor, TwoAnswersToOneGuardingRequest) {
  for (auto t = 10ms; t < 2s; t += 100ms) {
    at(t, Frame::request(0x701, 1));
    at(t + 5ms, Frame::base(0x701, {0x05}));
    at(t + 7ms, Frame::base(0x701, {0x85}));
  }
  const auto found = listen(2s);
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].kind, Kind::duplicate_node_id);
}

TEST_F(Doctor, ErrorPassiveOverrunAndBusOffAreTold) {
  emcy(100ms, 4, 0x8120);
  emcy(200ms, 4, 0x8140);
  emcy(300ms, 6, 0x8110);
  const auto found = listen(1s);
  ASSERT_EQ(words(found), "error-passive certain 4; overload certain 6; ");
  EXPECT_EQ(found[0].count, 2U);
}

TEST_F(Doctor, AFullBusIsOverload) {
  // 111 to 133 bits at 500 kbit/s: one each 250 us is nine tenths of the bus.
  for (rt::Duration t = 0ms; t < 2s; t += 250us) at(t, Frame::base(0x200, {1, 2, 3, 4, 5, 6, 7, 8}));
  const auto found = listen(2s);
  ASSERT_EQ(words(found), "overload certain; ");
}

// S4.1: who is set to another bit rate is not heard, and destroys.
TEST_F(Doctor, S4_1_AJammerIsTheSlotThatIsNeverHeard) {
  slot(1);
  slot(2);
  beats(1, 10ms, 100ms, 5s);
  const auto stranger = bus_.attach({.name = "stranger", .bit_rate = 250'000});
  for (rt::Duration t = 1s; t < 5s; t += 500ms) {
    world_.at(rt::Time(t), [&stranger] {
      stranger->restart(250'000);
      stranger->send(Frame::base(0x702, {5}), 0);
    });
  }
  const auto found = listen(5s);
  const auto it = std::ranges::find(found, Kind::wrong_bit_rate, &Diagnosis::kind);
  ASSERT_NE(it, found.end()) << words(found);
  EXPECT_EQ(it->node, NodeId(2));
  EXPECT_EQ(it->certainty, Certainty::likely);
  for (const auto& d : found) {
    EXPECT_FALSE(d.kind != Kind::wrong_bit_rate && d.node == NodeId(2)) << "told once: " << words(found);
  }
}

// A few flipped bits are noise, not a device at another bit rate.
TEST_F(Doctor, NoiseIsNoJammer) {
  beats(1, 10ms, 10ms, 3s);
  bus_.faults().draw_from({.disturbed_per_million = 50'000});
  const auto found = listen(3s);
  EXPECT_EQ(std::ranges::count(found, Kind::wrong_bit_rate, &Diagnosis::kind), 0) << words(found);
  EXPECT_EQ(words(found), "disturbance possible; ");
}

TEST_F(Doctor, QuestionsProveDuplicates) {
  slot(2);
  beats(2, 10ms, 100ms, 1s);
  answers_.asked = true;
  answers_.present = {
      {{1, 2, 0, 7}, NodeId(2), true}, {{1, 2, 0, 8}, NodeId(2), true}, {{1, 2, 0, 9}, NodeId(3), true}};
  auto found = listen(1s);
  ASSERT_EQ(words(found), "duplicate-node-id certain 2; ");
  EXPECT_EQ(found[0].devices.size(), 2U);
  answers_.present.clear();
  answers_.serials = {{NodeId(2), 2, {7, 8}}};
  EXPECT_EQ(words(listen(1s)), "duplicate-node-id certain 2; ");
  answers_.serials.clear();
  answers_.claims = {{NodeId(2), 0x1800, 0x182}, {NodeId(5), 0x1801, 0x182}};
  found = listen(1s);
  ASSERT_EQ(words(found), "identifier-collision certain 5; ") << "node 2 has the better right to 182h";
  EXPECT_EQ(found[0].cob_id, 0x182U);
}

// Whatever is heard: no crash, and every finding is complete.
TEST_F(Doctor, AnyFramesGiveCompleteFindings) {
  slot(1);
  slot(2);
  Random r(7);
  for (unsigned i = 0; i < 3000; ++i) {
    Frame f;
    f.extended = r.below(8) == 0;
    f.id = static_cast<std::uint32_t>(r.below(f.extended ? can::extended_mask + 1ULL : can::base_mask + 1ULL));
    if (r.below(2) == 0) f.id = static_cast<std::uint32_t>(0x701 + r.below(4)), f.extended = false;
    f.remote = r.below(16) == 0;
    f.size = static_cast<std::uint8_t>(r.below(9));
    for (auto& b : f.data) b = static_cast<std::uint8_t>(r.below(256));
    at(1ms * i, f);
  }
  for (const auto& d : listen(4s)) {
    EXPECT_FALSE(d.what.empty());
    EXPECT_FALSE(d.evidence.empty()) << d.what;
    EXPECT_FALSE(d.advice.empty()) << d.what;
  }
}

}  // namespace
}  // namespace berth::doctor

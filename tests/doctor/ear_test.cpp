// What the doctor's ear counts, from frames and error counters that are put into a port by hand.
#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <string>

#include "berth/doctor/diagnose.hpp"
#include "berth/doctor/heard.hpp"
#include "berth/lss/frames.hpp"

namespace berth::doctor {
namespace {

using namespace std::chrono_literals;
using can::Frame;

class HandPort final : public can::Port {
 public:
  can::Queued send(const Frame&, std::uint32_t) noexcept override { return can::Queued::closed; }
  void withdraw(std::uint32_t) noexcept override {}
  void listen(can::Listener* listener, std::span<const can::IdRange>) noexcept override { listener_ = listener; }
  [[nodiscard]] can::Status status() const noexcept override {
    can::Status s;
    s.up = up;
    s.bus_off = bus_off;
    s.errors = errors;
    s.lost = lost;
    s.bit_rate = 500'000;
    s.bit_rate_is_label = label;
    s.knows_errors = knows_errors;
    return s;
  }
  bool restart(std::uint32_t) noexcept override { return true; }
  void hear(const Frame& frame, rt::Time at) { listener_->received(frame, at); }
  std::uint32_t errors = 0;
  std::uint32_t lost = 0;
  bool up = true;
  bool bus_off = false;
  bool label = false;
  bool knows_errors = true;

 private:
  can::Listener* listener_ = nullptr;
};

class EarTest : public ::testing::Test {
 protected:
  void hear(rt::Duration at, const Frame& frame) {
    executor_.advance(rt::Time(at));
    port_.hear(frame, rt::Time(at));
  }
  void beat(rt::Duration at, unsigned node, unsigned state) {
    hear(at, Frame::base(0x700 + node, {static_cast<std::uint8_t>(state)}));
  }
  rt::Executor executor_;
  HandPort port_;
  can::Dispatcher dispatcher_{executor_, port_};
  Ear ear_{dispatcher_};
};

TEST_F(EarTest, AFullSecondInAQuietMinuteIsSeen) {
  const Frame frame = Frame::base(0x181, {1, 2, 3, 4, 5, 6, 7, 8});
  for (int i = 0; i < 500; ++i) hear(100ms + i * 1ms, frame);
  const std::uint64_t bits = ear_.heard().bits;
  beat(5s, 9, 0x05);  // what is behind the second closes it
  executor_.advance(rt::Time(60s));
  EXPECT_EQ(ear_.heard().worst_bits, bits);
  EXPECT_GT(ear_.heard().worst_load(125'000), 50 * ear_.heard().load(125'000));
}

TEST_F(EarTest, ADeviceThatBootedMayComeBackInAnotherState) {
  beat(100ms, 3, 0x05);
  beat(200ms, 3, 0x00);
  beat(300ms, 3, 0x7F);
  EXPECT_EQ(ear_.heard().node(NodeId(3)).flips.count, 0U);
  beat(400ms, 3, 0x05);  // without a boot-up and without a command
  EXPECT_EQ(ear_.heard().node(NodeId(3)).flips.count, 1U);
}

// Beside a master its commands are on the bus, too, though they are never received.
TEST_F(EarTest, WhatItsOwnPortSendsIsOnTheBusToo) {
  beat(100ms, 3, 0x05);
  executor_.advance(rt::Time(150ms));
  ear_.own(Frame::base(0x000, {0x80, 3}), rt::Time(150ms));
  beat(200ms, 3, 0x7F);
  EXPECT_EQ(ear_.heard().node(NodeId(3)).flips.count, 0U) << "it was told to";
  ear_.own(Frame::base(0x000, {0x81, 3}), rt::Time(250ms));
  EXPECT_EQ(ear_.heard().node(NodeId(3)).resets.count, 1U);
  EXPECT_EQ(ear_.heard().frames, 4U);
  ear_.own(Frame::base(lss::master_cob_id, {0x04, 0, 0, 0, 0, 0, 0, 0}), rt::Time(300ms));
  EXPECT_EQ(ear_.heard().lss_requests.count, 0U) << "no other master";
  EXPECT_EQ(ear_.heard().frames, 5U);
  ear_.own(Frame::base(0x383, {1, 2, 3, 4, 5, 6, 7, 8}), rt::Time(400ms));
  EXPECT_EQ(ear_.heard().node(NodeId(3)).signs.count, 2U) << "its two heartbeats: no device sent the rest";
}

// docs/protocols/can-frames.md §Arbitration: what destroys so many attempts in a row is no noise, but a second sender
// of the identifier.
TEST_F(EarTest, OnlyALongRunOfErrorsTellsACollision) {
  const Frame one = Frame::base(0x181, {1});
  const Frame other = Frame::base(0x181, {2});
  hear(100ms, one);
  port_.errors += Heard::long_run - 1;
  hear(200ms, one);
  hear(201ms, other);
  EXPECT_TRUE(ear_.heard().collided.empty());
  hear(300ms, one);
  port_.errors += Heard::long_run;
  hear(400ms, one);
  hear(401ms, other);
  ASSERT_EQ(ear_.heard().collided.size(), 1U);
  EXPECT_EQ(ear_.heard().collided.begin()->second.count, 1U);
}

TEST_F(EarTest, TellsWhatItCouldNotHear) {
  executor_.advance(rt::Time(1s));
  EXPECT_TRUE(ear_.heard().complete());
  EXPECT_EQ(ear_.heard().listened(), 1s);
  port_.up = false;
  executor_.advance(rt::Time(2s));
  port_.up = true;
  executor_.advance(rt::Time(3s));
  EXPECT_FALSE(ear_.heard().complete());
  EXPECT_EQ(ear_.heard().down, 1s);
  EXPECT_EQ(ear_.heard().listened(), 2s);
  port_.bus_off = true;
  executor_.advance(rt::Time(4s));
  EXPECT_EQ(ear_.heard().down, 2s);
}

TEST_F(EarTest, LostFramesAreToldToo) {
  port_.lost += 3;
  beat(100ms, 3, 0x05);
  port_.lost += 2;
  EXPECT_EQ(ear_.heard().lost, 5U);
  EXPECT_FALSE(ear_.heard().complete());
}

// A port that was just opened takes a while to come up.
TEST_F(EarTest, ListensFromWhenItsPortIsUp) {
  HandPort port;
  port.up = false;
  can::Dispatcher dispatcher(executor_, port);
  Ear ear(dispatcher);
  executor_.advance(rt::Time(1s));
  EXPECT_EQ(ear.heard().listened(), 0s) << "never up";
  port.up = true;
  executor_.advance(rt::Time(3s));
  EXPECT_TRUE(ear.heard().complete());
  EXPECT_EQ(ear.heard().from, rt::Time(1s));
  EXPECT_EQ(ear.heard().listened(), 2s);
}

/// What is concluded from an ear whose port is as the test makes it, of a machine with slot 2.
class Certainties : public EarTest {
 protected:
  Certainties() {
    places::SlotSpec slot;
    slot.name = {"m", "bus", "s2"};
    slot.id = NodeId(2);
    slot.type = {1, 2};
    expected_.slots.push_back(slot);
    expected_.heartbeat_period = 100ms;
    expected_.heartbeat_timeout = 300ms;
    expected_.bit_rate = 500'000;
  }
  std::string found(rt::Duration until) {
    executor_.advance(rt::Time(until));
    std::string text;
    for (const auto& d : diagnose(ear_.heard(), expected_, answers_)) {
      text += std::string(name(d.kind)) + " " + name(d.certainty) + "; ";
    }
    return text;
  }
  Expected expected_;
  Answers answers_;
};

TEST_F(Certainties, ASilentBusIsCertainOnlyToAPortThatHearsEverything) {
  EXPECT_EQ(found(500ms), "silent-bus possible; ") << "so long may a bus be silent on which all is well";
  EXPECT_EQ(found(2s), "silent-bus certain; ");
  port_.knows_errors = false;
  EXPECT_EQ(found(3s), "silent-bus likely; ") << "at another bit rate it hears nothing either";
  port_.knows_errors = true;
  port_.up = false;
  EXPECT_EQ(found(4s), "silent-bus possible; ");
}

TEST_F(Certainties, ASilentBusThatLostFramesIsNoneForCertain) {
  port_.lost = 1;
  EXPECT_EQ(found(2s), "silent-bus possible; ");
}

TEST_F(Certainties, ABusOnWhichSomebodyAnsweredIsNotSilent) {
  answers_.asked = true;
  answers_.frames = 1;
  EXPECT_EQ(found(2s), "missing-heartbeat certain; ");
}

// Then it is not known of any slot that it is silent, either.
TEST_F(Certainties, ErrorsAndNoFrameArePerhapsThePortsOwnBitRate) {
  port_.errors = 40;
  EXPECT_EQ(found(2s), "wrong-bit-rate possible; ");
  answers_.frames = 1;
  EXPECT_NE(found(3s).find("missing-heartbeat certain"), std::string::npos);
}

// Links move PDOs: what has the identifier of TPDO 1 of node 2 may be another node's.
TEST_F(Certainties, AMovedPdoIsNoSignOfTheNodeWhoseIdentifierItHas) {
  beat(100ms, 9, 0x05);
  hear(200ms, Frame::base(0x182, {1, 2}));
  executor_.advance(rt::Time(2s));
  const auto what = [&] {
    std::string text;
    for (const auto& d : diagnose(ear_.heard(), expected_, answers_)) {
      if (d.kind == Kind::missing_heartbeat) text += d.what;
    }
    return text;
  };
  EXPECT_EQ(what(), "node 2 (s2) is there and sends no heartbeat");
  expected_.predefined_pdos = false;
  EXPECT_EQ(what(), "node 2 (s2) is silent");
}

TEST_F(Certainties, ASilentNodeIsCertainOnlyToAPortThatHearsEverything) {
  beat(100ms, 9, 0x05);
  const std::string sure = found(2s);
  EXPECT_NE(sure.find("missing-heartbeat certain"), std::string::npos) << sure;
  port_.lost = 1;
  const std::string unsure = found(3s);
  EXPECT_NE(unsure.find("missing-heartbeat likely"), std::string::npos) << unsure;
}

// A heartbeat has a gap where this port was down.
TEST_F(Certainties, AGapOfThePortIsPerhapsNoGapOfTheHeartbeat) {
  for (auto t = 100ms; t < 2s; t += 100ms) beat(t, 2, 0x05);
  EXPECT_EQ(found(2s), "");
  port_.up = false;
  executor_.advance(rt::Time(3s));
  port_.up = true;
  for (auto t = 3100ms; t < 4s; t += 100ms) beat(t, 2, 0x05);
  EXPECT_EQ(found(4s), "missing-heartbeat possible; ");
}

TEST_F(Certainties, ANodeThatAnsweredBySdoIsThereAndNotBlank) {
  beat(100ms, 9, 0x05);
  answers_.asked = answers_.intrusive = true;
  answers_.serials = {{NodeId(2), 1, {7}}};
  executor_.advance(rt::Time(2s));
  const auto all = diagnose(ear_.heard(), expected_, answers_);
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].what, "node 2 (s2) is there and sends no heartbeat");
}

TEST_F(Certainties, TwoStatesInTurnAreLikelyTwoWhereCommandsMayHaveBeenLost) {
  for (auto t = 100ms; t < 2s; t += 100ms) beat(t, 2, t / 100ms % 2 == 0 ? 0x05 : 0x7F);
  EXPECT_EQ(found(2s), "duplicate-node-id certain; ");
  port_.lost = 1;
  EXPECT_EQ(found(2100ms), "duplicate-node-id likely; ");
}

// A device that was told to reset may keep the rhythm of its heartbeat.
TEST_F(Certainties, BootUpsThatWereCommandedAreLikelyTwoDevices) {
  for (auto t = 100ms; t < 2s; t += 100ms) {
    beat(t, 2, 0x7F);
    if (t == 500ms || t == 1s) beat(t + 60ms, 2, 0x00);
  }
  EXPECT_EQ(found(2s), "duplicate-node-id certain; ");
  hear(2050ms, Frame::base(0x000, {0x82, 2}));
  EXPECT_EQ(found(2100ms), "duplicate-node-id likely; ");
}

TEST_F(Certainties, AFullBusIsLikelyWhereThePortDoesNotKnowItsBitRate) {
  const Frame frame = Frame::base(0x200, {1, 2, 3, 4, 5, 6, 7, 8});
  expected_.slots.clear();
  for (auto t = 0us; t < 2s; t += 250us) hear(t, frame);
  EXPECT_EQ(found(2s), "overload certain; ");
  port_.label = true;
  EXPECT_EQ(found(2020ms), "overload likely; ");
}

// Another LSS master asked, and may have given what it found a node-ID.
TEST_F(Certainties, ABlankDeviceMayHaveANodeIdByNow) {
  expected_.slots.clear();
  hear(100ms, lss::request(lss::Command::identify_non_configured));
  hear(102ms, lss::answer(lss::Command::non_configured));
  EXPECT_EQ(found(1s), "blank-node certain; ");
  hear(1100ms, lss::answer(lss::Command::configure_node_id));
  EXPECT_EQ(found(2s), "blank-node possible; ");
  answers_.asked = true;
  EXPECT_EQ(found(3s), "") << "and it answers no more";
}

}  // namespace
}  // namespace berth::doctor

// What a slow, forgetful or overloaded device does to time.
#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "rig.hpp"

namespace berth::device::test::timing_tests {
namespace {

Options stored(std::uint32_t serial, std::uint8_t id) {
  return {.address = address_of(serial), .node_id = NodeId(id), .bit_rate = 500'000};
}

// Time from the end of one frame to the end of the other, both on the bus once.
rt::Duration between(const Record& record, std::string_view a, std::string_view b) {
  const auto first = record.first(a);
  const auto second = record.first(b);
  return first && second ? *second - *first : rt::Duration(-1);
}

TEST(Timing, ClockDrift) {
  Timing t;
  EXPECT_EQ(t.in_world(seconds(3)), seconds(3));
  t.drift_ppm = 1'000'000;  // twice as fast
  EXPECT_EQ(t.in_world(seconds(3)), milliseconds(1500));
  t.drift_ppm = -500'000;
  EXPECT_EQ(t.in_world(seconds(3)), seconds(6));
  t.drift_ppm = 100;
  EXPECT_EQ(t.in_world(std::chrono::hours(10)).count(), 35'996'400'359'964LL);
}

// The "response latency (min, max, outliers)": from the end of the request to the start of the answer.
TEST(Timing, ResponseLatencyIsBetweenMinAndMax) {
  Rig rig;
  Node node(rig.world, rig.bus, stored(5, 9), {.response_min = milliseconds(2), .response_max = milliseconds(4)});
  node.on();
  rig.run(milliseconds(1));
  rt::Duration least = seconds(1);
  rt::Duration most{0};
  for (int i = 0; i < 200; ++i) {
    rig.record.clear();
    rig.ask("609#4000100000000000", milliseconds(10));
    const auto gap = between(rig.record, "609#4000100000000000", "589#4300100000000000");
    least = std::min(least, gap);
    most = std::max(most, gap);
  }
  // The answer itself is 116 bits of 2 us, some stuffed, and starts on a bit's edge.
  EXPECT_GE(least, milliseconds(2) + microseconds(210));
  EXPECT_LE(most, milliseconds(4) + microseconds(280));
  EXPECT_LT(least, milliseconds(2) + microseconds(400)) << "the range is used";
  EXPECT_GT(most, milliseconds(4));
}

TEST(Timing, OutliersAreRareAndLong) {
  Rig rig;
  Timing timing{.response_min = microseconds(100),
                .response_max = microseconds(100),
                .outlier_per_million = 100'000,
                .outlier = milliseconds(50)};
  Node node(rig.world, rig.bus, stored(5, 9), timing);
  node.on();
  rig.run(milliseconds(100));
  int late = 0;
  for (int i = 0; i < 500; ++i) {
    rig.record.clear();
    rig.ask("609#4000100000000000", milliseconds(60));
    if (between(rig.record, "609#4000100000000000", "589#4300100000000000") > milliseconds(50)) ++late;
  }
  EXPECT_GT(late, 25);
  EXPECT_LT(late, 100);
}

TEST(Timing, BootAndResetTakeTheirTime) {
  Rig rig;
  Node node(rig.world, rig.bus, stored(5, 9), {.boot = milliseconds(300), .reset = milliseconds(40)});
  node.on();
  EXPECT_TRUE(node.device.booting());
  rig.run(milliseconds(299));
  rig.ask("7E5#0401000000000000", milliseconds(0));  // on the bus while it boots: not heard
  rig.run(milliseconds(5));
  EXPECT_EQ(node.device.lss().state(), lss::State::waiting);
  EXPECT_EQ(rig.record.text.back(), "709#00");
  EXPECT_FALSE(node.device.booting());
  rig.record.clear();
  rig.ask("000#8209", milliseconds(20));
  EXPECT_FALSE(node.device.node_id().configured());
  rig.ask("7E5#0401000000000000", milliseconds(30));
  EXPECT_EQ(node.device.lss().state(), lss::State::waiting) << "deaf during a reset";
  const auto gap = between(rig.record, "000#8209", "709#00");
  EXPECT_GE(gap, milliseconds(40));
  EXPECT_LT(gap, milliseconds(41));
}

// HC3.11: a mailbox for one frame loses the second of 40h..43h (HU.22: floods overrun such receivers).
TEST(Timing, SingleSlotLosesTheSecondOfTwoFramesBackToBack) {
  for (const std::uint16_t depth : {std::uint16_t{1}, std::uint16_t{2}}) {
    Rig rig;
    Node node(rig.world, rig.bus, stored(5, 9),
              {.response_min = milliseconds(1), .response_max = milliseconds(1), .rx_depth = depth});
    node.on();
    rig.run(milliseconds(5));
    rig.send("7E5#0401000000000000");
    rig.send("7E5#5E00000000000000");
    rig.run(milliseconds(10));
    EXPECT_EQ(node.device.lss().state(), lss::State::configuration);
    EXPECT_EQ(rig.record.count("7E4#5E09000000000000"), depth == 1 ? 0U : 1U);
    EXPECT_EQ(node.port.lost(), depth == 1 ? 1U : 0U);
    rig.ask("7E5#5E00000000000000");
    EXPECT_EQ(rig.record.count("7E4#5E09000000000000"), depth == 1 ? 1U : 2U) << "with a pause nothing is lost";
  }
}

TEST(Timing, FramesAreDealtWithInTheOrderInWhichTheyCame) {
  Rig rig;
  Node node(rig.world, rig.bus, stored(5, 9), {.response_min = milliseconds(0), .response_max = milliseconds(5)});
  node.on();
  rig.run(milliseconds(10));
  for (int round = 0; round < 50; ++round) {
    rig.record.clear();
    for (const char* frame : {"7E5#0401000000000000", "7E5#5A00000000000000", "7E5#5B00000000000000",
                              "7E5#5C00000000000000", "7E5#5D00000000000000", "7E5#0400000000000000"}) {
      rig.send(frame);
    }
    rig.run(milliseconds(40));
    std::vector<std::string> answers;
    for (const auto& frame : rig.record.text) {
      if (frame.starts_with("7E4")) answers.push_back(frame.substr(4, 2));
    }
    ASSERT_EQ(answers, (std::vector<std::string>{"5A", "5B", "5C", "5D"}));
  }
}

TEST(Timing, DeafWhileStoring) {
  for (const bool deaf : {true, false}) {
    Rig rig;
    Node node(rig.world, rig.bus, stored(5, 9), {.deaf_while_storing = deaf}, milliseconds(50));
    node.on();
    rig.run(milliseconds(5));
    rig.give_id(address_of(5), 3);
    rig.ask("7E5#1700000000000000");
    rig.ask("609#4000100000000000", milliseconds(10));
    EXPECT_EQ(rig.record.count("589#4300100000000000"), deaf ? 0U : 1U);
    rig.run(milliseconds(50));
    EXPECT_EQ(rig.record.count("7E4#1700000000000000"), 1U);
    rig.ask("609#4000100000000000", milliseconds(10));
    EXPECT_EQ(rig.record.count("589#4300100000000000"), deaf ? 1U : 2U);
  }
}

// "Power cycle needed after store": neither `04 00` nor a reset gives the new node-ID, only power.
TEST(Timing, PowerCycleNeeded) {
  for (const std::uint8_t old : {std::uint8_t{0xFF}, std::uint8_t{9}}) {
    Rig rig;
    Node node(rig.world, rig.bus, stored(5, old), {.power_cycle_after_store = true});
    node.on();
    rig.run(milliseconds(5));
    rig.give_id(address_of(5), 3);
    rig.ask("7E5#1700000000000000");
    EXPECT_EQ(rig.record.text.back(), "7E4#1700000000000000");
    rig.ask("7E5#0400000000000000");
    rig.ask("000#8200");
    rig.ask("000#8100");
    EXPECT_EQ(node.device.node_id(), NodeId(old));
    EXPECT_EQ(node.device.lss().persistent().node_id, NodeId(3));
    EXPECT_EQ(rig.record.count("703#00"), 0U);
    node.off();
    node.on();
    rig.run(milliseconds(5));
    EXPECT_EQ(rig.record.count("703#00"), 1U);
  }
}

// The "one that answers late or twice".
TEST(Timing, AnswersTwice) {
  Rig rig;
  Node node(rig.world, rig.bus, stored(5, 9), {.repeat_per_million = 1'000'000});
  node.on();
  rig.run(milliseconds(5));
  EXPECT_EQ(rig.record.count("709#00"), 2U);
  rig.ask("609#4000100000000000");
  EXPECT_EQ(rig.record.count("589#4300100000000000"), 2U);
}

TEST(Timing, DeafAndSlowByFault) {
  Rig rig;
  Node node(rig.world, rig.bus, stored(5, 9));
  node.on();
  rig.run(milliseconds(5));
  node.port.deaf(TimedPort::Deaf::fault, true);
  rig.ask("609#4000100000000000");
  EXPECT_EQ(rig.record.count("589#4300100000000000"), 0U);
  node.off();
  node.on();
  rig.run(milliseconds(5));
  rig.ask("609#4000100000000000");
  EXPECT_EQ(rig.record.count("589#4300100000000000"), 0U) << "power does not mend it";
  node.port.deaf(TimedPort::Deaf::fault, false);
  node.port.slow(milliseconds(30));
  rig.record.clear();
  rig.ask("609#4000100000000000", milliseconds(50));
  EXPECT_GT(between(rig.record, "609#4000100000000000", "589#4300100000000000"), milliseconds(30));
}

TEST(Timing, BusOffRecovers) {
  for (const int wait : {0, 100}) {
    Rig rig;
    auto options = stored(5, 9);
    options.bus_off_recovery = milliseconds(wait);
    Node node(rig.world, rig.bus, options);
    node.on();
    rig.run(milliseconds(5));
    node.controller->preset_counters(255, 0);
    sim::Fault fault;  // its next frame is disturbed: bus-off
    fault.where = sim::from_start(20);
    fault.trigger.when = [](const sim::FrameStart& start) { return start.frame.id == 0x589; };
    rig.bus.inject(fault);
    rig.ask("609#4000100000000000", milliseconds(50));
    EXPECT_TRUE(node.controller->status().bus_off);
    rig.run(milliseconds(100));
    EXPECT_EQ(node.controller->status().bus_off, wait == 0);
    EXPECT_EQ(rig.record.count("089#4081110000000000"), wait == 0 ? 0U : 1U);
  }
}

}  // namespace
}  // namespace berth::device::test::timing_tests

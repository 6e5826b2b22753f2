// Fault confinement in the scenes that docs/protocols/can-frames.md §Arbitration, §Fault confinement derive.
#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/can/length.hpp"
#include "berth/sim/scenarios.hpp"
#include "berth/sim/world.hpp"

namespace confinement_tests {
namespace {

using namespace berth;
using namespace std::chrono_literals;
using can::Frame;

struct Ear : can::Listener {
  std::vector<std::pair<Frame, rt::Time>> frames;
  std::vector<rt::Time> sent_at;
  std::vector<can::Status> changes;
  void received(const Frame& frame, rt::Time at) noexcept override { frames.emplace_back(frame, at); }
  void sent(std::uint32_t, rt::Time at) noexcept override { sent_at.push_back(at); }
  void changed(const can::Status& status, rt::Time) noexcept override { changes.push_back(status); }
};

struct Node {
  explicit Node(sim::Bus& bus, const sim::ControllerOptions& options = {}) : port(bus.attach(options)) {
    const std::vector<can::IdRange> everything{can::all_base, can::all_extended};
    port->listen(&ear, everything);
  }
  Ear ear;
  std::unique_ptr<sim::Controller> port;
};

struct Scene {
  sim::World world;
  sim::Bus& bus = world.add_bus("bus", 1'000'000);
  Node a{bus, {.name = "a"}};
  Node b{bus, {.name = "b"}};
  Node c{bus, {.name = "c"}};
};

// docs/protocols/can-frames.md §Arbitration: 16 collisions bring both to 128; in the 17th the first to detect signals
// passively and the other succeeds; the loser's turn comes later.
TEST(Confinement, G2_TwoWithOneId) {
  const auto steps = sim::two_with_one_id();
  std::vector<unsigned> tec_a;
  bool a_passive_flag = false;
  for (const auto& step : steps) {
    if (step.event.starts_with("a: attempt") && step.event.find("fails") != std::string::npos) {
      tec_a.push_back(step.nodes[0].tec);
      if (step.event.find("attempt 17 fails, passive") != std::string::npos) a_passive_flag = true;
    }
    EXPECT_NE(step.nodes[0].state, sim::ErrorState::bus_off);
    EXPECT_NE(step.nodes[1].state, sim::ErrorState::bus_off);
  }
  // b's 01 differs in the last bit, where a is dominant: b detects first.
  ASSERT_EQ(tec_a.size(), 16U);
  for (unsigned i = 0; i < 16; ++i) EXPECT_EQ(tec_a[i], 8 * (i + 1));
  EXPECT_FALSE(a_passive_flag);
  std::vector<std::string> events;
  for (const auto& step : steps) events.push_back(step.event);
  const auto find = [&](const std::string& text) {
    return std::ranges::find_if(events, [&](const auto& e) { return e.starts_with(text); }) - events.begin();
  };
  const auto end = static_cast<std::ptrdiff_t>(events.size());
  ASSERT_LT(find("b: attempt 17 fails, passive error flag"), end);
  ASSERT_LT(find("a: attempt 17 is acknowledged"), end);
  ASSERT_LT(find("b: attempt 18 is acknowledged"), end);
  EXPECT_LT(find("b: attempt 17 fails"), find("a: attempt 17 is acknowledged"));
  EXPECT_LT(find("a: attempt 17 is acknowledged"), find("b: attempt 18 is acknowledged"));
  // 16 times +8, then a: -1; b: +8 for its passive flag, -1 for its success.
  EXPECT_EQ(steps.back().nodes[0].tec, 127);
  EXPECT_EQ(steps.back().nodes[1].tec, 135);
}

// S4.1, docs/protocols/can-frames.md §Arbitration: repeats. The first coincidence leaves b at 135 (16 x 8, + 8 passive,
// - 1) and a at 127; b loses each further one: + 8, then - 1 for its own frame behind a's: + 7. Before the nineteenth
// it has 135 + 17 x 7 = 254, and 262 is bus-off. a gains 1 each time, and never suffers.
TEST(Confinement, S4_1_CoincidencesAgainAndAgainAreBusOff) {
  const auto steps = sim::two_with_one_id(30);
  std::vector<unsigned> before;
  for (const auto& step : steps) {
    if (!step.event.starts_with("a and b start together again")) continue;
    before.push_back(step.nodes[1].tec);
    const auto k = static_cast<unsigned>(before.size()) + 1;  // which coincidence begins
    EXPECT_EQ(step.nodes[0].tec, 127 - (k - 2)) << step.event;
    EXPECT_EQ(step.nodes[1].tec, 135 + 7 * (k - 2)) << step.event;
    EXPECT_EQ(step.nodes[1].state, sim::ErrorState::passive);
    EXPECT_EQ(step.nodes[0].state, sim::ErrorState::active) << "127 is active again";
  }
  EXPECT_EQ(before.size(), 18U) << "nineteen coincidences";
  const auto& last = steps.back();
  EXPECT_EQ(last.nodes[1].state, sim::ErrorState::bus_off);
  EXPECT_EQ(last.nodes[1].tec, 254 + 8);
  EXPECT_EQ(last.nodes[0].tec, 127 - 18);
  EXPECT_EQ(last.nodes[2].state, sim::ErrorState::active) << "who listens is not harmed";
}

// S4.1: the other road. At 125 kbit/s a flag of 6 bits is 48 bits of the others'. The transmitter's error costs 8; its
// own flag begins a few bits behind the stranger's, so 38 to 40 dominant bits stay behind it: 4 or 5 more times 8 (rule
// 6). Six attempts: 8 + 32, then 48 each, up to 256. The stranger, who is to blame, only counts 1 an attempt.
TEST(Confinement, S4_1_AWrongBitRateDrivesAHealthyNodeToBusOff) {
  const auto steps = sim::wrong_bit_rate(125'000);
  std::vector<unsigned> after_error;
  for (const auto& step : steps) {
    EXPECT_EQ(step.event.find("acknowledged"), std::string::npos) << step.event;
    if (step.event.starts_with("a: attempt")) after_error.push_back(step.nodes[0].tec);
  }
  EXPECT_EQ(after_error, (std::vector<unsigned>{8, 40 + 8, 88 + 8, 136 + 8, 184 + 8, 232 + 8}));
  const auto& last = steps.back();
  EXPECT_EQ(last.nodes[0].state, sim::ErrorState::bus_off);
  EXPECT_GT(last.nodes[0].tec, 255);
  EXPECT_EQ(last.nodes[2].name, "stranger");
  EXPECT_EQ(last.nodes[2].state, sim::ErrorState::active);
  EXPECT_EQ(last.nodes[2].rec, 6);
  EXPECT_EQ(last.nodes[2].tec, 0);
}

// At half and at a quarter of the rate the stranger's delimiter ends within the next start of frame, and its flag
// begins one of its bits behind that: 181h has sent no recessive bit it could not lose in arbitration. So receivers'
// counters rise, the stranger's too, until it is passive and harmless; the second attempt that was not lost is
// acknowledged.
TEST(Confinement, S4_1_NearerRatesEndErrorPassive) {
  for (const std::uint32_t rate : {250'000U, 500'000U}) {
    const auto steps = sim::wrong_bit_rate(rate);
    EXPECT_EQ(std::ranges::count_if(steps, [](const auto& s) { return s.event == "a: attempt 2 is acknowledged"; }), 1);
    for (const auto& node : steps.back().nodes) EXPECT_NE(node.state, sim::ErrorState::bus_off) << node.name;
    EXPECT_EQ(steps.back().nodes[2].state, sim::ErrorState::passive) << rate;
  }
}

// docs/protocols/can-frames.md §Fault confinement, rule 3: error-passive after 16 attempts, and there it stays.
TEST(Confinement, G3_LoneNode) {
  const auto steps = sim::lone_node(40);
  unsigned attempt = 0;
  for (const auto& step : steps) {
    if (step.event.find("fails") == std::string::npos) continue;
    ++attempt;
    EXPECT_EQ(step.nodes[0].tec, std::min(attempt, 16U) * 8U) << step.event;
    EXPECT_EQ(step.nodes[0].state, attempt >= 16 ? sim::ErrorState::passive : sim::ErrorState::active);
  }
  EXPECT_GE(attempt, 39U);
  // 701#00 up to its ACK slot, active flag 6, delimiter 8, intermission 3; passive also suspends for 8 bits. The
  // error is seen at the ACK slot: 8 bits of the frame (ACK delimiter, end-of-frame) and its intermission are not sent.
  const auto frame = can::exact_bits(Frame::base(0x701, {0x00}));
  const std::uint64_t period = frame - 3 - 8 + 6 + 8 + 3;
  std::vector<std::uint64_t> bits;
  for (const auto& step : steps) {
    if (step.event.find("fails") != std::string::npos) bits.push_back(step.bit);
  }
  EXPECT_EQ(bits[5] - bits[4], period);
  EXPECT_EQ(bits[30] - bits[29], period + 8);
}

// Disturbed in the last bit of end-of-frame for the sender, the receivers get the frame twice.
TEST(Confinement, LastBitOfEndOfFrameDuplicates) {
  Scene s;
  s.bus.inject({.where = sim::from_end(0), .victims = {s.a.port.get()}});
  s.a.port->send(Frame::base(0x123, {1, 2}), 1);
  s.world.run_for(2ms);
  EXPECT_EQ(s.b.ear.frames.size(), 2U);
  EXPECT_EQ(s.c.ear.frames.size(), 2U);
  EXPECT_EQ(s.a.ear.sent_at.size(), 1U);
  EXPECT_EQ(s.a.port->errors().tec(), 7);  // +8, -1
  EXPECT_EQ(s.b.port->errors().rec(), 0);  // the flag in intermission is an overload condition to them
  EXPECT_EQ(s.a.port->statistics().retransmissions, 1U);
}

// ... for a receiver it is only an overload frame: nothing is sent twice.
TEST(Confinement, LastBitOfEndOfFrameAtReceiverIsOverload) {
  Scene s;
  s.bus.inject({.where = sim::from_end(0), .victims = {s.b.port.get()}});
  s.a.port->send(Frame::base(0x123, {1, 2}), 1);
  s.a.port->send(Frame::base(0x124, {}), 2);
  s.world.run_for(2ms);
  ASSERT_EQ(s.b.ear.frames.size(), 2U);
  EXPECT_EQ(s.c.ear.frames.size(), 2U);
  EXPECT_EQ(s.bus.statistics().overload_frames, 1U);
  EXPECT_EQ(s.bus.statistics().error_frames, 0U);
  EXPECT_EQ(s.a.port->errors().tec() + s.b.port->errors().rec() + s.c.port->errors().rec(), 0);
  // b's flag takes the 3 bits of intermission and more; a and c answer it one bit later: 7 bits of flags, 8 of
  // delimiter.
  const auto first = can::exact_bits(Frame::base(0x123, {1, 2})) - 3;
  EXPECT_EQ(s.b.ear.frames[1].second,
            rt::Time((first + 7 + 8 + 3 + can::exact_bits(Frame::base(0x124, {})) - 3) * 1us));
}

// ... one bit earlier, at a receiver, it is an error: nobody else has the frame yet, all get it once.
TEST(Confinement, LastButOneBitOfEndOfFrameDeliversOnce) {
  Scene s;
  s.bus.inject({.where = sim::from_end(1), .victims = {s.b.port.get()}});
  s.a.port->send(Frame::base(0x123, {1, 2}), 1);
  s.world.run_for(2ms);
  EXPECT_EQ(s.b.ear.frames.size(), 1U);  // b refused the first
  EXPECT_EQ(s.c.ear.frames.size(), 2U);  // c had accepted it when b's flag came in the last bit
  EXPECT_EQ(s.a.ear.sent_at.size(), 1U);
  EXPECT_EQ(s.a.port->errors().tec(), 7);
}

// Bosch §8 rule 3, exception 2: a recessive stuff bit before RTR seen dominant costs nothing.
TEST(Confinement, StuffBitBeforeRtrCostsTheTransmitterNothing) {
  Scene s;
  // Start of frame and 0000: five dominant bits, so wire bit 5 is a recessive stuff bit.
  s.bus.inject({.kind = sim::Fault::Kind::dominant, .where = sim::from_start(5), .victims = {s.a.port.get()}});
  s.a.port->send(Frame::base(0x001, {}), 1);
  s.world.run_for(2ms);
  EXPECT_EQ(s.a.port->statistics().transmit_errors, 1U);
  EXPECT_EQ(s.a.port->errors().tec(), 0);
  EXPECT_EQ(s.b.ear.frames.size(), 1U);
}

// ... but the one behind RTR costs 8: 550h ends in four dominant bits, RTR is the fifth, wire bit 13 the stuff bit.
TEST(Confinement, StuffBitBehindRtrCostsTheTransmitterEight) {
  Scene s;
  s.bus.inject({.kind = sim::Fault::Kind::dominant, .where = sim::from_start(13), .victims = {s.a.port.get()}});
  s.a.port->send(Frame::base(0x550, {}), 1);
  s.world.run_for(2ms);
  EXPECT_EQ(s.a.port->statistics().transmit_errors, 1U);
  EXPECT_EQ(s.a.port->errors().tec(), 7);
}

TEST(Confinement, DominantInSecondBitOfIntermissionIsOverload) {
  Scene s;
  s.bus.inject({.kind = sim::Fault::Kind::dominant, .where = sim::from_end(-2)});
  s.a.port->send(Frame::base(0x123, {}), 1);
  s.world.run_for(2ms);
  EXPECT_EQ(s.bus.statistics().overload_frames, 1U);
  EXPECT_EQ(s.bus.statistics().error_frames, 0U);
  EXPECT_EQ(s.b.ear.frames.size(), 1U);
}

// docs/protocols/can-frames.md §Fault confinement, another bit rate: passive after 15 to 128 frames, then the others
// are free of it; its own frames are destroyed: bus-off after 32 attempts.
TEST(Confinement, G3_NodeAtAnotherBitRate) {
  Scene s;
  s.c.port->set_bit_rate(500'000);
  s.world.run_for(1ms);  // it takes part after 11 recessive bits of its own
  for (int i = 0; i < 5; ++i) s.a.port->send(Frame::base(0x123, {1, 2, 3, 4, 5, 6, 7, 8}), 1);
  s.world.run_until([&] { return s.c.port->errors().state() == sim::ErrorState::passive; }, 1s);
  EXPECT_EQ(s.c.port->errors().state(), sim::ErrorState::passive);
  EXPECT_GE(s.bus.statistics().error_frames, 5U);
  EXPECT_LE(s.bus.statistics().error_frames, 128U);
  EXPECT_TRUE(s.b.ear.frames.size() <= 1);
  s.world.run_for(100ms);
  EXPECT_TRUE(s.a.ear.sent_at.size() == 5 || s.a.port->errors().state() == sim::ErrorState::bus_off);
}

TEST(Confinement, G3_FramesAtAnotherBitRateAreDestroyed) {
  Scene s;
  s.c.port->set_bit_rate(500'000);
  s.world.run_for(1ms);
  // 101..01: the others see no six equal bits before the end of arbitration; in a flag before it c would only "lose".
  s.c.port->send(Frame::base(0x555, {1, 2, 3}), 1);
  // Only error-active nodes destroy: here something (good traffic, a reset) keeps the others' counters low. Left alone
  // they become passive first, and the stranger stays passive for want of an acknowledgement.
  s.world.run_until(
      [&] {
        if (s.a.port->errors().rec() > 90) s.a.port->preset_counters(0, 0);
        if (s.b.port->errors().rec() > 90) s.b.port->preset_counters(0, 0);
        return s.c.port->errors().state() == sim::ErrorState::bus_off;
      },
      1s);
  EXPECT_EQ(s.c.port->errors().state(), sim::ErrorState::bus_off);
  EXPECT_LE(s.c.port->statistics().attempts, 32U);  // fewer where rule 6 adds to the 8 of an attempt
  EXPECT_GE(s.c.port->statistics().attempts, 16U);
  EXPECT_EQ(s.c.port->statistics().bus_offs, 1U);
  EXPECT_TRUE(s.a.ear.frames.empty());
  ASSERT_FALSE(s.c.ear.changes.empty());
  EXPECT_TRUE(s.c.ear.changes.back().bus_off);
  EXPECT_EQ(s.c.port->send(Frame::base(0x123, {}), 1), can::Queued::bus_off);
}

// Rule 12: 128 times 11 recessive bits after restart().
// HU.34
TEST(Confinement, BusOffRecovery) {
  Scene s;
  s.a.port->preset_counters(255, 0);
  s.bus.inject({.kind = sim::Fault::Kind::dominant, .where = sim::from_start(20), .victims = {s.a.port.get()}});
  s.bus.inject({.trigger = {.times = 0}, .where = sim::from_end(9), .victims = {s.a.port.get()}});
  s.a.port->send(Frame::base(0x7FF, {0xFF}), 1);
  s.world.run_for(1ms);
  ASSERT_EQ(s.a.port->errors().state(), sim::ErrorState::bus_off);
  s.world.run_for(100ms);
  EXPECT_EQ(s.a.port->errors().state(), sim::ErrorState::bus_off);  // not by itself
  const auto from = s.world.now();
  ASSERT_TRUE(s.a.port->restart(1'000'000));
  EXPECT_EQ(s.a.port->send(Frame::base(0x7FF, {0xFF}), 1), can::Queued::bus_off);
  s.world.run_until([&] { return s.a.port->errors().state() == sim::ErrorState::active; }, 1s);
  EXPECT_EQ(s.world.now() - from, 128 * 11 * 1us);
  EXPECT_EQ(s.a.port->errors().tec(), 0);
}

// On a full bus each frame gives one run of 11 recessive bits.
TEST(Confinement, BusOffRecoveryUnderLoad) {
  Scene s;
  s.a.port->preset_counters(255, 0);
  s.bus.inject({.where = sim::from_start(20), .victims = {s.a.port.get()}});
  s.a.port->send(Frame::base(0x7FF, {0xFF}), 1);
  s.world.run_for(1ms);
  ASSERT_EQ(s.a.port->errors().state(), sim::ErrorState::bus_off);
  s.a.port->restart(1'000'000);
  const auto frames = s.bus.statistics().frames;
  for (int i = 0; i < 30; ++i) s.b.port->send(Frame::base(0x100, {0x55}), 0);
  const bool done = s.world.run_until(
      [&] {
        while (s.b.port->send(Frame::base(0x100, {0x55}), 0) == can::Queued::yes) {
        }
        return s.a.port->errors().state() == sim::ErrorState::active;
      },
      1s);
  EXPECT_TRUE(done);
  EXPECT_EQ(s.bus.statistics().frames - frames, 128U);
}

TEST(Confinement, StatusTellsWarningPassiveAndBack) {
  Scene s;
  s.a.port->preset_counters(90, 0);
  s.bus.inject({.where = sim::from_start(20), .victims = {s.b.port.get()}});
  s.a.port->send(Frame::base(0x123, {1}), 1);
  s.world.run_for(2ms);
  ASSERT_EQ(s.a.ear.changes.size(), 1U);  // 90 + 8 = 98, above the warning limit; 97 after the success
  EXPECT_EQ(s.a.port->errors().tec(), 97);
}

}  // namespace
}  // namespace confinement_tests

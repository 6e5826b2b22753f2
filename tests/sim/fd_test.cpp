// CAN FD frames on the simulated bus: times, arbitration beside classic frames, and what destroys them.
#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <vector>

#include "berth/can/length.hpp"
#include "berth/sim/world.hpp"

namespace fd_tests {
namespace {

using namespace berth;
using namespace std::chrono_literals;
using can::Frame;

struct Ear : can::Listener {
  std::vector<std::pair<Frame, rt::Time>> frames;
  std::vector<rt::Time> sent_at;
  void received(const Frame& frame, rt::Time at) noexcept override { frames.emplace_back(frame, at); }
  void sent(std::uint32_t, rt::Time at) noexcept override { sent_at.push_back(at); }
  void changed(const can::Status&, rt::Time) noexcept override {}
};

const std::vector<can::IdRange> everything{can::all_base, can::all_extended};

struct Node {
  explicit Node(sim::Bus& bus, sim::ControllerOptions options = {.fd = true}) : port(bus.attach(options)) {
    port->listen(&ear, everything);
  }
  Ear ear;
  std::unique_ptr<sim::Controller> port;
};

Frame fd(const char* text) { return *can::parse_frame(text); }

Frame long_frame(std::uint32_t id, std::uint8_t value, bool brs = true) {
  Frame f;
  f.id = id;
  f.fd = true;
  f.brs = brs;
  f.size = 64;
  f.data.fill(value);
  return f;
}

/// 500 kbit/s and 2 Mbit/s: bits of 2 µs and 500 ns.
struct FdBus : ::testing::Test {
  sim::World world;
  sim::Bus& bus = world.add_bus("a", 500'000, 2'000'000);
};

TEST_F(FdBus, TakesItsTwoBitRates) {
  Node a(bus);
  Node b(bus);
  ASSERT_EQ(a.port->send(fd("555##1"), 1), can::Queued::yes);
  world.run_for(1ms);
  // 17 and 9 nominal bits up to the end of EOF, 33 data bits.
  ASSERT_EQ(b.ear.frames.size(), 1U);
  EXPECT_EQ(b.ear.frames[0].second, rt::Time(26 * 2us + 33 * 500ns));
  EXPECT_EQ(b.ear.frames[0].first, fd("555##1"));
  ASSERT_EQ(a.ear.sent_at.size(), 1U);
  EXPECT_EQ(a.ear.sent_at[0], rt::Time(26 * 2us + 33 * 500ns));
  EXPECT_EQ(bus.statistics().busy, rt::Duration(29 * 2us + 33 * 500ns));
  EXPECT_EQ(bus.statistics().bits, 62U);
}

TEST_F(FdBus, WithoutBrsAllIsNominal) {
  Node a(bus);
  Node b(bus);
  a.port->send(fd("555##0"), 0);
  world.run_for(1ms);
  ASSERT_EQ(b.ear.frames.size(), 1U);
  EXPECT_EQ(b.ear.frames[0].second, rt::Time((17 + 34 + 9) * 2us));
}

TEST_F(FdBus, SixtyFourBytesArriveWhole) {
  Node a(bus);
  Node b(bus);
  auto frame = long_frame(0x555, 0);
  a.port->send(frame, 0);
  for (unsigned i = 0; i < 64; ++i) frame.data[i] = static_cast<std::uint8_t>(i * 7);
  a.port->send(frame, 0);
  a.port->send(Frame::base(0x123, {1, 2, 3}), 0);
  world.run_for(5ms);
  ASSERT_EQ(b.ear.frames.size(), 3U);
  EXPECT_EQ(b.ear.frames[0].first, long_frame(0x555, 0));
  EXPECT_EQ(b.ear.frames[0].second, rt::Time(26 * 2us + 652 * 500ns));
  EXPECT_EQ(b.ear.frames[1].first, frame);
  EXPECT_EQ(b.ear.frames[2].first, Frame::base(0x123, {1, 2, 3}));
  EXPECT_EQ(bus.statistics().bitwise, 0U);
  EXPECT_EQ(bus.statistics().fd_destroyed, 0U);
}

// docs/protocols/can-frames.md §Arbitration; RRS is dominant: an FD frame beats the remote and the extended frame of
// its first 11 bits.
TEST_F(FdBus, ArbitrationBesideClassicFrames) {
  Node ear(bus);
  Node a(bus);
  Node b(bus);
  Node c(bus);
  Node d(bus);
  Node e(bus);
  a.port->send(Frame::ext(0x100U << 18U, {1}), 0);
  b.port->send(Frame::request(0x100, 1), 0);
  c.port->send(long_frame(0x100, 3), 0);
  d.port->send(Frame::base(0x0FF, {4}), 0);
  e.port->send(Frame::ext(0x100, {5}), 0);
  world.run_for(5ms);
  ASSERT_EQ(ear.ear.frames.size(), 5U);
  EXPECT_EQ(ear.ear.frames[0].first, Frame::ext(0x100, {5}));
  EXPECT_EQ(ear.ear.frames[1].first, Frame::base(0x0FF, {4}));
  EXPECT_EQ(ear.ear.frames[2].first, long_frame(0x100, 3));
  EXPECT_EQ(ear.ear.frames[3].first, Frame::request(0x100, 1));
  EXPECT_EQ(ear.ear.frames[4].first, Frame::ext(0x100U << 18U, {1}));
  EXPECT_EQ(bus.statistics().error_frames, 0U);
}

TEST_F(FdBus, EqualFramesMerge) {
  Node a(bus);
  Node b(bus);
  Node ear(bus);
  a.port->send(long_frame(0x100, 3), 0);
  b.port->send(long_frame(0x100, 3), 0);
  world.run_for(5ms);
  EXPECT_EQ(ear.ear.frames.size(), 1U);
  EXPECT_EQ(bus.statistics().merged, 1U);
  EXPECT_EQ(bus.statistics().error_frames, 0U);
}

// Different beyond the first 8 bytes only; no error is left out, and nothing is delivered as if it were good.
TEST_F(FdBus, DifferentFramesOfOneIdentifierAreDestroyed) {
  Node a(bus);
  Node b(bus);
  Node ear(bus);
  auto other = long_frame(0x100, 3);
  other.data[63] = 4;
  a.port->send(long_frame(0x100, 3), 0);
  b.port->send(other, 0);
  world.run_for(500us);
  EXPECT_TRUE(ear.ear.frames.empty());
  EXPECT_GE(bus.statistics().collisions, 1U);
  EXPECT_GE(bus.statistics().fd_destroyed, 2U);
  EXPECT_EQ(a.port->errors().tec(), b.port->errors().tec());
  EXPECT_GE(a.port->errors().tec(), 8U);
}

// The FD frame's recessive FDF meets the classic frame's dominant bit: 1 + 11 + 1 + 1 bits, then FDF; no data differ.
TEST_F(FdBus, AClassicFrameOfTheSameIdentifier) {
  Node a(bus);
  Node b(bus);
  Node ear(bus);
  a.port->send(fd("555##1"), 0);
  b.port->send(Frame::base(0x555, {}), 0);
  world.run_for(60us);
  EXPECT_EQ(a.port->errors().tec(), 8U);
  EXPECT_EQ(b.port->errors().tec(), 8U);
  EXPECT_EQ(ear.port->errors().rec(), 1U);
  EXPECT_EQ(bus.statistics().fd_destroyed, 0U) << "played exactly";
  // Once the FD node is passive it no longer disturbs: the classic frame gets through, then the FD frame.
  world.run_for(50ms);
  ASSERT_EQ(ear.ear.frames.size(), 2U);
  EXPECT_EQ(ear.ear.frames[0].first, Frame::base(0x555, {}));
  EXPECT_EQ(ear.ear.frames[1].first, fd("555##1"));
}

TEST_F(FdBus, AFaultDestroysTheWholeFrame) {
  Node a(bus);
  Node b(bus);
  Node ear(bus);
  bus.inject({.where = sim::from_end(12), .victims = {ear.port.get()}});
  a.port->send(long_frame(0x555, 9), 7);
  world.run_for(2ms);
  EXPECT_EQ(bus.statistics().fd_destroyed, 1U);
  EXPECT_EQ(bus.statistics().error_frames, 1U);
  ASSERT_EQ(ear.ear.frames.size(), 1U) << "the repetition";
  EXPECT_EQ(b.ear.frames.size(), 1U);
  EXPECT_EQ(a.ear.sent_at.size(), 1U);
  EXPECT_EQ(a.port->errors().tec(), 7U);
  EXPECT_EQ(a.port->statistics().retransmissions, 1U);
  // SOF to FDF 15 bits, 6 of the flag, 6 of the receivers' (they see five dominant bits behind FDF, and the sixth is
  // their stuff error), 8 of the delimiter, 3 of intermission; then the frame: 26 nominal bits and its data phase.
  const auto bits = can::exact_fd_bits(long_frame(0x555, 9));
  EXPECT_EQ(ear.ear.frames[0].second, rt::Time((15 + 6 + 6 + 8 + 3 + 26) * 2us + bits.data * 500ns));
}

TEST_F(FdBus, AnOverrunLosesItForOne) {
  Node a(bus);
  Node b(bus);
  Node ear(bus);
  bus.inject({.kind = sim::Fault::Kind::overrun, .victims = {ear.port.get()}});
  a.port->send(long_frame(0x555, 9), 0);
  world.run_for(2ms);
  EXPECT_TRUE(ear.ear.frames.empty());
  EXPECT_EQ(b.ear.frames.size(), 1U);
  EXPECT_EQ(bus.statistics().fd_destroyed, 0U);
}

TEST_F(FdBus, AnActFallsInTheDataPhase) {
  Node a(bus);
  Node b(bus);
  rt::Time when{};
  bus.inject({.kind = sim::Fault::Kind::act, .where = sim::from_start(17 + 100), .act = [&] { when = world.now(); }});
  a.port->send(long_frame(0x555, 9), 0);
  world.run_for(2ms);
  EXPECT_EQ(when, rt::Time(17 * 2us + 100 * 500ns));
}

TEST_F(FdBus, NobodyToAcknowledge) {
  Node a(bus);
  a.port->send(long_frame(0x100, 1), 1);
  world.run_for(50ms);
  EXPECT_TRUE(a.ear.sent_at.empty());
  EXPECT_EQ(a.port->errors().tec(), 128U) << "as with a classic frame: passive, never bus-off";
  EXPECT_FALSE(a.port->status().bus_off);
  Node b(bus);
  world.run_for(10ms);
  ASSERT_EQ(a.ear.sent_at.size(), 1U);
  ASSERT_EQ(b.ear.frames.size(), 1U);
  EXPECT_TRUE(b.ear.frames[0].first.esi) << "sent by a passive node";
}

TEST_F(FdBus, ItsSenderIsUnplugged) {
  Node a(bus);
  Node b(bus);
  Node c(bus);
  a.port->send(long_frame(0x100, 1), 1);
  world.after(200us, [&] { a.port->cable(false); });
  world.run_for(1ms);
  EXPECT_TRUE(b.ear.frames.empty());
  b.port->send(Frame::base(0x222, {}), 1);
  world.run_for(1ms);
  EXPECT_EQ(c.ear.frames.size(), 1U);
  a.port->cable(true);
  world.run_for(10ms);
  EXPECT_EQ(c.ear.frames.size(), 2U) << "it is repeated";
}

// Which controllers and which frames.
TEST_F(FdBus, OnlyFdControllers) {
  EXPECT_EQ(bus.attach({.name = "classic"}), nullptr);
  Node a(bus);
  auto odd = long_frame(1, 1);
  odd.size = 63;
  EXPECT_EQ(a.port->send(odd, 0), can::Queued::closed);
  odd.size = 64;
  odd.fd = false;
  EXPECT_EQ(a.port->send(odd, 0), can::Queued::closed);
  sim::Bus& classic = world.add_bus("classic", 500'000);
  Node b(classic);
  EXPECT_EQ(b.port->send(fd("555##1"), 0), can::Queued::closed);
  EXPECT_EQ(b.port->send(Frame::base(0x555, {}), 0), can::Queued::yes);
}

// Disturbed at random: every frame arrives in the end, once for each that hears it, whole, or the sender is bus-off.
TEST_F(FdBus, RandomTrafficWithFaults) {
  Node a(bus);
  Node b(bus);
  Node ear(bus);
  bus.faults().draw_from({.disturbed_per_million = 20'000});
  for (unsigned i = 0; i < 2000; ++i) {
    Node& from = i % 2 == 0 ? a : b;
    const auto value = static_cast<std::uint8_t>(i);
    if (i % 3 == 0) {
      from.port->send(Frame::base(0x100 + i % 7, {value}), 1);
    } else {
      from.port->send(long_frame(0x100 + i % 7, value), 1);
    }
    world.run_for(1ms);
  }
  world.run_for(20ms);
  EXPECT_EQ(a.ear.sent_at.size() + b.ear.sent_at.size(), 2000U);
  EXPECT_GT(bus.statistics().fd_destroyed, 10U);
  // Only a classic frame can be heard twice (a disturbed last bit of end-of-frame) here.
  std::size_t long_ones = 0;
  for (const auto& [frame, at] : ear.ear.frames) {
    if (!frame.fd) continue;
    ++long_ones;
    ASSERT_EQ(frame, long_frame(frame.id, frame.data[0]));
  }
  EXPECT_EQ(long_ones, 1333U);
}

}  // namespace
}  // namespace fd_tests

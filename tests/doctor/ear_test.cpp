// What the doctor's ear counts, from frames and error counters that are put into a port by hand.
#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>

#include "berth/doctor/heard.hpp"

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
    s.up = true;
    s.errors = errors;
    return s;
  }
  bool restart(std::uint32_t) noexcept override { return true; }
  void hear(const Frame& frame, rt::Time at) { listener_->received(frame, at); }
  std::uint32_t errors = 0;

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

}  // namespace
}  // namespace berth::doctor

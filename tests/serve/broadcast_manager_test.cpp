// BCM mode without a connection and without a bus (berth/serve/broadcast_manager.hpp).
#include "berth/serve/broadcast_manager.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>

namespace berth::serve {
namespace {

using namespace std::chrono_literals;

class Broadcasts : public ::testing::Test, private BroadcastManager::Client {
 protected:
  void act(const std::string& element, rt::Time now) {
    ASSERT_TRUE(manager_.act(io::parse_command(element), now)) << element;
  }
  void hear(std::uint32_t id, std::uint8_t byte, rt::Time at) {
    can::Frame frame;
    frame.id = id;
    frame.size = 1;
    frame.data[0] = byte;
    manager_.hear(frame, at);
  }

  BroadcastManager manager_{*this};
  unsigned sent_ = 0, told_ = 0;
  std::uint8_t last_ = 0;
  std::optional<rt::Time> armed_;

 private:
  void give(const can::Frame&) override { ++sent_; }
  bool hand_over(const can::Frame&) override {
    ++sent_;
    return true;
  }
  bool tell_frame(const can::Frame& frame, rt::Time) override {
    ++told_;
    last_ = frame.data[0];
    return true;
  }
  void arm(rt::Time when) noexcept override { armed_ = when; }
  void filter() override {}
};

TEST_F(Broadcasts, AJobIsSentAtOnceAndThenEachIntervalButNotWhereThereIsNoRoom) {
  const rt::Time t{};
  act("add 0 10000 123 1 5", t);
  EXPECT_EQ(sent_, 1U);
  EXPECT_EQ(armed_, t + 10ms);
  manager_.run(t + 10ms, true);
  EXPECT_EQ(sent_, 2U);
  manager_.run(t + 20ms, false);
  EXPECT_EQ(sent_, 2U);
  EXPECT_EQ(armed_, t + 30ms);
}

TEST_F(Broadcasts, AFilterTellsOnlyWhatChangesUnderItsMask) {
  const rt::Time t{};
  act("filter 0 0 123 1 0F", t);
  hear(0x123, 0x10, t);
  hear(0x123, 0x20, t + 1ms);  // the upper half
  EXPECT_EQ(told_, 1U);
  hear(0x123, 0x21, t + 2ms);
  EXPECT_EQ(told_, 2U);
  hear(0x124, 0x21, t + 2ms);
  EXPECT_EQ(told_, 2U);
}

TEST_F(Broadcasts, WhatComesTooSoonIsToldWhenTheIntervalIsOverTheNewestOfIt) {
  const rt::Time t{};
  act("subscribe 0 10000 123", t);
  hear(0x123, 1, t);
  hear(0x123, 2, t + 1ms);
  hear(0x123, 3, t + 2ms);
  EXPECT_EQ(told_, 1U);
  EXPECT_EQ(armed_, t + 10ms);
  manager_.run(t + 10ms, true);
  EXPECT_EQ(told_, 2U);
  EXPECT_EQ(last_, 3U);
}

}  // namespace
}  // namespace berth::serve

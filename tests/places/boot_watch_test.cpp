// Who booted and who was heard, by node-ID; "no node-ID" is nobody's.
#include "berth/places/boot_watch.hpp"

#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>

#include "berth/places/binder.hpp"
#include "berth/sim/world.hpp"

namespace berth::places {
namespace {

using namespace std::chrono_literals;

class Watch : public ::testing::Test {
 protected:
  void heard(std::uint32_t id, std::uint8_t state) {
    other_->send(can::Frame::base(id, {state}), 0);
    world_.run_for(10ms);
  }
  void heard_of_eight(std::uint32_t id) {
    other_->send(can::Frame::base(id, {0, 0, 0, 0, 0, 0, 0, 0}), 0);
    world_.run_for(10ms);
  }

  sim::World world_{1};
  sim::Bus& bus_ = world_.add_bus("bus", 125'000);
  std::unique_ptr<sim::Controller> own_ = bus_.attach();
  std::unique_ptr<sim::Controller> other_ = bus_.attach();
  can::Dispatcher dispatcher_{world_.executor(), *own_};
  BootWatch boots_{dispatcher_};
};

// Two used the node-ID, and one gave it up: that it was vacant once counts no more, and the other is asked for.
TEST_F(Watch, WhatOneGaveUpAnotherMayUse) {
  VacancyTable vacancy{};
  vacancy[5] = vacancy[6] = vacancy[127] = world_.executor().now();
  heard(0x705, 0x00);
  EXPECT_FALSE(boots_.vacant_since(NodeId(5), *vacancy[5]));
  gave_up(boots_, vacancy, NodeId(5));
  EXPECT_FALSE(vacancy[5]);
  EXPECT_FALSE(boots_.boot_up(NodeId(5)));
  EXPECT_TRUE(vacancy[6]);
  gave_up(boots_, vacancy, NodeId());
  EXPECT_TRUE(vacancy[127]);
}

// Answers to guarding have a toggle bit, and come at the distance of the questions.
TEST_F(Watch, AnswersToGuardingAreNoHeartbeats) {
  for (int i = 0; i < 4; ++i) {
    heard(0x705, (i & 1) == 0 ? 0x05 : 0x85);
    EXPECT_FALSE(boots_.steady(NodeId(5))) << i;
  }
  for (int i = 0; i < 3; ++i) heard(0x705, 0x05);
  EXPECT_TRUE(boots_.steady(NodeId(5))) << "these are";
}

// A device that had no node-ID gives up none: FFh is not 127.
TEST_F(Watch, AnUnconfiguredNodeIdIsNot127) {
  heard(0x77F, 0x00);
  heard(0x77F, 0x05);
  boots_.forget(NodeId());
  EXPECT_TRUE(boots_.boot_up(NodeId(127)));
  EXPECT_EQ(boots_.beats(NodeId(127)), 1U);
  EXPECT_EQ(boots_.state(NodeId(127)), NmtState::operational);
  EXPECT_FALSE(boots_.boot_up(NodeId()));
  EXPECT_FALSE(boots_.heard(NodeId()));
  EXPECT_FALSE(boots_.booted_since(NodeId(), {}));
  EXPECT_EQ(boots_.boot_ups(NodeId()), 0U);
}

TEST_F(Watch, WhoGaveItsNodeIdUpIsForgottenAlone) {
  heard(0x703, 0x00);
  heard(0x704, 0x00);
  boots_.forget(NodeId(3));
  EXPECT_FALSE(boots_.boot_up(NodeId(3)));
  EXPECT_TRUE(boots_.boot_up(NodeId(4)));
}

// A node-ID whose device tells an error or answers another client's question is in use, error control or not.
TEST_F(Watch, AnEmergencyOrAnSdoAnswerEndsTheSilenceOfANodeId) {
  const rt::Time began = world_.executor().now();
  heard_of_eight(0x085);
  heard_of_eight(0x586);
  heard(0x707, 0x05);
  heard_of_eight(0x608);  // a request to 8 is no word of 8
  heard_of_eight(0x080);  // SYNC and TIME are nobody's
  heard_of_eight(0x100);
  for (std::uint8_t id = 1; id < 128; ++id) {
    EXPECT_EQ(boots_.silent_since(NodeId(id), began), id < 5 || id > 7) << int(id);
    EXPECT_TRUE(boots_.silent_since(NodeId(id), world_.executor().now())) << int(id);
  }
  EXPECT_FALSE(boots_.heard(NodeId(5))) << "it says nothing of a state";
  boots_.forget(NodeId(5));
  EXPECT_TRUE(boots_.silent_since(NodeId(5), began));
}

// A device that was heard half a second before a question may be deaf for as long as the question is asked (seed
// 45130).
TEST_F(Watch, ASilenceBehindALateWordIsNoVacancy) {
  heard_of_eight(0x585);
  world_.run_for(500ms);
  const rt::Time soon = world_.executor().now();
  EXPECT_TRUE(boots_.silent_since(NodeId(5), soon));
  EXPECT_FALSE(boots_.vacant_since(NodeId(5), soon));
  EXPECT_TRUE(boots_.vacant_since(NodeId(6), soon));
  world_.run_for(600ms);
  const rt::Time later = world_.executor().now();
  EXPECT_TRUE(boots_.vacant_since(NodeId(5), later));
  heard_of_eight(0x585);
  EXPECT_FALSE(boots_.vacant_since(NodeId(5), later));
}

}  // namespace
}  // namespace berth::places

// Which machine gets it when, and what counts as a failure.
#include "berth/fleet/roll_out.hpp"

#include <gtest/gtest.h>

#include <map>

namespace berth::fleet {
namespace {

using namespace std::chrono_literals;
using sparkplug::EdgeNodeId;
using Stage = RollOut::Stage;

constexpr const char* the_value = "13 bytes, CRC-32 00000001";

RollOutView ready() {
  return {
      .known = true, .online = true, .has_slot = true, .device_there = true, .allows = true, .state = "operational"};
}

/// Machines a, b, c, ... of group g, and what is seen of them.
struct Field {
  explicit Field(std::size_t count, RollOut::Options options = {}) {
    std::vector<EdgeNodeId> ids;
    for (std::size_t i = 0; i < count; ++i) {
      ids.push_back({"g", std::string(1, static_cast<char>('a' + i))});
      seen[ids.back().node] = ready();
    }
    options.slot = "drive";
    options.command = "configure";
    options.value = the_value;
    roll_out.emplace(std::move(options), std::move(ids));
  }
  /// The names of those that get it now.
  std::string turn(RollOut::Time at) {
    std::string begun;
    for (const auto& id : roll_out->turn([this](const EdgeNodeId& each) { return seen.at(each.node); }, at)) {
      roll_out->sent(id, at, "");
      begun += id.node;
    }
    return begun;
  }
  /// By the machine's clock, at second `at`.
  void done(const std::string& name, std::uint64_t at) { seen.at(name).done = CommandEnd{at, the_value, "done"}; }
  [[nodiscard]] const RollOut::Row& row(std::size_t place) const { return roll_out->rows().at(place); }

  std::map<std::string, RollOutView> seen;
  std::optional<RollOut> roll_out;
};

}  // namespace

TEST(FleetRollOut, TheNextWaveWaitsForAllOfTheOneBefore) {
  Field field(5, {.at_most = 2});
  EXPECT_EQ(field.turn(0ms), "ab");
  field.done("a", 1);
  EXPECT_EQ(field.turn(1s), "");
  EXPECT_EQ(field.turn(5s), "") << "b has not answered";
  EXPECT_EQ(field.row(0).stage, Stage::done);
  field.done("b", 2);
  EXPECT_EQ(field.turn(6s), "");
  EXPECT_EQ(field.turn(9s), "cd");
  field.done("c", 1);
  field.done("d", 1);
  EXPECT_EQ(field.turn(10s), "");
  EXPECT_EQ(field.turn(13s), "e");
  EXPECT_FALSE(field.roll_out->over());
  field.done("e", 1);
  EXPECT_EQ(field.turn(14s), "");
  EXPECT_EQ(field.turn(17s), "");
  EXPECT_TRUE(field.roll_out->over());
}

TEST(FleetRollOut, AFailureStopsTheOthersIfThatIsWanted) {
  for (const bool stops : {true, false}) {
    Field field(3, {.stop_on_failure = stops});
    EXPECT_EQ(field.turn(0ms), "a");
    field.seen.at("a").refused = CommandEnd{1, the_value, "no: 2000h:00 does not fit"};
    EXPECT_EQ(field.turn(1s), stops ? "" : "b");
    EXPECT_EQ(field.row(0).stage, Stage::failed);
    EXPECT_EQ(field.row(0).words, "no: 2000h:00 does not fit");
    EXPECT_EQ(field.roll_out->over(), stops);
    EXPECT_EQ(field.row(2).stage, Stage::waiting);
  }
}

// The last answers of earlier commands stand there until another comes.
TEST(FleetRollOut, OldAndOthersAnswersDoNotCount) {
  Field field(1);
  field.done("a", 7);
  EXPECT_EQ(field.turn(0ms), "a");
  EXPECT_EQ(field.turn(10s), "");
  EXPECT_EQ(field.row(0).stage, Stage::sent) << "that answer was there before";
  field.seen.at("a").done = CommandEnd{8, "99 bytes, CRC-32 00000002", "done"};
  EXPECT_EQ(field.turn(20s), "");
  EXPECT_EQ(field.row(0).stage, Stage::sent) << "that is about another value";
  field.done("a", 9);
  EXPECT_EQ(field.turn(21s), "");
  EXPECT_EQ(field.row(0).stage, Stage::carried_out);
}

TEST(FleetRollOut, DoneIsWhatStaysOperational) {
  Field field(1, {.patience = 60s, .steady = 3s});
  EXPECT_EQ(field.turn(0ms), "a");
  field.done("a", 1);
  EXPECT_EQ(field.turn(1s), "");
  EXPECT_EQ(field.turn(3s), "");
  field.seen.at("a").state = "failed";
  field.seen.at("a").reason = "2000h:00 refused";
  EXPECT_EQ(field.turn(3500ms), "");
  field.seen.at("a").state = "operational";
  EXPECT_EQ(field.turn(4s), "");
  EXPECT_EQ(field.turn(6900ms), "");
  EXPECT_EQ(field.row(0).stage, Stage::carried_out) << "three seconds from 4 s on";
  EXPECT_EQ(field.turn(7s), "");
  EXPECT_EQ(field.row(0).stage, Stage::done);
}

TEST(FleetRollOut, PatienceEnds) {
  Field field(2, {.at_most = 2, .patience = 60s});
  EXPECT_EQ(field.turn(0ms), "ab");
  field.done("b", 1);
  field.seen.at("b").state = "failed";
  field.seen.at("b").reason = "2000h:00 refused";
  field.seen.at("a").online = false;
  EXPECT_EQ(field.turn(59s), "");
  EXPECT_EQ(field.row(0).stage, Stage::sent);
  EXPECT_EQ(field.turn(60s), "");
  EXPECT_EQ(field.row(0).words, "no answer within 60 s; it is offline");
  EXPECT_EQ(field.row(1).words, "not operational within 60 s; slot drive is failed: 2000h:00 refused");
  EXPECT_TRUE(field.roll_out->over());
}

TEST(FleetRollOut, WhoCannotGetItIsToldWhyAndNothingIsSent) {
  Field field(6);
  field.seen.at("a").known = false;
  field.seen.at("b").online = false;
  field.seen.at("c").has_slot = false;
  field.seen.at("d").device_there = false;
  field.seen.at("d").state = "absent";
  field.seen.at("e").allows = false;
  EXPECT_EQ(field.turn(0ms), "f");
  EXPECT_EQ(field.row(0).words, "nothing was heard of it at this broker");
  EXPECT_EQ(field.row(1).words, "it is offline");
  EXPECT_EQ(field.row(2).words, "it has no slot drive");
  EXPECT_EQ(field.row(3).words, "slot drive is absent");
  EXPECT_EQ(field.row(4).words, "its machine file does not allow it: commands = [\"configure\"] in [mqtt]");
}

TEST(FleetRollOut, WhatCouldNotBeSentHasFailed) {
  Field field(1);
  const auto begun = field.roll_out->turn([&](const EdgeNodeId& id) { return field.seen.at(id.node); }, 0ms);
  ASSERT_EQ(begun.size(), 1U);
  field.roll_out->sent(begun.front(), 0ms, "there is no connection");
  EXPECT_EQ(field.row(0).stage, Stage::failed);
  EXPECT_EQ(field.row(0).words, "it was not sent: there is no connection");
}

TEST(FleetRollOut, AStopLetsThoseUnderWayEnd) {
  Field field(2);
  EXPECT_EQ(field.turn(0ms), "a");
  field.roll_out->stop();
  EXPECT_FALSE(field.roll_out->over());
  field.done("a", 1);
  EXPECT_EQ(field.turn(1s), "");
  EXPECT_EQ(field.turn(4s), "");
  EXPECT_TRUE(field.roll_out->over());
  EXPECT_EQ(field.row(0).stage, Stage::done);
  EXPECT_EQ(field.row(1).stage, Stage::waiting);
}

}  // namespace berth::fleet

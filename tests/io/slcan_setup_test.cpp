// How an adapter is opened, and the queue of own frames: without a line (berth/io/slcan_setup.hpp, slcan_queue.hpp).
#include <gtest/gtest.h>

#include "berth/io/slcan_queue.hpp"
#include "berth/io/slcan_setup.hpp"

namespace {

using namespace berth;
using io::Confirms;
using io::SlcanLine;
using io::SlcanSetup;
using Kind = SlcanLine::Kind;

SlcanLine line(Kind kind) {
  SlcanLine made;
  made.kind = kind;
  return made;
}

can::Frame slcan_frame(std::uint32_t id) {
  can::Frame frame;
  frame.id = id;
  return frame;
}

// A LAWICEL CANUSB knows no z0003: its answer says that a frame was taken, not that it was sent.
TEST(SlcanSetup, EachCommandWaitsForTheAnswerToTheOneBefore) {
  SlcanSetup setup;
  EXPECT_EQ(setup.begin(125'000, {}), "C\rC\rV\r");
  EXPECT_FALSE(setup.hear(line(Kind::refused)));
  EXPECT_FALSE(setup.hear(line(Kind::frame)));  // of the channel as it was
  const auto rate = setup.hear(line(Kind::version));
  ASSERT_TRUE(rate);
  EXPECT_EQ(rate->say, "S4\r");
  const auto events = setup.hear(line(Kind::done));
  ASSERT_TRUE(events);
  EXPECT_EQ(events->say, "z0003\r");
  const auto open = setup.hear(line(Kind::refused));
  ASSERT_TRUE(open);
  EXPECT_EQ(open->say, "O\r");
  EXPECT_FALSE(open->up);
  EXPECT_EQ(setup.confirms(), Confirms::answers);
  const auto up = setup.hear(line(Kind::done));
  ASSERT_TRUE(up);
  EXPECT_TRUE(up->up);
}

TEST(SlcanSetup, AnAdapterThatNeverAnswersIsToldEverythingAtOnce) {
  SlcanSetup setup;
  setup.begin(500'000, {.listen_only = true});
  const auto turn = setup.silence();
  EXPECT_TRUE(turn.up);
  EXPECT_EQ(turn.say, "S6\rM1\rO\r");
  EXPECT_EQ(setup.confirms(), Confirms::nothing);
}

TEST(SlcanSetup, ARefusedBitRateIsAFailureAndSilenceBehindACommandToo) {
  SlcanSetup setup;
  setup.begin(125'000, {});
  ASSERT_TRUE(setup.hear(line(Kind::text)));
  EXPECT_EQ(setup.silence().failure, "the adapter does not answer");
  const auto refused = setup.hear(line(Kind::refused));
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->failure, "the adapter: it refuses 125000 bit/s");
}

TEST(SlcanQueue, AFrameThatTheAdapterHasIsNotWithdrawnAndIsNobodysAnyMore) {
  io::SlcanQueue queue;
  queue.push(slcan_frame(1), 7);
  queue.push(slcan_frame(2), 7);
  queue.withdraw(7, true);
  EXPECT_EQ(queue.size(), 1U);
  EXPECT_EQ(queue.first().id, 1U);
  queue.taken();
  EXPECT_EQ(queue.reported(slcan_frame(1)), 0U);
  EXPECT_EQ(queue.size(), 0U);
}

TEST(SlcanQueue, AFrameThatIsAlwaysRefusedIsDroppedAfterAll) {
  io::SlcanQueue queue;
  queue.push(slcan_frame(1), 7);
  for (unsigned i = 1; i < io::SlcanQueue::most_tries; ++i) ASSERT_TRUE(queue.refused());
  EXPECT_FALSE(queue.refused());
  EXPECT_TRUE(queue.none_waits());
}

}  // namespace

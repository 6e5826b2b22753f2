// Worst-case response times against published examples and against cases that can be worked out by hand.
#include <gtest/gtest.h>
#include <chrono>
#include <string>
#include <vector>

#include "berth/analysis/response.hpp"
#include "berth/can/frame.hpp"

namespace berth::analysis {
namespace {

using namespace std::chrono_literals;

// 125 kbit/s, 7 bytes: 125 bits by the usual bound, one millisecond.
Line milliseconds_line() { return {.lengths = FrameLengths::usual}; }

Message message(const std::string& name, std::size_t sender, std::uint32_t key, rt::Duration period,
                rt::Duration jitter = 0ms) {
  return {.name = name,
          .sender = sender,
          .key = key,
          .data_bytes = 7,
          .period = period,
          .jitter = jitter,
          .deadline = period};
}

std::vector<rt::Duration> bounds(const Line& line) {
  EXPECT_EQ(wrong(line), "");
  std::vector<rt::Duration> result;
  for (const auto& r : analyze(line).responses) result.push_back(r.worst.value_or(-1ns));
  return result;
}

// Davis, Burns, Bril, Lukkien 2007, §3.2: the second instance of C waits longer than the first.
TEST(Response, ThePaperThatRefutedTheOlderAnalysis) {
  Line line = milliseconds_line();
  line.senders = {{"a"}, {"b"}, {"c"}};
  line.messages = {message("A", 0, 1, 2500us), message("B", 1, 2, 3500us), message("C", 2, 3, 3500us)};
  line.messages[1].deadline = line.messages[2].deadline = 3250us;
  EXPECT_EQ(bounds(line), (std::vector<rt::Duration>{2ms, 3ms, 3500us}));
  const auto result = analyze(line);
  EXPECT_TRUE(result.responses[0].meets_deadline);
  EXPECT_TRUE(result.responses[1].meets_deadline);
  EXPECT_FALSE(result.responses[2].meets_deadline) << "3.5 ms and 3.25 ms; the older analysis says 3.0 ms";
  EXPECT_NEAR(result.load, 1 / 2.5 + 2 / 3.5, 1e-9);
}

TEST(Response, AloneItTakesItsFrameAndWaitsForOneThatHasBegun) {
  Line line = milliseconds_line();
  line.senders = {{"a"}};
  line.messages = {message("A", 0, 1, 10ms, 2ms)};
  EXPECT_EQ(bounds(line), (std::vector<rt::Duration>{3ms})) << "jitter counts from the event";
  line.background_bytes = 7;
  EXPECT_EQ(bounds(line), (std::vector<rt::Duration>{4ms}));
  line.background_extended = true;
  EXPECT_EQ(bounds(line), (std::vector<rt::Duration>{4200us})) << "80 + 70 bits of 8 us";
}

// The highest and the lowest of three identifiers share a queue: the highest waits for what is before it, and that for
// all that win against the lowest.
TEST(Response, AFifoMakesTheHighestWaitForTheLowest) {
  Line line = milliseconds_line();
  line.senders = {{"a", Queue::in_order}, {"b"}};
  line.messages = {message("A", 0, 1, 20ms), message("B", 1, 2, 20ms), message("C", 0, 3, 20ms)};
  // A behind C, and B goes before C: B, C, A. B: one frame that has begun, and A, wherever it stands.
  EXPECT_EQ(bounds(line), (std::vector<rt::Duration>{3ms, 3ms, 3ms}));
  line.senders[0].queue = Queue::priority;
  EXPECT_EQ(bounds(line), (std::vector<rt::Duration>{2ms, 3ms, 3ms}));
}

// Of an unknown queue each message has the worse of the two.
TEST(Response, AnUnknownQueueIsTheWorseOfBothForEachMessage) {
  Line line = milliseconds_line();
  line.senders = {{"a"}, {"b"}};
  line.messages = {message("A", 0, 1, 1500us), message("B", 1, 2, 20ms), message("C", 0, 3, 20ms)};
  const auto priority = bounds(line);
  line.senders[0].queue = Queue::in_order;
  const auto in_order = bounds(line);
  EXPECT_GT(in_order[0], priority[0]) << "A behind C";
  EXPECT_LT(in_order[2], priority[2]) << "C, which no later A overtakes";
  line.senders[0].queue = Queue::unknown;
  const auto unknown = bounds(line);
  for (std::size_t i = 0; i < unknown.size(); ++i) EXPECT_EQ(unknown[i], std::max(priority[i], in_order[i])) << i;
}

// It may take the whole bus: those before it wait for one of its frames, those behind it for ever.
TEST(Response, WithoutALeastIntervalThereIsNoBound) {
  Line line = milliseconds_line();
  line.senders = {{"a"}, {"b"}};
  line.messages = {message("A", 0, 1, 20ms), message("B", 1, 2, 0ms), message("C", 0, 3, 20ms)};
  EXPECT_EQ(bounds(line), (std::vector<rt::Duration>{2ms, -1ns, -1ns}));
  const auto result = analyze(line);
  EXPECT_FALSE(result.good());
  EXPECT_EQ(result.responses[1].load, 0);
  line.senders[0].queue = Queue::in_order;
  EXPECT_EQ(bounds(line), (std::vector<rt::Duration>{-1ns, -1ns, -1ns})) << "A waits behind C";
  // What waits for ever in a FIFO comes at once, whenever that is.
  line.senders = {{"a"}, {"b", Queue::in_order}};
  line.messages = {message("A", 0, 5, 20ms), message("B", 1, 9, 0ms), message("D", 1, 1, 20ms)};
  EXPECT_EQ(bounds(line)[0], -1ns);
}

TEST(Response, MoreThanTheWholeBusIsNotGood) {
  Line line = milliseconds_line();
  line.senders = {{"a"}};
  line.messages = {message("A", 0, 1, 2ms), message("B", 0, 2, 2ms)};
  line.messages[0].deadline = line.messages[1].deadline = 0ms;
  EXPECT_TRUE(analyze(line).good());
  line.messages.push_back(message("C", 0, 3, 100ms));
  EXPECT_GT(analyze(line).load, 1);
  EXPECT_FALSE(analyze(line).good());
}

// SYNC behind a frame that has begun: 2 ms. What it sends has that as jitter, and waits for a frame and for SYNC.
TEST(Response, WhatAMessageSendsIsAsLateAsThat) {
  Line line = milliseconds_line();
  line.senders = {{"a"}, {"b"}};
  line.messages = {message("SYNC", 0, 1, 10ms), message("T", 1, 5, 10ms), message("low", 1, 9, 20ms)};
  line.messages[1].after = 1;
  EXPECT_EQ(bounds(line), (std::vector<rt::Duration>{2ms, 2ms + 3ms, 3ms}));
  // A change waits for two SYNCs, counts at the next behind the frame, and that is late, too.
  line.messages[1].before = 20ms;
  line.messages[1].counts_every = 10ms;
  line.messages[1].deadline = 32ms;
  const auto result = analyze(line);
  EXPECT_EQ(result.responses[1].arrival, rt::Duration(20ms + 10ms + 2ms));
  EXPECT_TRUE(result.responses[1].meets_deadline);
  line.messages[1].deadline -= 1ns;
  EXPECT_FALSE(analyze(line).responses[1].meets_deadline);
  // In the queue of "a" SYNC waits behind what "a" sends, and that for all others.
  line.senders[0].queue = Queue::in_order;
  line.messages.push_back(message("lowest", 0, 0x20, 20ms));
  EXPECT_EQ(bounds(line)[0], 4ms) << "T, low, lowest and SYNC; nothing is left that could have begun";
  EXPECT_GT(bounds(line)[1], 5ms);
  line.messages.push_back(message("any time", 1, 0, 0ms));
  EXPECT_EQ(bounds(line)[0], -1ns);
  EXPECT_EQ(bounds(line)[1], -1ns) << "nothing says when it is sent";
}

// 4 ms behind the end of the frame before: a change just behind that one's begin in the queue waits for its frame, too.
// What comes once in all that time delays only one of the two.
TEST(Response, AnInhibitTimeMayCountFromTheEndOfTheFrameBefore) {
  Line line = milliseconds_line();
  line.senders = {{"a"}, {"b"}};
  line.messages = {message("E", 1, 1, 100ms), message("M", 0, 5, 4ms), message("low", 1, 9, 100ms)};
  line.messages[1].before = 4ms;
  EXPECT_EQ(analyze(line).responses[1].worst, rt::Duration(3ms));
  EXPECT_EQ(analyze(line).responses[1].arrival, rt::Duration(7ms));
  line.messages[1].frames_before = 1;
  EXPECT_EQ(analyze(line).responses[1].arrival, rt::Duration(4ms + 5ms)) << "two frames that have begun, two of M, E";
  line.messages[0].period = 5ms;
  EXPECT_EQ(analyze(line).responses[1].arrival, rt::Duration(4ms + 6ms)) << "and E for each of them";
}

// What waits in a FIFO before arbitration sees it comes in a burst to the others.
TEST(Response, WaitingInAFifoIsJitterToTheOthers) {
  Line line = milliseconds_line();
  line.senders = {{"a", Queue::in_order}, {"b"}, {"c"}};
  line.messages = {message("A", 0, 1, 4ms), message("low", 0, 9, 20ms), message("B", 1, 5, 8ms),
                   message("C", 2, 2, 20ms)};
  const auto fifo = bounds(line);
  line.senders[0].queue = Queue::priority;
  const auto priority = bounds(line);
  EXPECT_GT(fifo[0], priority[0]);
  EXPECT_GT(fifo[2], priority[2]) << "two of A behind one another";
}

TEST(Response, ErrorsCostTheLongestFrameThatTheyCanDestroy) {
  Line line = milliseconds_line();
  line.senders = {{"a"}};
  line.messages = {message("A", 0, 1, 20ms)};
  line.errors = {.interval = 10ms, .burst = 1};
  EXPECT_EQ(bounds(line), (std::vector<rt::Duration>{2ms + 31 * 8us}));
  line.errors.burst = 3;
  EXPECT_EQ(bounds(line), (std::vector<rt::Duration>{4ms + 3 * 31 * 8us}));
}

TEST(Response, WhereTheBusIsTooSlowThereIsNoBound) {
  Line line = milliseconds_line();
  line.senders = {{"a"}, {"b"}, {"c"}};
  line.messages = {message("A", 0, 1, 4ms), message("B", 1, 2, 2ms), message("C", 2, 3, 3ms)};
  const auto result = analyze(line);
  EXPECT_TRUE(result.responses[0].worst);
  EXPECT_FALSE(result.responses[2].worst);
  EXPECT_FALSE(result.responses[2].meets_deadline);
  EXPECT_FALSE(result.good());
  EXPECT_GT(result.load, 1);
}

TEST(Response, ArbitrationOfBaseAndExtendedIdentifiers) {
  const auto x = [](std::uint32_t id) { return id | can::extended_flag; };
  EXPECT_TRUE(precedes(0x181, 0x182));
  EXPECT_FALSE(precedes(0x181, 0x181));
  EXPECT_TRUE(precedes(x(0x1F500000), 0x7E5)) << "1F500000h begins with 7D4h";
  EXPECT_FALSE(precedes(0x7E5, x(0x1F500000)));
  EXPECT_TRUE(precedes(0x100, x(0x100U << 18U)));
  EXPECT_TRUE(precedes(x(0x0FFU << 18U | 0x3FFFF), 0x100));
}

TEST(Response, WrongInputIsSaid) {
  Line line = milliseconds_line();
  line.senders = {{"a"}};
  line.messages = {message("A", 0, 1, -1ms)};
  EXPECT_EQ(wrong(line), "A: a time is negative");
  line.messages[0].period = line.messages[0].deadline = 1ms;
  line.messages[0].sender = 1;
  EXPECT_EQ(wrong(line), "A: its sender is not there");
  line.messages[0].sender = 0;
  line.messages[0].data_bytes = 9;
  EXPECT_EQ(wrong(line), "A: a frame has 8 bytes of data at most");
  line.messages[0].data_bytes = 8;
  line.messages[0].jitter = -1ns;
  EXPECT_EQ(wrong(line), "A: a time is negative");
  line.messages[0].jitter = 0ns;
  line.bit_rate = 0;
  EXPECT_EQ(wrong(line), "the bus has no bit rate");
  EXPECT_EQ(wrong(Line{}), "");
  EXPECT_TRUE(analyze(Line{}).good());
}

}  // namespace
}  // namespace berth::analysis

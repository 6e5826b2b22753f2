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
  line.senders = {{"a", true}, {"b"}};
  line.messages = {message("A", 0, 1, 20ms), message("B", 1, 2, 20ms), message("C", 0, 3, 20ms)};
  // A behind C, and B goes before C: B, C, A. B: one frame that has begun, and A, wherever it stands.
  EXPECT_EQ(bounds(line), (std::vector<rt::Duration>{3ms, 3ms, 3ms}));
  line.senders[0].fifo = false;
  EXPECT_EQ(bounds(line), (std::vector<rt::Duration>{2ms, 3ms, 3ms}));
}

// What waits in a FIFO before arbitration sees it comes in a burst to the others.
TEST(Response, WaitingInAFifoIsJitterToTheOthers) {
  Line line = milliseconds_line();
  line.senders = {{"a", true}, {"b"}, {"c"}};
  line.messages = {message("A", 0, 1, 4ms), message("low", 0, 9, 20ms), message("B", 1, 5, 8ms),
                   message("C", 2, 2, 20ms)};
  const auto fifo = bounds(line);
  line.senders[0].fifo = false;
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
  line.messages = {message("A", 0, 1, 0ms)};
  EXPECT_EQ(wrong(line), "A: it has no period");
  line.messages[0].period = 1ms;
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

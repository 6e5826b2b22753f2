// S2.28: what the negotiation puts on the bus, and how long a PDO waits for it.
#include <gtest/gtest.h>
#include <chrono>

#include "berth/study/negotiation_load.hpp"

namespace berth::study {
namespace {

using namespace std::chrono_literals;

double ms(rt::Duration d) { return std::chrono::duration<double, std::milli>(d).count(); }

// S2.28: a cycle has 1 + 16 + 1 frames of 67 to 78 bits, and takes 275 ms at least; two devices take two.
TEST(NegotiationLoad, TwoDevices) {
  const auto row = negotiation_load(2, 125'000, 1);
  ASSERT_TRUE(row.complete);
  EXPECT_GE(row.frames, 2 * 18U);
  EXPECT_LE(row.frames, 2 * 18U + 1 + 6) << "one answer, and frames that began before an equal one was heard";
  EXPECT_GE(row.bits, row.frames * 67);
  EXPECT_LE(row.bits, row.frames * 78);
  EXPECT_GE(ms(row.settled), 2 * 275.0);
  EXPECT_LE(ms(row.settled), 2 * 300.0);
  EXPECT_LT(row.peak_load, 0.15) << "H.2: 16 frames in 75 ms are 12.6 %";
  EXPECT_EQ(row.pdo_undisturbed, 0ms);
  EXPECT_GE(ms(row.longest_run), 67.0 / 125);
  EXPECT_LE(ms(row.longest_run), 3 * 78.0 / 125);
  EXPECT_LE(row.pdo_waited, row.longest_run + 2ms) << "no other frames than boot-up messages";
}

// S2.28: thirty at 50 kbit/s: the answers leave gaps, so that a PDO waits for a few frames and never for all of them.
TEST(NegotiationLoad, AnswersLeaveGaps) {
  const auto row = negotiation_load(30, 50'000, 1);
  ASSERT_TRUE(row.complete);
  EXPECT_LT(ms(row.longest_run), 8 * 78.0 / 50) << "thirty answers in one piece would be 45 ms";
}

// One world, one result.
TEST(NegotiationLoad, SameSeedSameRow) {
  const auto a = negotiation_load(5, 500'000, 9);
  const auto b = negotiation_load(5, 500'000, 9);
  EXPECT_EQ(a.bits, b.bits);
  EXPECT_EQ(a.settled, b.settled);
  EXPECT_EQ(a.pdo_waited, b.pdo_waited);
}

}  // namespace
}  // namespace berth::study

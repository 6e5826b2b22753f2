#include "berth/live/rate_search.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace berth::live {
namespace {

TEST(RateSearch, TheRateAtWhichFramesCome) {
  const std::vector<RateHeard> heard{{250'000, 0, 40}, {500'000, 3, 0}};
  EXPECT_EQ(decide(heard), 500'000U);
  EXPECT_TRUE(anything(heard));
}

TEST(RateSearch, OneFrameAmongErrorsMayBeChance) {
  EXPECT_FALSE(decide(std::vector<RateHeard>{{250'000, 1, 900}}));
  EXPECT_EQ(decide(std::vector<RateHeard>{{250'000, 1, 0}}), 250'000U);
  EXPECT_EQ(decide(std::vector<RateHeard>{{250'000, 2, 900}, {125'000, 3, 0}}), 125'000U);
}

TEST(RateSearch, ASilentBusIsUndecidable) {
  const std::vector<RateHeard> silent{{250'000}, {500'000}};
  EXPECT_FALSE(decide(silent));
  EXPECT_FALSE(anything(silent));
  EXPECT_FALSE(decide({}));
  EXPECT_TRUE(anything(std::vector<RateHeard>{{250'000, 0, 5}}));
}

}  // namespace
}  // namespace berth::live

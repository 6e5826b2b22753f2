// How often one search may be interrupted.
#include "berth/operate/interruptions.hpp"

#include <gtest/gtest.h>

namespace berth::operate {
namespace {

using namespace std::chrono_literals;

constexpr rt::Duration within = 60s;

struct InterruptionsOfASearch : ::testing::Test {
  // How often it is interrupted at once, at this place.
  unsigned often(const discovery::Progress& here) {
    unsigned count = 0;
    while (count < 100 && interruptions.allow(now, here, within)) ++count;
    return count;
  }
  rt::Time now{1h};
  Interruptions interruptions;
};

TEST_F(InterruptionsOfASearch, FourWhereItDoesNotGetOn) {
  EXPECT_EQ(often({.kind = 1, .swept = 0.25}), 4U);
  EXPECT_EQ(often({.kind = 1, .swept = 0.25}), 0U);
  EXPECT_EQ(often({.kind = 1, .swept = 0.125}), 0U) << "it is on its way down again";
}

TEST_F(InterruptionsOfASearch, FourMoreWhereItGotOn) {
  EXPECT_EQ(often({.kind = 1, .swept = 0.25}), 4U);
  EXPECT_EQ(often({.kind = 1, .swept = 0.5}), 4U);
  EXPECT_EQ(often({.kind = 2, .swept = 0.0}), 4U) << "the next type";
}

TEST_F(InterruptionsOfASearch, FourMoreAfterTheTime) {
  EXPECT_EQ(often({.kind = 0, .swept = 0.0}), 4U);
  now += within - 1ms;
  EXPECT_EQ(often({.kind = 0, .swept = 0.0}), 0U);
  now += 1ms;
  EXPECT_EQ(often({.kind = 0, .swept = 0.0}), 4U);
}

TEST_F(InterruptionsOfASearch, EachSearchHasItsOwn) {
  for (int search = 0; search < 20; ++search) {
    EXPECT_EQ(often({.kind = 0, .swept = 0.0}), 4U) << search;
    interruptions.search_ended();
  }
}

}  // namespace
}  // namespace berth::operate

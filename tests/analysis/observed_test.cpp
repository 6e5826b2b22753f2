// The simulated bus against the bound: whatever random machines do, no message is ever later than it.
#include "tests/analysis/observed.hpp"

#include <gtest/gtest.h>

#include <cstdio>

namespace berth::analysis {
namespace {

// Issue 15, part 8. How close the bound comes is printed.
TEST(Observed, NoMessageIsEverLaterThanItsBound) {
  Random random(20261123);
  constexpr int machines = 1000;
  std::array<std::vector<double>, 4> share;  // observed over bound, by priority: highest quarter first
  int unbounded = 0;
  for (int n = 0; n < machines; ++n) {
    const auto machine = observed::random_machine(random);
    ASSERT_EQ(wrong(machine.line), "");
    const auto seen = observed::by_priority(machine, random);
    ASSERT_EQ(seen.size(), machine.line.messages.size()) << "machine " << n << ": a frame was never sent";
    for (std::size_t rank = 0; rank < seen.size(); ++rank) {
      const auto& [latest, bound] = seen[rank];
      if (!bound) {
        ++unbounded;
        continue;
      }
      EXPECT_LE(latest.count(), bound->count()) << "machine " << n << ", message of rank " << rank;
      share[rank * 4 / seen.size()].push_back(static_cast<double>(latest.count()) /
                                              static_cast<double>(bound->count()));
    }
  }
  std::printf("observed over bound, by priority (%d machines, %d messages without a bound):", machines, unbounded);
  for (auto& quarter : share) {
    std::ranges::sort(quarter);
    std::printf("  %.2f (%.2f)", quarter[quarter.size() / 2], quarter.back());
    EXPECT_GT(quarter.back(), 0.9) << "a bound that no machine comes near says little";
  }
  std::printf("  median (most)\n");
}

}  // namespace
}  // namespace berth::analysis

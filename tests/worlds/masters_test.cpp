// Several Berths as flying masters of one bus, in random worlds.
#include <gtest/gtest.h>

#include <utility>

#include "berth/base/random.hpp"
#include "tests/harness/berths.hpp"
#include "tests/worlds/seeds.hpp"

using namespace berth;
using namespace berth::harness;
using berth::worlds::Seeds;
using berth::worlds::seeds;

// Berths die and are started again, devices lose power, the bus is cut and joined: at the end one works, every device
// is operational under its own node-ID, and none that ran was started twice.
TEST(MastersRandomWorlds, OneWorksAndNothingIsStartedTwice) {
  const Seeds range = seeds(40);
  for (std::uint64_t seed = range.from; seed < range.end(); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const auto priority = [&] { return static_cast<std::uint8_t>(random.below(3)); };
    Berths berths(five_slots(), five_slaves(seed), {priority(), priority(), priority()});
    for (std::size_t i = 0; i < 3; ++i) berths.begin(i);
    bool cut = false;
    for (int step = 0; step < 8; ++step) {
      berths.run_for(std::chrono::milliseconds(random.below(6000)));
      const auto i = random.below(3);
      switch (random.below(4)) {
        case 0: berths.runs(i) ? berths.kill(i) : berths.begin(i); break;
        case 1: {
          auto& device = *berths.world().devices()[random.below(5)];
          device.power(!device.powered());
          break;
        }
        case 2:
          if (!std::exchange(cut, true)) berths.cut(i);
          break;
        default:
          if (std::exchange(cut, false)) berths.join();
      }
    }
    berths.join();
    for (const auto& device : berths.world().devices()) device->power(true);
    for (std::size_t i = 0; i < 3; ++i) {
      if (!berths.runs(i)) berths.begin(i);
    }
    const auto good = [&] {
      unsigned leading = 0, done = 0;
      for (std::size_t i = 0; i < 3; ++i) {
        leading += berths.leads(i) ? 1U : 0U;
        done += berths.leads(i) && berths.network(i).operational() ? 1U : 0U;
      }
      return leading == 1 && done == 1;
    };
    ASSERT_TRUE(berths.run_until(good, 300s)) << berths.log();
    berths.run_for(20s);
    EXPECT_TRUE(good()) << berths.log();
    EXPECT_TRUE(berths.world().duplicates().empty());
    EXPECT_EQ(berths.second_starts, 0U) << berths.log();
  }
}

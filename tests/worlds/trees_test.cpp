// Machines of many buses in random worlds: gateways with NMT masters of their own, Berth on the backbone alone.
#include <gtest/gtest.h>

#include "tests/harness/tree_as_sold.hpp"
#include "berth/harness/tree_world.hpp"
#include "tests/worlds/seeds.hpp"

using namespace berth;
using namespace berth::harness;

// What goes wrong on any level heals on any level, no node-ID is given twice, and each loss and its end are told once.
TEST(TreesRandomWorlds, HealAndTellOnce) {
  const auto range = worlds::seeds(12);
  for (std::uint64_t seed = range.from; seed < range.end(); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const char* const frames = std::getenv("BERTH_WORLDS_FRAMES");  // of this bus, in the log of a failure
    TreeWorld world(tree_plan(seed), frames == nullptr ? "" : frames);
    EXPECT_EQ(world.go(8), "") << world.log();
  }
}

// Worlds that failed once (docs/faults.md §What these found): they run at every ./run test.
TEST(TreesRandomWorlds, KnownWorlds) {
  for (const std::uint64_t seed : {20U, 33U}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    TreeWorld world(
        tree_plan(seed, true));  // of two equal gateways the search met the one with the higher serial first
    EXPECT_EQ(world.go(8), "") << world.log();
  }
  for (const std::uint64_t seed : {77U, 820288U, 821581U, 822356U, 823933U}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    TreeWorld world(tree_plan(seed));
    EXPECT_EQ(world.go(8), "") << world.log();
  }
}

// The same with replacements, blank and used, two for one slot, sister buses with equal node-IDs beneath one gateway,
// devices of all kinds, slow ones beside quick ones. Each failed once, for another reason (docs/faults.md §What these
// found). `./run faults --trees` has more of them.
TEST(TreesRandomWorlds, KnownMixedWorlds) {
  for (const std::uint64_t seed :
       {1U,      2U,      3U,      10U,     16U,     38U,     59U,     673U,    745U,    797U,
        101323U, 102063U, 103084U, 104140U, 104681U, 106138U, 106158U, 106560U, 106969U, 200862U,
        206904U, 211399U, 214567U, 501980U, 601549U, 823150U, 822718U, 829594U, 860830U}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    TreeWorld world(mix(tree_plan(seed)));
    EXPECT_EQ(world.go(8), "") << world.log();
  }
}

// The same with devices as shops sell them (`./run faults --trees --as-sold`). 3001842: a gateway lost its power
// between the transfer of its list and that list's date, which it was given all the same; 3004610: each device of its
// maker was taken for one that says its vendor-ID alone; 3003195: those that have their node-IDs were said to wait for
// one.
TEST(TreesRandomWorlds, KnownWorldsAsSold) {
  for (const std::uint64_t seed : {3001842U, 3004610U, 3003195U}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    TreeWorld world(as_sold(mix(tree_plan(seed))));
    EXPECT_EQ(world.go(8), "") << world.log();
  }
}

// Berth dies at any frame while it brings a machine of many buses up: the next one finishes it.
TEST(TreesRandomWorlds, BerthDiesWhileItBringsThemUp) {
  const auto range = worlds::seeds(3);
  for (std::uint64_t seed = range.from; seed < range.end(); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    TreeWorld whole(tree_plan(seed));
    whole.begin();
    ASSERT_TRUE(whole.settle()) << whole.failure() << whole.log();
    Random random(seed);
    for (int i = 0; i < 3; ++i) {
      const auto k = random.below(whole.trace().size());
      SCOPED_TRACE("point " + std::to_string(k));
      TreeWorld world(tree_plan(seed));
      EXPECT_EQ(world.kill_at(k), "") << world.log();
    }
  }
}

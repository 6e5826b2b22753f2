// Runs the tests of one room. RapidCheck's seed is fixed unless the caller sets one, and printed, so that a failure
// can be had again: RC_PARAMS="seed=..." overrides.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  setenv("RC_PARAMS", "seed=20261121", 0);
  std::printf("RapidCheck: %s\n", getenv("RC_PARAMS"));
  return RUN_ALL_TESTS();
}

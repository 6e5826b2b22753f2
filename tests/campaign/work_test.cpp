// What a campaign does with a seed is what ./run faults, ./run matrix and `berth compare` do.
#include <gtest/gtest.h>
#include <string>

#include "berth/campaign/work.hpp"
#include "berth/harness/as_sold.hpp"
#include "berth/harness/example_files.hpp"
#include "berth/harness/matrix.hpp"
#include "berth/harness/run_world.hpp"
#include "berth/harness/tree_as_sold.hpp"
#include "berth/harness/tree_world.hpp"
#include "berth/study/contest.hpp"
#include "tests/harness/as_sold.hpp"

namespace berth::campaign {
namespace {

class CampaignWork : public testing::Test {
 protected:
  CampaignWork() : files_(*harness::ExampleFiles::make()) {}
  Line run(const Work& work, std::uint64_t seed) { return run_seed(work, "0.1.0", seed, files_.folders()); }
  harness::ExampleFiles files_;
};

// The worlds of ./run faults have the repository's example files, and these have the built-in ones.
TEST_F(CampaignWork, AFaultsSeedIsTheWorldOfRunFaults) {
  const std::pair<Variant, harness::Draws> rows[]{{Variant::usual, {.twins = false, .waits = false, .as_sold = true}},
                                                  {Variant::plain, {.twins = false, .waits = false, .as_sold = false}},
                                                  {Variant::twins, {.twins = true, .waits = false, .as_sold = true}},
                                                  {Variant::waits, {.twins = false, .waits = true, .as_sold = false}},
                                                  {Variant::as_sold, {.twins = false, .waits = true, .as_sold = true}}};
  for (const auto& [variant, draws] : rows) {
    for (const std::uint64_t seed : {2, 5}) {
      const auto line = run({.kind = Kind::faults, .variant = variant}, seed);
      const auto world = harness::run_world(harness::plan_world(seed, draws));
      EXPECT_EQ(line.hash, world.hash) << name(variant) << " " << seed;
      EXPECT_EQ(line.reason, world.failure);
      EXPECT_EQ(line.figures.frames, world.frames);
      EXPECT_GT(world.frames, 100U);
      ASSERT_TRUE(line.figures.bus_time_s);
      EXPECT_GE(*line.figures.bus_time_s, line.figures.operational_s.value_or(0));
    }
  }
}

TEST_F(CampaignWork, ATreesSeedIsTheTreeOfRunFaults) {
  for (const auto variant : {Variant::plain, Variant::as_sold}) {
    const auto line = run({.kind = Kind::trees, .variant = variant}, 3);
    harness::TreeWorld world(harness::plan_of_tree(
        3, {.mixed = variant != Variant::plain, .as_sold = variant == Variant::as_sold}, files_.folders().own));
    EXPECT_EQ(world.go(harness::troubles_of_a_tree), "");
    EXPECT_EQ(line.verdict, Verdict::good) << line.reason;
    EXPECT_EQ(line.hash, world.world().sim().trace_hash());
  }
}

TEST_F(CampaignWork, AMatrixSeedIsACellAndThenItsNextRound) {
  const auto cells = harness::matrix::cells_of({});
  ASSERT_EQ(round_of(Kind::matrix), cells.size());
  const Work work{.kind = Kind::matrix};
  const auto first = run(work, 1), again = run(work, 1 + cells.size());
  const auto own = harness::matrix::run(cells[0], harness::matrix::budget(cells[0]));
  EXPECT_EQ(first.cell, harness::matrix::describe(cells[0]));
  EXPECT_EQ(first.hash, own.hash);
  EXPECT_EQ(again.cell, first.cell);
  EXPECT_NE(again.hash, first.hash) << "another round has other serial numbers";
}

TEST_F(CampaignWork, ACompareSeedIsATrialOfBerthCompare) {
  const study::Contest contest;
  const auto cells = study::cells_of(contest);
  ASSERT_EQ(round_of(Kind::compare), cells.size());
  const Work work{.kind = Kind::compare};
  for (const std::uint64_t trial : {1, 2}) {
    const auto line = run(work, 1 + (trial - 1) * cells.size());
    const auto own = study::trial(cells[0], contest.response, trial);
    EXPECT_EQ(line.group, study::name(cells[0].method));
    EXPECT_EQ(line.figures.frames, own.frames);
    EXPECT_DOUBLE_EQ(*line.figures.bus_time_s, std::chrono::duration<double>(own.bus_time).count());
  }
}

TEST_F(CampaignWork, AFailureHasItsReasonAndTheLineThatShowsIt) {
  const Came bad{.group = "g", .cell = "c", .figures = {}, .hash = 7, .reason = "slot s3 is absent"};
  const auto line = line_of({.kind = Kind::faults}, "0.1.0", 11, bad);
  EXPECT_EQ(line.verdict, Verdict::failed);
  EXPECT_EQ(line.reason, "slot s3 is absent");
  EXPECT_EQ(line.replay, "berth study faults --seeds 11 --show");
  Came good = bad;
  good.reason.clear();
  EXPECT_EQ(line_of({.kind = Kind::faults}, "0.1.0", 11, good).verdict, Verdict::good);
  EXPECT_EQ(line_of({.kind = Kind::faults}, "0.1.0", 11, good).replay, "");
  const auto twins = line_without_result({.kind = Kind::faults, .variant = Variant::twins, .twice = true}, "0.1.0", 4,
                                         Verdict::crashed, "signal 6 (Aborted)");
  EXPECT_EQ(twins.replay, "berth study faults --variant twins --twice --seeds 4 --show");
  EXPECT_EQ(twins.key.options, "--variant twins --twice");
}

TEST_F(CampaignWork, TwoRunsThatDifferAreALineThatSaysSo) {
  const Work work{.kind = Kind::faults, .twice = true};
  Came first{.group = {}, .cell = {}, .figures = {}, .hash = 7, .reason = {}}, second = first;
  second.hash = 8;
  const auto hashes = line_that_differs(work, "0.1.0", 11, first, second);
  EXPECT_EQ(hashes.verdict, Verdict::differs);
  EXPECT_EQ(hashes.reason, "two runs of it differ");
  EXPECT_EQ(hashes.hash, 7U);
  EXPECT_EQ(hashes.replay, "berth study faults --twice --seeds 11 --show");
  first.reason = "slot s3 is absent";
  EXPECT_EQ(line_that_differs(work, "0.1.0", 11, first, second).reason,
            "two runs of it differ: slot s3 is absent; good");
}

TEST_F(CampaignWork, ShowTellsWhatHappens) {
  std::string log;
  const auto line =
      run_seed({.kind = Kind::faults}, "0.1.0", 2, files_.folders(), [&](const std::string& t) { log = t; });
  EXPECT_NE(log.find("7E5"), std::string::npos) << "frames of LSS";
  EXPECT_EQ(line, run({.kind = Kind::faults}, 2)) << "being shown changes nothing";
}

}  // namespace
}  // namespace berth::campaign

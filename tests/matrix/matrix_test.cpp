// The telling cells of the matrix: those at which a method, a bit rate or a size was once too much for the
// main job. All cells: ./run matrix.
#include "berth/harness/matrix.hpp"

#include <gtest/gtest.h>
#include <algorithm>
#include <string>

#include "berth/operate/report.hpp"

using namespace berth;
using namespace berth::harness::matrix;

namespace {

class Matrix : public testing::TestWithParam<Cell> {};

TEST_P(Matrix, EndsOperationalWithinItsBusTime) {
  const Cell cell = GetParam();
  ASSERT_FALSE(limit_of(cell)) << "a documented limit is no cell to test";
  const auto outcome = run(cell, budget(cell));
  EXPECT_EQ(outcome.end, End::operational)
      << describe(cell) << ": " << name(outcome.end) << " at " << operate::seconds(rt::Time{} + outcome.bus_time)
      << " s, " << outcome.operational << " operational: " << outcome.why.data();
}

std::string test_name(const testing::TestParamInfo<Cell>& info) {
  std::string text = std::string(name(info.param.kind)) + "_" + std::to_string(info.param.devices) + "_at_" +
                     std::to_string(info.param.bit_rate / 1000) + "_" + name(info.param.latency);
  if (info.param.rx_depth < 16) text += "_rx_" + std::to_string(info.param.rx_depth);
  std::ranges::replace(text, '-', '_');
  return text;
}

// What was wrong at each before: the window of a search and answers later than it; a search that ended at ten seconds;
// heartbeats that fill the bus; slots whose devices have their node-IDs already.
INSTANTIATE_TEST_SUITE_P(
    Telling, Matrix,
    testing::Values(
        Cell{Kind::lss, 2, 500'000, Latency::outliers}, Cell{Kind::lss, 5, 10'000, Latency::equal},
        Cell{Kind::lss, 30, 125'000, Latency::random}, Cell{Kind::lss, 120, 1'000'000, Latency::equal},
        Cell{Kind::rand, 126, 10'000, Latency::random}, Cell{Kind::fastscan, 60, 500'000, Latency::outliers},
        Cell{Kind::feedback_11, 126, 125'000, Latency::outliers}, Cell{Kind::feedback_29, 60, 10'000, Latency::random},
        Cell{Kind::fixed, 30, 125'000, Latency::equal}, Cell{Kind::fixed_unsaid, 1, 1'000'000, Latency::outliers},
        Cell{Kind::stored, 30, 50'000, Latency::random}, Cell{Kind::canopennode, 5, 125'000, Latency::random},
        Cell{Kind::lely, 5, 125'000, Latency::random}, Cell{Kind::mixed, 5, 125'000, Latency::random}),
    test_name);

// What was wrong at each: answers that come late once in fifty, among many devices; found devices that were searched
// for again in each part of a long search; more questions at once than the bus carries.
INSTANTIATE_TEST_SUITE_P(Late, Matrix,
                         testing::Values(Cell{Kind::lss, 60, 125'000, Latency::outliers},
                                         Cell{Kind::canopennode, 60, 125'000, Latency::random},
                                         Cell{Kind::lely, 60, 500'000, Latency::random},
                                         Cell{Kind::mixed, 60, 125'000, Latency::random},
                                         Cell{Kind::mixed, 120, 1'000'000, Latency::outliers},
                                         Cell{Kind::feedback_29, 126, 10'000, Latency::equal},
                                         Cell{Kind::stored, 60, 10'000, Latency::random}),
                         test_name);

class AgainstPublished : public testing::TestWithParam<Cell> {};

TEST_P(AgainstPublished, TheDefaultIsNeverMuchSlower) {
  const Cell mine = GetParam();
  const auto own = run(mine, budget(mine));
  ASSERT_EQ(own.end, End::operational) << own.why.data();
  for (const auto method : published(mine.kind)) {
    Cell theirs = mine;
    theirs.method = method;
    const auto other = run(theirs, budget(mine));
    if (other.end != End::operational) continue;
    EXPECT_LE(10 * own.bus_time, 11 * other.bus_time) << describe(mine) << ", " << method;
  }
}

// What was wrong at each: a window that ended before the answer's frame did; a window that was learnt from the gaps
// between many devices' answers; a device that was told to be identified and not known.
INSTANTIATE_TEST_SUITE_P(Windows, AgainstPublished,
                         testing::Values(Cell{Kind::rand, 1, 10'000, Latency::equal},
                                         Cell{Kind::rand, 2, 50'000, Latency::wide},
                                         Cell{Kind::rand, 60, 1'000'000, Latency::wide},
                                         Cell{Kind::rand, 120, 10'000, Latency::wide},
                                         Cell{Kind::rand, 126, 125'000, Latency::wide}),
                         test_name);

// Services of LSS that devices lack, alone, several, and beside whole ones.
INSTANTIATE_TEST_SUITE_P(
    Lacking, Matrix,
    testing::Values(
        Cell{Kind::no_identity, 1, 125'000, Latency::equal}, Cell{Kind::no_identity, 5, 125'000, Latency::random},
        Cell{Kind::no_node_id, 2, 125'000, Latency::random}, Cell{Kind::no_inquiries, 1, 125'000, Latency::equal},
        Cell{Kind::no_inquiries, 5, 125'000, Latency::outliers}, Cell{Kind::bare, 1, 125'000, Latency::random},
        Cell{Kind::bare, 5, 125'000, Latency::equal}, Cell{Kind::fastscan_alone, 2, 125'000, Latency::equal},
        Cell{Kind::partial, 5, 125'000, Latency::equal}, Cell{Kind::refuses_store, 2, 125'000, Latency::random},
        Cell{Kind::short_answers, 5, 125'000, Latency::random}, Cell{Kind::stored_bare, 5, 125'000, Latency::equal}),
    test_name);

// Receive buffers that hold one frame, or two: what comes back to back is lost.
INSTANTIATE_TEST_SUITE_P(SmallBuffers, Matrix,
                         testing::Values(Cell{Kind::lss, 5, 125'000, Latency::equal, 1},
                                         Cell{Kind::lss, 5, 125'000, Latency::random, 2},
                                         Cell{Kind::fastscan, 5, 125'000, Latency::random, 1},
                                         Cell{Kind::lely, 5, 125'000, Latency::equal, 1}),
                         test_name);

}  // namespace

// `berth compare`: each method finds and binds blank devices, and a cell that does not says so.
#include "berth/study/contest.hpp"

#include <gtest/gtest.h>
#include <chrono>
#include <string>
#include <vector>

#include <algorithm>

#include "berth/study/formulas.hpp"

namespace berth::study {
namespace {

using namespace std::chrono_literals;

TEST(Contest, EveryMethodHasItsName) {
  std::vector<std::string> names;
  for (const auto& each : contestants()) {
    names.emplace_back(name(each));
    ASSERT_TRUE(contestant(names.back()));
    EXPECT_EQ(*contestant(names.back()), each);
  }
  EXPECT_EQ(names, (std::vector<std::string>{"rand", "and", "fastscan", "fastscan-feedback-29", "fastscan-feedback-11",
                                             "identify", "negotiation", "planner-rand", "planner-fastscan",
                                             "planner-feedback"}));
  EXPECT_FALSE(contestant("telepathy"));
}

class EachMethod : public ::testing::TestWithParam<Serials> {};

TEST_P(EachMethod, FindsAndBindsFiveDevices) {
  for (const auto& method : contestants()) {
    const auto t =
        trial(method, {.devices = 5, .serials = GetParam(), .speaks = speaks(method), .response = {200us, 2ms, 0, 0ms}},
              125'000);
    EXPECT_EQ(t.found, 5U) << name(method) << " " << t.trouble;
    EXPECT_EQ(t.bound, 5U) << name(method) << " " << t.trouble;
    EXPECT_GT(t.frames, 10U) << name(method);
    EXPECT_GT(t.bits, t.frames * 47) << name(method) << ": no frame is shorter";
    EXPECT_GT(t.bus_time, time_of(static_cast<unsigned>(t.bits), 125'000)) << name(method);
  }
}
INSTANTIATE_TEST_SUITE_P(Serials, EachMethod, ::testing::Values(Serials::consecutive, Serials::random, Serials::mixed),
                         [](const auto& each) { return std::string(name(each.param)); });

// One Fastscan device: 129 to 133 requests with their windows of 10 ms (paper 2), and the closing 80h.
TEST(Contest, PublishedFastscanKeepsItsWindow) {
  const auto method = contestant("fastscan").value();
  const auto t = trial(method, {.speaks = speaks(method), .response = {500us, 500us, 0, 0ms}}, 125'000);
  EXPECT_GE(t.bus_time, 130 * 10ms);
  EXPECT_LT(t.bus_time, 140 * 12ms);
}

// A device that takes longer than the published window is not found, and the cell says so.
TEST(Contest, WhoIsTooSlowIsNotFound) {
  Contest contest;
  contest.methods = {contestant("fastscan").value()};
  contest.devices = {2};
  contest.bit_rates = {125'000};
  contest.serials = {Serials::random};
  contest.seeds = 1;
  contest.response = {.min = 30ms, .max = 30ms};
  const auto cells = compare(contest, 1);
  ASSERT_EQ(cells.size(), 1U);
  EXPECT_LT(cells[0].found, 2U);
  EXPECT_LT(cells[0].bound, 2U);
}

TEST(Contest, ThreadsDoNotMatter) {
  Contest contest;
  contest.methods = {contestant("planner-feedback").value(), contestant("planner-rand").value()};
  contest.devices = {1, 7};
  contest.bit_rates = {125'000};
  contest.seeds = 2;
  std::size_t calls = 0;
  const auto one = compare(contest, 1, [&](std::size_t, std::size_t all) {
    ++calls;
    EXPECT_EQ(all, 12U);
  });
  const auto three = compare(contest, 3);
  EXPECT_EQ(calls, 12U);
  ASSERT_EQ(one.size(), three.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].bus_time, three[i].bus_time) << i;
    EXPECT_EQ(one[i].worst, three[i].worst) << i;
    EXPECT_EQ(one[i].frames, three[i].frames) << i;
    EXPECT_GE(one[i].worst, one[i].bus_time) << i;
  }
}

TEST(Contest, PlotHasALineForEachMethodAndPanel) {
  std::vector<Cell> cells;
  for (const auto& method : {contestant("rand").value(), contestant("planner-rand").value()}) {
    for (const unsigned devices : {1U, 30U}) {
      for (const auto serials : {Serials::consecutive, Serials::random}) {
        cells.push_back({.method = method,
                         .devices = devices,
                         .bit_rate = 50'000,
                         .serials = serials,
                         .bus_time = devices * 100ms,
                         .found = devices,
                         .bound = devices == 30 ? 29 : devices});
      }
    }
  }
  const auto svg = plot(cells);
  const auto count = [&](const std::string& what) {
    std::size_t n = 0;
    for (auto at = svg.find(what); at != std::string::npos; at = svg.find(what, at + 1)) ++n;
    return n;
  };
  EXPECT_TRUE(svg.starts_with("<svg ")) << svg.substr(0, 80);
  EXPECT_TRUE(svg.ends_with("</svg>\n"));
  EXPECT_EQ(count("<polyline"), 4U);
  EXPECT_EQ(count("fill=\"white\" stroke"), 4U) << "30 devices, 29 bound: hollow";
  EXPECT_EQ(count("nan"), 0U);
  EXPECT_EQ(count("<text"), count("</text>"));
  EXPECT_TRUE(plot({}).ends_with("</svg>\n"));
}

}  // namespace
}  // namespace berth::study

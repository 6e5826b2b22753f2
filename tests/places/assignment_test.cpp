// Which devices have only one place: judged by trying every assignment.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <optional>
#include <vector>

#include "../pch.hpp"
#include "berth/places/assignment.hpp"

namespace berth::places {
namespace {

using Choice = std::vector<std::optional<std::size_t>>;

// Every assignment of devices to slots, each slot once.
void each_assignment(const FitGraph& graph, std::size_t device, std::vector<bool>& used, Choice& choice,
                     const std::function<void(const Choice&)>& visit) {
  if (device == graph.fits.size()) return visit(choice);
  choice[device].reset();
  each_assignment(graph, device + 1, used, choice, visit);
  for (const std::size_t slot : graph.fits[device]) {
    if (used[slot]) continue;
    used[slot] = true;
    choice[device] = slot;
    each_assignment(graph, device + 1, used, choice, visit);
    used[slot] = false;
  }
  choice[device].reset();
}

Choice tried(const FitGraph& graph) {
  std::size_t most = 0;
  std::vector<Choice> best;
  std::vector<bool> used(graph.slots, false);
  Choice choice(graph.fits.size());
  each_assignment(graph, 0, used, choice, [&](const Choice& c) {
    const auto seated = static_cast<std::size_t>(std::ranges::count_if(c, [](const auto& s) { return s.has_value(); }));
    if (seated > most) best.clear();
    most = std::max(most, seated);
    if (seated == most) best.push_back(c);
  });
  Choice only = best.front();
  for (const auto& c : best) {
    for (std::size_t d = 0; d < c.size(); ++d) {
      if (only[d] != c[d]) only[d].reset();
    }
  }
  return only;
}

RC_GTEST_PROP(Assignment, OnlyPlacesAreThoseOfEveryLargestAssignment, ()) {
  FitGraph graph;
  graph.slots = *rc::gen::inRange<std::size_t>(0, 5);
  const auto devices = *rc::gen::inRange<std::size_t>(0, 5);
  for (std::size_t d = 0; d < devices; ++d) {
    std::vector<std::size_t> slots;
    for (std::size_t s = 0; s < graph.slots; ++s) {
      if (*rc::gen::inRange(0, 3) == 0) slots.push_back(s);
    }
    graph.fits.push_back(slots);
  }
  RC_ASSERT(only_places(graph) == tried(graph));
}

// The first of all whole assignments, slot by slot, of those that were tried.
RC_GTEST_PROP(Assignment, PairsInOrderAreTheFirstWholeAssignment, ()) {
  FitGraph graph;
  graph.slots = *rc::gen::inRange<std::size_t>(0, 6);
  for (std::size_t d = 0; d < graph.slots; ++d) {
    std::vector<std::size_t> slots;
    for (std::size_t s = 0; s < graph.slots; ++s) {
      if (*rc::gen::inRange(0, 3) != 0) slots.push_back(s);
    }
    graph.fits.push_back(slots);
  }
  std::optional<std::vector<std::size_t>> first;
  std::vector<bool> used(graph.slots, false);
  Choice choice(graph.fits.size());
  each_assignment(graph, 0, used, choice, [&](const Choice& c) {
    std::vector<std::size_t> device_of(graph.slots);
    for (std::size_t d = 0; d < c.size(); ++d) {
      if (!c[d]) return;
      device_of[*c[d]] = d;
    }
    if (!first || device_of < *first) first = device_of;
  });
  RC_ASSERT(pairs_in_order(graph) == first);
}

TEST(Assignment, ComponentsHangTogetherBySlots) {
  const FitGraph graph{5, {{0, 1}, {3}, {1, 2}, {}}};
  const auto parts = components(graph);
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].devices, (std::vector<std::size_t>{0, 2}));
  EXPECT_EQ(parts[0].slots, (std::vector<std::size_t>{0, 1, 2}));
  EXPECT_EQ(parts[1].devices, (std::vector<std::size_t>{1}));
  EXPECT_EQ(parts[1].slots, (std::vector<std::size_t>{3}));
}

// 127 of one type are 127 times 127 edges, and no device has only one place.
TEST(Assignment, ABusFullOfOneType) {
  FitGraph graph{127, {}};
  for (std::size_t d = 0; d < 127; ++d) {
    graph.fits.emplace_back();
    for (std::size_t s = 0; s < 127; ++s) graph.fits.back().push_back(s);
  }
  EXPECT_TRUE(std::ranges::none_of(only_places(graph), [](const auto& p) { return p.has_value(); }));
  EXPECT_EQ(components(graph).size(), 1U);
}

}  // namespace
}  // namespace berth::places

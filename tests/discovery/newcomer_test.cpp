// What was learnt of the devices that were found says nothing of one that comes later: it may need as long as any.
#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <string>

#include "discovery_world.hpp"

namespace berth::discovery::test::newcomer_tests {
namespace {

constexpr TypeCode type{2, 3};

NodeOptions device(std::uint32_t serial, rt::Duration least, rt::Duration most, bool fastscan) {
  NodeOptions o;
  o.address = {type.vendor, type.product, 0, serial};
  o.fastscan = fastscan;
  o.timing = {.response_min = least, .response_max = most};
  return o;
}

class Newcomer : public testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(All, Newcomer,
                         testing::Values(Method::planner_fastscan, Method::planner_feedback, Method::identify));

}  // namespace

// One master, one search after the other. However many quick devices it has found, and whether they are still there, a
// slow one that comes is found too, by the next search.
TEST_P(Newcomer, IsFoundHoweverSlowItIs) {
  const bool fastscan = GetParam() != Method::identify;
  for (const rt::Duration before : {200us, 1000us}) {
    for (const unsigned count : {1U, 3U}) {
      for (const auto& [least, most] :
           {std::pair{1ms, 1ms}, std::pair{2ms, 2ms}, std::pair{5ms, 5ms}, std::pair{9ms, 9ms}, std::pair{0ms, 9ms}}) {
        for (const bool gone : {false, true}) {
          SCOPED_TRACE(std::to_string(before.count()) + " ns, " + std::to_string(count) + " devices, then " +
                       std::to_string(least.count()) + " to " + std::to_string(most.count()) + " ms" +
                       (gone ? ", alone" : ""));
          World w;
          for (unsigned i = 0; i < count; ++i) {
            w.add(device(0x1000'0000U * (i % 15) + 77 * i + 11, before, before, fastscan));
          }
          Giver giver;
          w.known.kinds = {{type, std::nullopt}};
          w.options.assigner = &giver;
          w.options.configured = false;
          const auto discovery = make(GetParam(), w.services());
          for (int search = 0; search < 70; ++search) {
            w.known.registered.clear();
            giver.next = 1;
            for (const auto& node : w.nodes) node->restart();  // blank again
            const auto first = w.run(discovery->find(w.known, w.options));
            ASSERT_TRUE(first);
            ASSERT_EQ(first->found.size(), count);
            for (const auto& d : first->found) w.known.registered.push_back(d.address);
          }
          if (gone) w.known.registered.clear();
          for (const auto& node : w.nodes) node->power(!gone);
          Node& slow = w.add(device(12, least, most, fastscan));
          const auto second = w.run(discovery->find(w.known, w.options));
          ASSERT_TRUE(second);
          EXPECT_TRUE(slow.id().configured()) << name(second->end);
          w.expect_right(giver);
        }
      }
    }
  }
}

}  // namespace berth::discovery::test::newcomer_tests

// 5Eh is the last question before a device that was found gets its node-ID. One that was left in LSS configuration and
// heard nothing of the proof may hear it, and would hear the 11h too (S1.53).
#include <gtest/gtest.h>

#include "tests/discovery/discovery_world.hpp"

using namespace berth;
using namespace berth::discovery;
using namespace berth::discovery::test;

namespace last_question_tests {
namespace {

constexpr LssAddress one{1, 2, 3, 0x4444};
constexpr LssAddress left_over{1, 2, 3, 0x9999};

class LastQuestion : public testing::TestWithParam<Method> {};

TEST_P(LastQuestion, S1_53_WhoHearsThatAloneIsToldNoNodeId) {
  for (const auto late : {2ms, 3ms, 4ms, 5ms}) {
    World w;
    NodeOptions like;
    like.address = one;
    w.add(like);
    like.address = left_over;
    like.node_id = NodeId(77);
    like.timing = {.response_min = late, .response_max = late + 500us};
    Node& left = w.add(like);
    left.slave.handle(lss::request(lss::Command::switch_global, 1));
    bool hears = false;
    unsigned told = 0;
    left.overhears = [&](const can::Frame& f) {
      hears = hears || lss::command(f) == lss::Command::inquire_node_id;
      const bool given = lss::command(f) == lss::Command::configure_node_id && f.data[1] != NodeId::unconfigured_value;
      if (hears && given && left.slave.state() == lss::State::configuration) ++told;
      return !hears;
    };
    w.known.kinds = {{{1, 2}, 3}};
    w.options.confirm = true;
    Giver giver;
    w.options.assigner = &giver;
    const auto report = w.find(GetParam());
    ASSERT_TRUE(report) << describe(report.error());
    EXPECT_EQ(told, 0U) << late.count();
    EXPECT_EQ(left.slave.pending().node_id, NodeId(77)) << late.count();
    EXPECT_TRUE(hears);
  }
}

INSTANTIATE_TEST_SUITE_P(All, LastQuestion,
                         testing::Values(Method::planner_fastscan, Method::planner_feedback, Method::identify,
                                         Method::fastscan),
                         [](const auto& info) {
                           std::string text(name(info.param));
                           std::ranges::replace(text, '-', '_');
                           return text;
                         });

}  // namespace
}  // namespace last_question_tests

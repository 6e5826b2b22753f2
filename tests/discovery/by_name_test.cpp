// Node-IDs that are given by name, by every method: only to a device that is proven to be alone in configuration.
#include <gtest/gtest.h>
#include <algorithm>
#include <string>

#include "discovery_world.hpp"

namespace berth::discovery {
namespace {

using namespace test;

constexpr LssAddress first{0x0100'0001, 0x11, 0x0001'0000, 0x10};
constexpr LssAddress second{0x0100'0001, 0x11, 0x0001'0000, 0x11};
constexpr LssAddress same_serial{0x0100'0001, 0x12, 0x0001'0000, 0x10};

bool is_waiting_request(const can::Frame& f) {
  return lss::is_lss(f, lss::master_cob_id) && lss::command(f) == lss::Command::switch_global && f.data[1] == 0;
}
// Loses so many `04 00` after it was given a node-ID.
void loses_waiting(Node& node, unsigned times) {
  node.overhears = [&node, times](const can::Frame& f) mutable {
    const bool lost = is_waiting_request(f) && node.slave.pending().node_id.configured() &&
                      node.slave.state() == lss::State::configuration && times > 0;
    if (lost) --times;
    return lost;
  };
}

struct ByName : ::testing::TestWithParam<Method> {
  World w;
  Giver giver;
  NodeOptions how(const LssAddress& address) const {
    const bool rand = GetParam() == Method::rand || GetParam() == Method::planner_rand;
    return {.address = address, .fastscan = !rand && GetParam() != Method::identify, .rand = rand};
  }
  Result<Report> find(std::initializer_list<LssAddress> kinds) {
    w.options.assigner = &giver;
    for (const auto& a : kinds) w.known.kinds.push_back({a.type(), {}});
    return w.find(GetParam());
  }
};

// `04 00` is lost at the first; the second's 11h must not be executed by both.
TEST_P(ByName, TwoNeverTakeOneNodeIdThoughWaitingIsLost) {
  for (const unsigned times : {1U, 2U, 3U, 5U}) {
    World fresh;
    Giver gives;
    fresh.add(how(first));
    fresh.add(how(second));
    loses_waiting(*fresh.nodes[0], times);
    fresh.options.assigner = &gives;
    fresh.options.confirm = true;
    fresh.known.kinds = {{first.type(), {}}};
    const auto report = fresh.find(GetParam());
    ASSERT_TRUE(report);
    fresh.world.run_for(100ms);
    EXPECT_NE(fresh.nodes[0]->slave.pending().node_id, fresh.nodes[1]->slave.pending().node_id) << times;
    fresh.expect_right(gives);
  }
}

// One whose serial number another has too: their answers to 5Dh fall into one frame.
TEST_P(ByName, OneSerialNumberInTwoProducts) {
  const auto equal = device::Timing{.response_min = 1ms, .response_max = 1ms};
  auto one = how(first);
  auto other = how(same_serial);
  one.timing = other.timing = equal;
  w.add(one);
  w.add(other);
  loses_waiting(*w.nodes[0], 2);
  w.options.confirm = true;
  const auto report = find({first, same_serial});
  ASSERT_TRUE(report);
  w.world.run_for(100ms);
  EXPECT_NE(w.nodes[0]->slave.pending().node_id, w.nodes[1]->slave.pending().node_id);
  w.expect_right(giver);
}

INSTANTIATE_TEST_SUITE_P(Methods, ByName,
                         testing::Values(Method::rand, Method::planner_rand, Method::identify, Method::fastscan,
                                         Method::planner_fastscan),
                         [](const auto& tested) {
                           std::string text(name(tested.param));
                           std::ranges::replace(text, '-', '_');
                           return text;
                         });

}  // namespace
}  // namespace berth::discovery

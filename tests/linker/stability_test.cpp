// What does not change: plans of the same links in another order, and of links that come and go.
#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <map>

#include "berth/linker/plan_file.hpp"
#include "tests/linker/devices.hpp"

using namespace berth;
using namespace berth::test;
using namespace std::chrono_literals;
using linker::make_plan;

namespace {

/// Where a value of a consumer comes from: TPDO, CAN-ID, RPDO.
using Way = std::tuple<std::size_t, unsigned, unsigned, unsigned>;

/// By link and consumer.
std::map<std::string, Way> ways(const linker::LinkNetwork& network, const linker::Plan& plan) {
  std::map<std::string, Way> made;
  for (const auto& pdo : plan.pdos) {
    for (const std::size_t index : pdo.links) {
      const auto& link = network.links[index];
      for (const auto& to : link.to) {
        const auto receiver = std::ranges::find(pdo.receivers, to.node, &linker::Receiver::node);
        if (receiver == pdo.receivers.end()) continue;
        // One of another type or deadline is another link.
        const auto what = std::to_string(static_cast<int>(link.type.value_or(od::DataType::none))) + " " +
                          std::to_string(link.deadline.value_or(rt::Duration(0)).count()) + " ";
        made[what + network.nodes[link.from.node].name + "/" + link.from.object + ">" + network.nodes[to.node].name +
             "/" + to.object] = {pdo.producer, pdo.tpdo, pdo.can_id, receiver->rpdo};
      }
    }
  }
  return made;
}

void shuffle(linker::LinkNetwork& network, Random& random) {
  for (std::size_t i = network.links.size(); i > 1; --i)
    std::swap(network.links[i - 1], network.links[random.below(i)]);
}

/// Without what the order of the links numbers.
linker::Plan without_links(linker::Plan plan) {
  for (auto& pdo : plan.pdos) pdo.links.clear();
  return plan;
}

}  // namespace

RC_GTEST_PROP(LinkStability, TheOrderOfTheLinksDoesNotCount, ()) {
  Random random(*rc::gen::arbitrary<std::uint64_t>());
  auto network = random_network(random, *rc::gen::inRange(1U, 60U));
  const auto first = make_plan(network);
  const auto earlier = linker::earlier_of(network, first.plan);
  add_random_links(network, random, 10);
  const auto grown = make_plan(network, earlier);
  shuffle(network, random);
  const auto shuffled = make_plan(network, earlier);
  RC_ASSERT(grown.good() == shuffled.good());
  RC_ASSERT(without_links(grown.plan) == without_links(shuffled.plan));
}

RC_GTEST_PROP(LinkStability, TheSameLinksAgainAreTheSamePlan, ()) {
  Random random(*rc::gen::arbitrary<std::uint64_t>());
  const auto network = random_network(random, *rc::gen::inRange(1U, 80U));
  const auto first = make_plan(network);
  if (!first.good()) RC_DISCARD("no room");
  RC_ASSERT(make_plan(network, linker::earlier_of(network, first.plan)).plan == first.plan);
}

RC_GTEST_PROP(LinkStability, UnchangedLinksKeepPdosAndCanIds, ()) {
  Random random(*rc::gen::arbitrary<std::uint64_t>());
  auto network = random_network(random, *rc::gen::inRange(1U, 60U));
  const auto first = make_plan(network);
  if (!first.good()) RC_DISCARD("no room");
  auto before = ways(network, first.plan);
  auto earlier = linker::earlier_of(network, first.plan);
  for (unsigned step = 0; step < 3; ++step) {
    std::erase_if(network.links, [&](const auto&) { return random.below(4) == 0; });
    add_random_links(network, random, static_cast<unsigned>(random.below(15)));
    const auto next = make_plan(network, earlier);
    const auto after = ways(network, next.plan);
    std::size_t kept = 0;
    for (const auto& [link, way] : after) {
      const auto old = before.find(link);
      if (old == before.end()) continue;
      ++kept;
      if (way != old->second) RC_LOG(link);
      RC_ASSERT(way == old->second);
    }
    RC_TAG(kept > 0 ? "kept" : "none kept");
    if (!next.good()) return;
    before = after;
    earlier = linker::earlier_of(network, next.plan);
  }
}

RC_GTEST_PROP(LinkStability, APlanFileBringsThePlanBack, ()) {
  Random random(*rc::gen::arbitrary<std::uint64_t>());
  const auto network = random_network(random, *rc::gen::inRange(0U, 60U));
  const auto earlier = linker::earlier_of(network, make_plan(network).plan);
  Findings findings;
  const auto again = linker::read_plan(linker::write(earlier), "plan.toml", findings);
  RC_ASSERT(again.has_value());
  RC_ASSERT(*again == earlier);
}

TEST(LinkStability, AnEarlierPlanOfAnotherMachineIsPassedOver) {
  auto network = network_of({{"press", file_of(controller())}, {"belt", file_of(controller())}});
  add_link(network, "press/a", {"belt/a"}, 20ms, 255, od::DataType::unsigned8);
  linker::Earlier odd;
  odd.variables = {{"press", "a", od::DataType::unsigned8, true, {0x1000, 0}},
                   {"no", "a", od::DataType::unsigned8, true, {}}};
  odd.pdos = {
      {.producer = "press", .tpdo = 500, .can_id = 0x181, .objects = {{0xA040, 1}}},
      {.producer = "nobody", .tpdo = 1, .can_id = 0x181},
      {.producer = "press", .tpdo = 2, .can_id = 0x601, .objects = {{0xA040, 1}}, .receivers = {{"belt", 400}}}};
  const auto made = make_plan(network, odd);
  ASSERT_TRUE(made.good());
  ASSERT_EQ(made.plan.pdos.size(), 1U);
  EXPECT_EQ(made.plan.pdos[0].tpdo, 2);
  EXPECT_EQ(made.plan.pdos[0].can_id, 0x281) << "601h belongs to SDO";
  EXPECT_EQ(made.plan.pdos[0].receivers[0].rpdo, 1);
}

TEST(LinkStability, ADeadlineThatChangesMovesNothing) {
  auto network = conveyor();
  const auto first = make_plan(network);
  ASSERT_TRUE(first.good());
  network.links[7].deadline = 60ms;
  const auto next = make_plan(network, linker::earlier_of(network, first.plan));
  ASSERT_TRUE(next.good());
  EXPECT_EQ(ways(network, next.plan), ways(network, first.plan)) << "both are named with the new deadline";
}

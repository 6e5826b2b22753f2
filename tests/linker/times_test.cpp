// Inhibit times and bounds: what fits is found, and what has no least interval has no bound.
#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include "berth/linker/bounds.hpp"
#include "tests/linker/devices.hpp"

using namespace berth;
using namespace berth::test;
using namespace std::chrono_literals;
using linker::make_plan;

namespace {

std::string told(const linker::Planned& planned) {
  std::string text;
  for (const auto& each : planned.findings) text += to_string(each) + "\n";
  return text;
}

linker::LinkNetwork many(unsigned nodes, const std::shared_ptr<const eds::File>& file) {
  std::vector<std::pair<std::string, std::shared_ptr<const eds::File>>> all;
  for (unsigned i = 0; i < nodes; ++i) all.emplace_back("d" + std::to_string(i + 1), file);
  auto network = network_of(std::move(all));
  network.buses[0].others.bit_rate = 125'000;
  return network;
}

/// Each node's EMCY, one a second: they all go before any PDO.
void add_emcys(linker::LinkNetwork& network) {
  auto& others = network.buses[0].others;
  for (std::size_t i = 0; i < network.nodes.size(); ++i) {
    others.messages.push_back(
        {.name = "EMCY", .sender = i, .key = 0x80U + network.nodes[i].id.value(), .data_bytes = 8, .period = 1s});
  }
}

}  // namespace

// Twelve EMCYs and the frame take 15 ms of 20: D/2 does not fit, a shorter inhibit time does.
TEST(LinkTimes, AnInhibitTimeThatFitsIsFound) {
  auto network = many(12, file_of(controller()));
  add_emcys(network);
  add_link(network, "d1/v", {"d2/w"}, 20ms, linker::at_change, od::DataType::unsigned16);
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << told(made);
  const auto& pdo = made.plan.pdos.at(0);
  EXPECT_GT(pdo.inhibit, 0U);
  EXPECT_LT(pdo.inhibit, 100U) << "less than half of the deadline";
  ASSERT_TRUE(pdo.worst);
  EXPECT_LE(*pdo.worst, rt::Duration(20ms));
  EXPECT_GT(*pdo.worst, rt::Duration(19'900us)) << "as long as it may be";
}

// Its frame may come behind the SYNC that is next: the one behind that is in time for a second.
TEST(LinkTimes, ASynchronousLinkMayTakeMoreThanOneSync) {
  auto network = many(12, file_of(controller()));
  add_emcys(network);
  network.buses[0].sync = 10ms;
  network.buses[0].others.messages.push_back(
      {.name = "SYNC", .sender = 0, .key = 0x80, .data_bytes = 0, .period = 10ms});
  add_link(network, "d1/v", {"d2/w"}, 1s, 1, od::DataType::unsigned16);
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << told(made);
  // To the SYNC, behind the next, and counts at the third; and that waits for a frame that has begun.
  EXPECT_GT(made.plan.pdos.at(0).worst, rt::Duration(31ms));
  EXPECT_LT(made.plan.pdos.at(0).worst, rt::Duration(32ms));
  network.links[0].deadline = 25ms;
  EXPECT_FALSE(make_plan(network).good());
  network.links[0].deadline.reset();
  EXPECT_TRUE(make_plan(network).good());
}

TEST(LinkTimes, WhatComesAtAnyTimeHasNoBound) {
  auto spec = controller();
  spec.timers = false;
  const auto without = file_of(spec);
  auto network = network_of({{"a", without}, {"b", file_of(controller())}});
  add_link(network, "a/v", {"b/w"}, 100ms, linker::at_change, od::DataType::unsigned32);
  const auto endless = make_plan(network);
  ASSERT_FALSE(endless.good());
  EXPECT_NE(told(endless).find("a/TPDO 1: 181h is sent at each change"), std::string::npos) << told(endless);
  auto by_slot = network;
  by_slot.nodes[0].interval = 5ms;
  EXPECT_TRUE(make_plan(by_slot).good()) << "its slot says what it keeps";
  network.links[0].inhibit = 5ms;
  const auto by_link = make_plan(network);
  EXPECT_TRUE(by_link.good()) << told(by_link);
  EXPECT_EQ(by_link.plan.pdos.at(0).inhibit, 0U) << "there is no object to write";
}

TEST(LinkTimes, TheInhibitTimeOfALinkIsTaken) {
  auto network = network_of({{"a", file_of(controller())}, {"b", file_of(controller())}});
  add_link(network, "a/v", {"b/w"}, 100ms, linker::at_change, od::DataType::unsigned32);
  network.links[0].inhibit = 7ms;
  EXPECT_EQ(make_plan(network).plan.pdos.at(0).inhibit, 70U);
  network.links[0].inhibit = 100ms;
  EXPECT_FALSE(make_plan(network).good()) << "nothing is left for the bus";
}

// 12 devices of which one has 40 objects for each of the others, 5 ms apart: 116 % is no plan.
TEST(LinkTimes, MoreThanTheWholeBusIsRefused) {
  auto network = many(3, file_of(controller()));
  auto& others = network.buses[0].others;
  for (unsigned i = 0; i < 11; ++i) {
    others.messages.push_back(
        {.name = "TPDO", .sender = 2, .key = 0x600U + i, .data_bytes = 8, .period = 10ms});  // behind all of ours
  }
  add_link(network, "d1/v", {"d2/w"}, 500ms, linker::at_change, od::DataType::unsigned16);
  const auto made = make_plan(network);
  EXPECT_FALSE(made.good()) << made.plan.buses.at(0).load;
  EXPECT_GT(made.plan.buses.at(0).load, 1.0);
  others.messages.resize(others.messages.size() - 4);
  EXPECT_TRUE(make_plan(network).good()) << told(make_plan(network));
}

namespace {

/// Whether all deadlines of these PDOs are kept with inhibit times from `random`, each within its deadline.
bool fits(const linker::LinkNetwork& network, const linker::Plan& plan, Random& random) {
  analysis::Line line = network.buses[0].others;
  for (const auto& pdo : plan.pdos) {
    if (!pdo.deadline) return false;
    const auto most = static_cast<std::uint64_t>(*pdo.deadline / linker::inhibit_unit);
    const rt::Duration inhibit = linker::inhibit_unit * static_cast<std::int64_t>(random.between(most / 8 + 1, most));
    line.messages.push_back(
        {.name = "TPDO", .sender = pdo.producer, .key = pdo.can_id, .data_bytes = pdo.bytes(), .period = inhibit});
    linker::set_sending(line.messages.back(), {.inhibit = inhibit}, true, pdo.deadline);
  }
  double load = 0;
  for (const auto& message : line.messages) {
    const auto frame = analysis::frame_time(line, false, message.data_bytes);
    load += static_cast<double>(frame.count()) / static_cast<double>(message.period.count());
  }
  if (load > 0.9) return false;  // long to work out, and no plan
  const auto result = analysis::analyze(line);
  return result.load <= 1 && std::ranges::all_of(result.responses, [&](const auto& r) {
           return r.message < network.buses[0].others.messages.size() || (r.worst && r.meets_deadline);
         });
}

}  // namespace

// By the analysis itself: whoever was refused cannot be helped by other inhibit times.
TEST(LinkTimes, NoneIsRefusedThatFits) {
  Random random(20261129);
  const auto plc = file_of(controller());
  unsigned refused = 0;
  for (unsigned machine = 0; machine < 40; ++machine) {
    auto network = many(6, plc);
    add_emcys(network);
    for (std::size_t i = 0; i < network.nodes.size(); ++i) {
      const bool in_order = random.chance(500'000);
      network.buses[0].others.senders[i].queue = in_order ? analysis::Queue::in_order : analysis::Queue::priority;
    }
    for (unsigned link = 0; link < 6; ++link) {
      const auto from = random.between(1, 6);
      const auto to = from % 6 + 1;
      add_link(network, "d" + std::to_string(from) + "/v" + std::to_string(link),
               {"d" + std::to_string(to) + "/w" + std::to_string(link)},
               rt::Duration(1ms) * static_cast<std::int64_t>(random.between(9, 60)), linker::at_change,
               od::DataType::unsigned64);
    }
    const auto made = make_plan(network);
    if (made.good()) continue;
    ++refused;
    for (unsigned attempt = 0; attempt < 40; ++attempt)
      ASSERT_FALSE(fits(network, made.plan, random)) << "machine " << machine << "\n" << told(made);
  }
  EXPECT_GE(refused, 5U) << "the test has something to say";
  EXPECT_LE(refused, 35U);
}

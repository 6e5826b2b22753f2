// LSS identify ranges as a search: devices without Fastscan, and devices that have a node-ID (HU.1).
#include "berth/discovery/identify.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "discovery_world.hpp"

namespace berth::discovery::test::identify_tests {
namespace {

constexpr TypeCode type{2, 3};

TEST(Gaps, NobodyKnownIsOneBox) {
  const Box all;
  EXPECT_EQ(gaps(all, {}), std::vector<Box>{all});
}

TEST(Gaps, OneKnownLeavesFourBoxes) {
  // Serials below and above; under the known serial number, revisions below and above.
  const std::vector<Box> expected{
      {0, 0xFFFF'FFFF, 0, 9}, {0, 0xFFFF'FFFF, 11, 0xFFFF'FFFF}, {0, 4, 10, 10}, {6, 0xFFFF'FFFF, 10, 10}};
  EXPECT_EQ(gaps(Box{}, {{5, 10}}), expected);
}

TEST(Gaps, TheEndsOfTheRangeHaveNothingBeyond) {
  const std::vector<Box> expected{{7, 7, 1, 0xFFFF'FFFE}};
  EXPECT_EQ(gaps(Box{.revision_low = 7, .revision_high = 7}, {{7, 0}, {7, 0xFFFF'FFFF}, {7, 0}}), expected);
}

// Every point of a small world is in exactly one gap, or is known.
RC_GTEST_PROP(Gaps, MakeUpEverythingButTheKnown, ()) {
  const auto coordinate = rc::gen::inRange<std::uint32_t>(0, 6);
  const auto known =
      *rc::gen::container<std::vector<std::pair<std::uint32_t, std::uint32_t>>>(rc::gen::pair(coordinate, coordinate));
  std::vector<R_SN> list;
  for (const auto& k : known) list.push_back({k.first, k.second});
  const Box all{1, 4, 1, 4};
  const auto boxes = gaps(all, list);
  for (std::uint32_t r = 0; r < 6; ++r) {
    for (std::uint32_t s = 0; s < 6; ++s) {
      const R_SN n{r, s};
      const auto in = std::ranges::count_if(boxes, [&](const Box& b) { return b.contains(n); });
      const bool is_known = std::ranges::find(list, n) != list.end();
      RC_ASSERT(in == (all.contains(n) && !is_known ? 1 : 0));
    }
  }
}

RC_GTEST_PROP(Box, HalvesAreDisjointAndMakeUpTheWhole, (std::uint32_t a, std::uint32_t b, std::uint32_t c)) {
  const Box box{std::min(a, b), std::max(a, b), c, 0xFFFF'FFFF};
  RC_PRE(!box.single());
  const Box low = box.lower();
  const Box high = box.upper();
  const bool by_revision = box.serial_low == box.serial_high;
  RC_ASSERT((by_revision ? low.revision_low : low.serial_low) == (by_revision ? box.revision_low : box.serial_low));
  RC_ASSERT((by_revision ? high.revision_high : high.serial_high) ==
            (by_revision ? box.revision_high : box.serial_high));
  RC_ASSERT((by_revision ? low.revision_high + 1 : low.serial_high + 1) ==
            (by_revision ? high.revision_low : high.serial_low));
}

NodeOptions lss_only(std::uint32_t rev, std::uint32_t serial, NodeId id = {}) {
  NodeOptions o;
  o.address = {type.vendor, type.product, rev, serial};
  o.fastscan = false;
  o.node_id = id;
  return o;
}

// Devices without Fastscan, and devices delivered with a stored valid node-ID: 1, 32, 127.
TEST(Identify, FindsBlankAndConfiguredDevices) {
  World w;
  w.add(lss_only(1, 0x8000'0000));
  w.add(lss_only(1, 0x7FFF'FFFF, NodeId(32)));
  w.add(lss_only(2, 0, NodeId(127)));
  w.add(lss_only(1, 0xFFFF'FFFF, NodeId(1)));
  w.known.kinds = {{type, std::nullopt}};
  const auto report = w.find(Method::identify);
  ASSERT_TRUE(report) << describe(report.error());
  EXPECT_EQ(report->end, Report::End::complete);
  EXPECT_EQ(addresses(*report), addresses(w));
  for (const auto& d : report->found) {
    const auto it = std::ranges::find_if(w.nodes, [&](const auto& n) { return n->options.address == d.address; });
    EXPECT_EQ(d.active, (*it)->options.node_id);
    EXPECT_FALSE(d.possible_clone);
  }
  for (const auto& n : w.nodes) EXPECT_EQ(n->slave.state(), lss::State::waiting);
}

// Registered devices answer identify as everybody: they are left out of the ranges, and neighbours of theirs found.
TEST(Identify, FindsNeighboursOfTheRegistered) {
  World w;
  for (std::uint32_t s = 10; s < 20; ++s) {
    w.add(lss_only(1, s, NodeId(static_cast<std::uint8_t>(s))));
    if (s != 10 && s != 15) w.known.registered.push_back(w.nodes.back()->options.address);
  }
  w.add(lss_only(2, 12, NodeId(99)));  // the same serial number in another revision
  w.known.kinds = {{type, std::nullopt}};
  const auto report = w.find(Method::identify);
  ASSERT_TRUE(report);
  const std::vector<LssAddress> expected{{2, 3, 1, 10}, {2, 3, 1, 15}, {2, 3, 2, 12}};
  EXPECT_EQ(addresses(*report), expected);
}

// 40h to 43h would select all equal ones at once, and 5Eh would have an answer of its own from each.
TEST(Identify, PassesEqualOnesWithoutASerialNumberOver) {
  World w;
  for (std::uint8_t id = 20; id < 32; ++id) w.add(lss_only(1, 0, NodeId(id)));
  w.add(lss_only(1, 7, NodeId(40)));
  w.known.kinds = {{type, std::nullopt}};
  w.known.equals = {w.nodes.front()->options.address};
  const auto report = w.find(Method::identify);
  ASSERT_TRUE(report) << describe(report.error());
  EXPECT_EQ(addresses(*report), (std::vector<LssAddress>{{2, 3, 1, 7}}));
}

TEST(Identify, AssignsOnlyToThoseWithoutANodeId) {
  World w;
  w.add(lss_only(1, 5));
  w.add(lss_only(1, 6, NodeId(32)));
  w.known.kinds = {{type, 1U}};
  Giver giver;
  w.options.assigner = &giver;
  const auto report = w.find(Method::identify);
  ASSERT_TRUE(report);
  EXPECT_EQ(giver.asked.size(), 1U);
  EXPECT_EQ(w.nodes[0]->id(), NodeId(1));
  EXPECT_EQ(w.nodes[1]->id(), NodeId(32));
}

// What is late costs time only.
TEST(Identify, OutliersCostTimeOnly) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE(seed);
    World w(seed);
    for (unsigned i = 0; i < 6; ++i) {
      auto o = lss_only(static_cast<std::uint32_t>(w.random.below(3)), static_cast<std::uint32_t>(w.random.next()));
      o.timing.outlier_per_million = 10'000;
      o.timing.outlier = 8ms;
      w.add(o);
    }
    w.known.kinds = {{type, std::nullopt}};
    const auto report = w.find(Method::identify);
    ASSERT_TRUE(report);
    EXPECT_EQ(addresses(*report), addresses(w));
  }
}

// Six frames back to back are more than a receive buffer of one or two frames holds: such a device answers 4Ch, which
// is one frame, and no range, until there are pauses between the frames.
TEST(Identify, SmallReceiveBuffersAreFoundByPauses) {
  for (const std::uint16_t depth : {std::uint16_t{1}, std::uint16_t{2}}) {
    SCOPED_TRACE(depth);
    World w(depth);
    for (std::uint32_t serial : {7U, 0x1234'5678U, 0x1234'5679U}) {
      auto o = lss_only(2, serial);
      o.timing.rx_depth = depth;
      w.add(o);
    }
    w.known.kinds = {{type, std::nullopt}};
    w.options.configured = false;
    const auto report = w.find(Method::identify);
    ASSERT_TRUE(report);
    EXPECT_EQ(addresses(*report), addresses(w));
    EXPECT_EQ(w.services().lss.options().inhibit, lss::MasterOptions{}.inhibit) << "the pauses end with the search";
  }
}

// A device with a small receive buffer and late moments loses questions in the middle of the way down to it, which
// takes more than sixty.
TEST(Identify, LostQuestionsDoNotHideADevice) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    World w(seed);
    Node& n = w.add(lss_only(static_cast<std::uint32_t>(w.random.next()), static_cast<std::uint32_t>(w.random.next())));
    Random random(seed);
    unsigned heard = 0;
    n.overhears = [&](const can::Frame& f) { return f.data[0] == 0x4B && heard++ > 0 && random.below(12) == 0; };
    w.known.kinds = {{type, std::nullopt}};
    w.options.retries = 2;
    const auto report = w.find(Method::identify);
    ASSERT_TRUE(report);
    EXPECT_EQ(addresses(*report), addresses(w)) << "seed " << seed << ", " << report->requests << " requests";
  }
}

// Six frames a question: one answer in twenty comes ten times later than the others. To wait for the latest at every
// silence would take 40 ms for each of some seventy questions a device.
TEST(Identify, LateAnswersAreNotWaitedForAtEverySilence) {
  World w(11);
  for (unsigned i = 0; i < 12; ++i) {
    auto o = lss_only(2, static_cast<std::uint32_t>(w.random.next()));
    o.timing.outlier_per_million = 10'000;
    o.timing.outlier = 30ms;
    w.add(o);
  }
  w.known.kinds = {{type, 2}};
  w.options.window = 100ms;
  const auto report = w.find(Method::identify);
  ASSERT_TRUE(report);
  EXPECT_EQ(addresses(*report), addresses(w));
  const double seconds = std::chrono::duration<double>(report->ended - report->began).count();
  EXPECT_LT(seconds / 12, 2.0) << "of bus time for a device";
}

// A device that is slow to deal with what comes loses questions that are asked in haste; the closing question is none
// (seed 811701 of `auto`: a late moment, behind which the receive buffer was full).
TEST(Identify, TheClosingQuestionIsNotLostInAReceiveBufferThatHasteHasFilled) {
  World w;
  Node& slow = w.add(lss_only(3, 0x10F9, NodeId(1)));
  w.add(lss_only(3, 0x10FB, NodeId(2)));
  w.add(lss_only(3, 0x10FC, NodeId(3)));
  std::deque<rt::Time> waiting;
  slow.overhears = [&](const can::Frame&) {
    while (!waiting.empty() && w.world.now() - waiting.front() > 38ms) waiting.pop_front();
    waiting.push_back(w.world.now());
    return waiting.size() > 8;
  };
  w.known.kinds = {{type, 3}};
  w.options.window = 42ms;
  const auto report = w.find(Method::identify);
  ASSERT_TRUE(report);
  EXPECT_EQ(addresses(*report), addresses(w));
}

// Identify is answered without saying by whom; who is left at the end must answer to its own address.
TEST(Identify, WhoDoesNotAnswerToItsAddressIsNotReported) {
  World w;
  w.add(lss_only(1, 5));
  Node& ghost = w.add(lss_only(1, 0x8000'0000));
  ghost.swallows = [](const can::Frame& request) {
    return request.data[0] != static_cast<std::uint8_t>(lss::Command::identify_serial_high);
  };
  w.known.kinds = {{type, 1U}};
  const auto report = w.find(Method::identify);
  ASSERT_TRUE(report) << describe(report.error());
  const std::vector<LssAddress> expected{{2, 3, 1, 5}};
  EXPECT_EQ(addresses(*report), expected);
  EXPECT_EQ(report->end, Report::End::gave_up) << "somebody answers and is not found: that is said";
}

TEST(Identify, TwoWithOneAddressAreTold) {
  World w;
  w.add(lss_only(1, 5, NodeId(1)));
  w.add(lss_only(1, 5, NodeId(2)));
  w.known.kinds = {{type, 1U}};
  const auto report = w.find(Method::identify);
  ASSERT_TRUE(report);
  ASSERT_EQ(report->found.size(), 1U);
  EXPECT_TRUE(report->found[0].possible_clone);
}

TEST(Identify, KnowsNobodyOfAnUnknownKind) {
  World w;
  w.add(lss_only(1, 5));
  w.known.kinds = {{{9, 9}, std::nullopt}};
  const auto report = w.find(Method::identify);
  ASSERT_TRUE(report);
  EXPECT_TRUE(report->found.empty());
  EXPECT_TRUE(*w.run(make(Method::identify, w.services())->anybody(w.options)));  // but there is somebody
}

}  // namespace
}  // namespace berth::discovery::test::identify_tests

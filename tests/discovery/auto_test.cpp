// Mixed buses: whoever speaks what is found, one scheme after the other (S1.24, S1.54, HU.1).
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "berth/discovery/auto.hpp"

#include "berth/nodeid/rand_frames.hpp"
#include "discovery_world.hpp"

namespace berth::discovery::test {
namespace {

constexpr TypeCode rand_type{1, 1};
constexpr TypeCode scan_type{1, 2};
constexpr TypeCode feedback_type{1, 3};
constexpr TypeCode lss_type{1, 4};

NodeOptions like(TypeCode type, std::uint32_t serial) {
  NodeOptions o;
  o.address = {type.vendor, type.product, 0x1'0000, serial};
  return o;
}

// Five of each: RAND only, Fastscan, Fastscan with feedback in both forms, LSS without Fastscan, and some that have a
// node-ID that is in no slot.
void add_mixed(World& w, bool configured = true) {
  for (std::uint32_t i = 0; i < 5; ++i) {
    auto rand = like(rand_type, 100 + i);
    rand.fastscan = false;
    rand.rand = true;
    w.add(rand);
    w.add(like(scan_type, 0x1234'0000 + 77 * i));
    auto feedback = like(feedback_type, 0xAB'0000 * i + 5);
    feedback.feedback = i % 2 == 0 ? lss::Feedback::extended : lss::Feedback::base;
    w.add(feedback);
    auto plain = like(lss_type, 3 * i);
    plain.fastscan = false;
    w.add(plain);
    if (!configured || i > 1) continue;
    auto wrong = like(scan_type, 9 + i);
    wrong.node_id = NodeId(static_cast<std::uint8_t>(100 + i));
    w.add(wrong);
  }
  w.known.kinds = {
      {rand_type, std::nullopt}, {scan_type, 0x1'0000}, {feedback_type, std::nullopt}, {lss_type, 0x1'0000}};
}

class Mixed : public testing::TestWithParam<std::uint64_t> {};
INSTANTIATE_TEST_SUITE_P(Seeds, Mixed, testing::Range<std::uint64_t>(1, 6));

TEST_P(Mixed, EverybodyIsFoundOnceAndBound) {
  World w(GetParam());
  add_mixed(w);
  Giver giver;
  w.options.assigner = &giver;
  w.options.window = 20ms;
  Auto everybody(w.services());
  const auto report = w.run(everybody.find(w.known, w.options));
  ASSERT_TRUE(report) << describe(report.error());
  EXPECT_EQ(report->end, Report::End::complete) << name(report->end);
  EXPECT_EQ(addresses(*report), addresses(w));
  w.world.run_for(50ms);
  for (const auto& n : w.nodes) {
    EXPECT_TRUE(n->id().configured()) << to_string(n->options.address);
    if (n->options.node_id.configured()) {
      EXPECT_EQ(n->id(), n->options.node_id);
    }
  }
  w.expect_right(giver);
  const auto& spoken = everybody.spoken();
  EXPECT_TRUE(spoken.fastscan && spoken.feedback && spoken.rand && spoken.non_configured);
  for (const auto& d : report->found) {
    if (d.address.type() == rand_type) {
      EXPECT_EQ(d.by, Method::planner_rand);
    }
    if (d.address.type() == lss_type) {
      EXPECT_EQ(d.by, Method::identify);
    }
  }
}

// Without node-IDs to give: all addresses are known, nobody has changed.
TEST_P(Mixed, EverybodyIsFoundOnce) {
  World w(GetParam());
  add_mixed(w);
  w.options.window = 20ms;
  Auto everybody(w.services());
  const auto report = w.run(everybody.find(w.known, w.options));
  ASSERT_TRUE(report);
  EXPECT_EQ(addresses(*report), addresses(w));
  w.world.run_for(50ms);
  for (const auto& n : w.nodes) {
    EXPECT_EQ(n->slave.state(), lss::State::waiting);
    EXPECT_EQ(n->id(), n->options.node_id);
    EXPECT_EQ(n->resets, 0U);
  }
}

// A device that speaks RAND and Fastscan is one device.
TEST(Auto, OneDeviceWithTwoSchemesIsOneDevice) {
  for (const bool binds : {true, false}) {
    World w;
    auto both = like(rand_type, 5);
    both.rand = true;
    w.add(both);
    w.add(like(rand_type, 6));
    Giver giver;
    if (binds) w.options.assigner = &giver;
    Auto everybody(w.services());
    const auto report = w.run(everybody.find(w.known, w.options));
    ASSERT_TRUE(report);
    EXPECT_EQ(addresses(*report), addresses(w));
    EXPECT_EQ(giver.asked.size(), binds ? 2U : 0U);
  }
}

// S1.24: RAND's DIS and the feedback have the same identifiers. No Fastscan request between a RAND request and the end
// of what it may bring, and the other way round.
TEST(Auto, NeverTwoSchemesAtOnce) {
  World w;
  add_mixed(w, false);
  w.options.window = 20ms;
  const Record record(w.bus);
  Auto everybody(w.services());
  ASSERT_TRUE(w.run(everybody.find(w.known, w.options)));
  enum class Scheme : std::uint8_t { none, fastscan, rand };
  Scheme now = Scheme::none;
  unsigned changes = 0;
  rt::Time last{};
  for (std::size_t i = 0; i < record.frames.size(); ++i) {
    const auto& f = record.frames[i];
    const bool scan = lss::is_lss(f, lss::master_cob_id) && lss::command(f) == lss::Command::fastscan;
    const bool rand = nodeid::rand_requests.contains(f.key());
    if (!scan && !rand) continue;
    const Scheme scheme = scan ? Scheme::fastscan : Scheme::rand;
    if (scheme != now) {
      ++changes;
      if (now != Scheme::none) {
        EXPECT_GE(record.times[i] - last, w.options.window);
      }
    }
    now = scheme;
    last = record.times[i];
  }
  EXPECT_EQ(changes, 2U);
}

// Lets a search by ranges be so long, then breaks it off, as a boot-up or a person's command does.
struct Impatient final : Observer {
  void found(const Found&) noexcept override {}
  void progress(const Progress&) noexcept override { ++ranges; }
  bool goes_on() noexcept override { return ranges < most; }
  unsigned ranges = 0;
  unsigned most = 3;
};

// Seven equal devices at work answer Fastscan and cannot be told apart, so that each walk is long and in vain. The bus
// is slow, and the ranges are broken off each time.
struct BesideEquals {
  BesideEquals() : w(1, 20'000), record(w.bus) {
    for (std::uint8_t i = 1; i <= 7; ++i) {
      auto equal = like(scan_type, 0);
      equal.habit = device::LssHabit::lely;
      equal.node_id = NodeId(i);
      w.add(equal);
    }
    w.known.registered = {w.nodes.front()->options.address};
    w.known.equals = w.known.registered;
    w.known.kinds = {{lss_type, 0x1'0000}};
    w.options.assigner = &giver;
    w.options.observer = &impatient;
    giver.next = 20;
  }
  std::size_t count(lss::Command command) const {
    return static_cast<std::size_t>(std::ranges::count_if(record.frames, [command](const can::Frame& f) {
      return lss::is_lss(f, lss::master_cob_id) && lss::command(f) == command;
    }));
  }
  // Requests of Fastscan in one search. Who is found is registered.
  std::size_t find(Auto& everybody) {
    const std::size_t before = count(lss::Command::fastscan);
    impatient.ranges = 0;
    const auto report = w.run(everybody.find(w.known, w.options));
    EXPECT_TRUE(report) << describe(report.error());
    if (!report) return 0;
    end = report->end;
    for (const auto& f : report->found) {
      if (f.address == w.nodes.front()->options.address) continue;  // found by each walk
      w.known.registered.push_back(f.address);
      found.push_back(f);
    }
    return count(lss::Command::fastscan) - before;
  }
  World w;
  Record record;
  Giver giver;
  Impatient impatient;
  Report::End end = Report::End::complete;
  std::vector<Found> found;
};

// The walk ends `held`, as they keep their node-IDs and answer on; that the ranges were broken off weighs more, or
// nobody goes on.
TEST(Auto, ASearchThatIsBrokenOffAmongTheRangesGoesOnThere) {
  BesideEquals b;
  constexpr unsigned plain_devices = 8;
  for (std::uint32_t i = 0; i < plain_devices; ++i) {
    auto plain = like(lss_type, 0x1234'5678 + 0x0BAD'CAFE * i);
    plain.fastscan = false;
    b.w.add(plain);
  }
  Auto everybody(b.w.services());
  EXPECT_GT(b.find(everybody), 10U);
  ASSERT_EQ(b.end, Report::End::more) << name(b.end);
  unsigned searches = 1;
  std::size_t walks = 0;
  for (; searches < 200 && b.end == Report::End::more; ++searches) {
    const std::size_t asked = b.find(everybody);
    if (asked > 0) ++walks;
    EXPECT_EQ(asked > 0, searches % 5 == 0) << searches << ": " << asked;
  }
  EXPECT_NE(b.end, Report::End::more) << "it does not end";
  EXPECT_EQ(b.found.size(), plain_devices);
  for (const Found& f : b.found) EXPECT_EQ(f.by, Method::identify);
  EXPECT_GT(walks, 0U) << "too short a search to tell anything";
  b.w.expect_right(b.giver);
}

// Who comes meanwhile and speaks a scheme waits for four parts of the search by ranges, no longer.
TEST(Auto, AFastscanDeviceThatComesToASearchByRangesIsFound) {
  BesideEquals b;
  auto plain = like(lss_type, 0x8765'4321);
  plain.fastscan = false;
  b.w.add(plain);
  Auto everybody(b.w.services());
  b.find(everybody);
  ASSERT_EQ(b.end, Report::End::more) << name(b.end);
  const auto newcomer = like(feedback_type, 0x55AA'1234);
  b.w.add(newcomer);
  for (unsigned i = 0; i < 5; ++i) b.find(everybody);
  EXPECT_NE(std::ranges::find(b.w.known.registered, newcomer.address), b.w.known.registered.end());
}

// S4.20: a poll is one question per scheme, and ends at the first answer.
TEST(Auto, APollIsOneQuestionPerScheme) {
  World w;
  auto bound = like(scan_type, 1);
  bound.node_id = NodeId(1);
  w.add(bound);
  const Record record(w.bus);
  Auto everybody(w.services());
  EXPECT_FALSE(*w.run(everybody.anybody(w.options)));
  EXPECT_EQ(record.frames.size(), 3U);  // 51h 80h, RAND's phase 0, 4Ch
  w.add(like(scan_type, 2));
  const auto before = record.frames.size();
  EXPECT_TRUE(*w.run(everybody.anybody(w.options)));
  EXPECT_EQ(record.frames.size(), before + 2);
}

TEST(Auto, TellsWhatIsSpoken) {
  World w;
  w.add(like(scan_type, 1));
  Auto everybody(w.services());
  auto spoken = w.run(everybody.ask_spoken(w.options));
  ASSERT_TRUE(spoken);
  EXPECT_TRUE(spoken->fastscan && spoken->non_configured);
  EXPECT_FALSE(spoken->feedback || spoken->rand);
  auto feedback = like(feedback_type, 1);
  feedback.feedback = lss::Feedback::base;
  feedback.rand = true;
  w.add(feedback);
  spoken = w.run(everybody.ask_spoken(w.options));
  EXPECT_TRUE(spoken->fastscan && spoken->feedback && spoken->rand);
}

TEST(Auto, WhatIsSwitchedOffIsNotAsked) {
  World w;
  w.add(like(scan_type, 1));
  const Record record(w.bus);
  Auto everybody(w.services(),
                 {.fastscan = false, .rand = false, .and_protocol = false, .identify = false, .configured = false});
  const auto report = w.run(everybody.find(w.known, w.options));
  ASSERT_TRUE(report);
  EXPECT_TRUE(report->found.empty());
  EXPECT_TRUE(record.frames.empty());
}

// The published procedures behind the same interface, with node-IDs to give.
TEST(Published, EachBindsItsOwnSlaves) {
  struct Row {
    Method method;
    bool rand;
    lss::Feedback feedback;
  };
  const Row rows[] = {{Method::rand, true, lss::Feedback::none},
                      {Method::planner_rand, true, lss::Feedback::none},
                      {Method::fastscan, false, lss::Feedback::none},
                      {Method::feedback_29, false, lss::Feedback::extended},
                      {Method::feedback_11, false, lss::Feedback::base},
                      {Method::identify, false, lss::Feedback::none},
                      {Method::planner_fastscan, false, lss::Feedback::none},
                      {Method::planner_feedback, false, lss::Feedback::base}};
  for (const Row& row : rows) {
    SCOPED_TRACE(name(row.method));
    World w;
    for (std::uint32_t i = 0; i < 4; ++i) {
      auto o = like(scan_type, 1000 * i);
      o.rand = row.rand;
      o.feedback = row.feedback;
      w.add(o);
    }
    w.known.kinds = {{scan_type, 0x1'0000}};
    Giver giver;
    w.options.assigner = &giver;
    w.options.window = row.rand ? 20ms : 10ms;
    const auto report = w.find(row.method);
    ASSERT_TRUE(report) << describe(report.error());
    EXPECT_EQ(report->end, Report::End::complete);
    EXPECT_EQ(addresses(*report), addresses(w));
    w.world.run_for(50ms);
    for (const auto& n : w.nodes) EXPECT_TRUE(n->id().configured());
    w.expect_right(giver);
    for (const auto& d : report->found) EXPECT_EQ(d.by, row.method);
  }
}

// The published Fastscan finds the next one only when this one has a node-ID.
TEST(Published, FastscanIsHeldByADeviceThatGetsNone) {
  World w;
  w.add(like(scan_type, 1));
  w.add(like(scan_type, 2));
  const auto report = w.find(Method::fastscan);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, Report::End::held);
  EXPECT_EQ(report->found.size(), 1U);
}

// HC3.3: somebody was left in configuration and loses `04 00` after `04 00`: it would take the next one's node-ID.
TEST(Published, ConfirmedFastscanGivesNobodyAnothersNodeId) {
  for (const auto method : {Method::fastscan, Method::feedback_29}) {
    SCOPED_TRACE(name(method));
    World w;
    w.add(like(scan_type, 1));
    auto& left_over = w.add(like(scan_type, 2));
    left_over.slave.handle(lss::request(lss::Command::switch_global, 1));
    unsigned lost = 0;
    left_over.overhears = [&](const can::Frame& frame) {
      const bool waiting = lss::command(frame) == lss::Command::switch_global && frame.data[1] == 0;
      return waiting && lost++ < 2;
    };
    Giver giver;
    w.options.assigner = &giver;
    w.options.confirm = true;
    const auto report = w.find(method);
    ASSERT_TRUE(report) << describe(report.error());
    EXPECT_EQ(report->end, Report::End::complete);
    EXPECT_GE(lost, 2U);
    EXPECT_EQ(addresses(*report), addresses(w));
    w.world.run_for(50ms);
    w.expect_right(giver);
  }
}

// HC3.3: a device that loses an 80h stands at the serial number, and answers there for another's revision.
TEST(Published, ConfirmedFastscanReportsNoAddressOfTwoDevices) {
  World w;
  auto one = like(scan_type, 0x1111);
  one.address.revision = 1;
  auto& straggler = w.add(one);
  one.address.revision = 2;
  one.address.serial = 0x2222;
  w.add(one);
  // It was led to its serial number once, and hears of the next scan no more than the serial numbers.
  for (const lss::FastscanRequest& r :
       {lss::FastscanRequest{},
        lss::FastscanRequest{.id = one.address.vendor, .bit_checked = 0, .sub = 0, .next = 1},
        {.id = one.address.product, .bit_checked = 0, .sub = 1, .next = 2},
        {.id = 1, .bit_checked = 0, .sub = 2, .next = 3}}) {
    straggler.slave.handle(lss::request_fastscan(r));
  }
  unsigned scans = 0;
  straggler.overhears = [&](const can::Frame& frame) {
    const auto request = lss::decode_fastscan(frame);
    if (request && request->starts()) ++scans;
    return request && scans <= 1 && request->sub != 3;
  };
  Giver giver;
  w.options.assigner = &giver;
  w.options.confirm = true;
  const auto report = w.find(Method::fastscan);
  ASSERT_TRUE(report) << describe(report.error());
  EXPECT_EQ(addresses(*report), addresses(w));
  EXPECT_GE(report->restarts, 1U);
}

TEST(Published, MethodsHaveTheirNames) {
  World w;
  for (std::size_t i = 0; i < methods; ++i) {
    const auto m = static_cast<Method>(i);
    EXPECT_EQ(make(m, w.services())->method(), m);
    EXPECT_EQ(*method(name(m)), m);
  }
  EXPECT_FALSE(method("bisect"));
}

}  // namespace
}  // namespace berth::discovery::test

// Devices that answer Fastscan whatever node-ID they have, as Lely core's slaves do (HC3.3, HU.6): giving them a
// node-ID takes them out of no search.
#include <gtest/gtest.h>
#include <cstdint>

#include "berth/discovery/walk.hpp"
#include "berth/lss/select_alone.hpp"

#include "discovery_world.hpp"

namespace berth::discovery::test::stayers_tests {
namespace {

constexpr TypeCode type{0x360, 5};
constexpr std::uint32_t revision = 3;

NodeOptions lely(std::uint32_t serial, NodeId id = {}) {
  NodeOptions o;
  o.address = {type.vendor, type.product, revision, serial};
  o.habit = device::LssHabit::lely;
  o.node_id = id;
  return o;
}

class Stayers : public testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(All, Stayers, testing::Values(Method::planner_fastscan, Method::planner_feedback));

void expect_each_once(const Report& report, const Giver& giver, std::size_t devices) {
  EXPECT_EQ(report.end, Report::End::complete) << name(report.end);
  EXPECT_EQ(report.found.size(), devices);
  EXPECT_EQ(giver.asked.size(), devices) << "a device was lent more than one node-ID";
  for (const auto& d : report.found) EXPECT_FALSE(d.possible_clone) << to_string(d.address);
}

TEST_P(Stayers, BlankOnesAreFoundOnceAndLentOneNodeId) {
  for (const unsigned devices : {1U, 2U, 10U}) {
    for (const bool kind_known : {true, false}) {
      for (const bool random_serials : {true, false}) {
        SCOPED_TRACE(testing::Message() << devices << kind_known << random_serials);
        World w(devices);
        for (unsigned i = 0; i < devices; ++i) {
          w.add(lely(random_serials ? static_cast<std::uint32_t>(w.random.next()) : 4 + i));
        }
        if (kind_known) w.known.kinds = {{type, revision}};
        Giver giver;
        w.options.assigner = &giver;
        const auto report = w.find(GetParam());
        ASSERT_TRUE(report) << describe(report.error());
        expect_each_once(*report, giver, devices);
        EXPECT_EQ(addresses(*report), addresses(w));
        for (const auto& n : w.nodes) EXPECT_EQ(n->slave.pending().node_id, giver.given[n->options.address]);
        EXPECT_LT(report->ended - report->began, 3s + devices * 500ms);
      }
    }
  }
}

// Such a one has a node-ID, though it answers Fastscan; a blank one beside it is heard all the same.
TEST(StayersAndBlank, WhoTellsANodeIdIsNotWithoutOne) {
  World w;
  w.add(lely(0, NodeId(3)));
  const LssAddress device = w.nodes.front()->options.address;
  EXPECT_EQ(w.run(lss::any_without_node_id(w.lss, device)), false);
  Node& blank = w.add(lely(0));
  EXPECT_EQ(w.run(lss::any_without_node_id(w.lss, device)), true);
  w.world.run_for(50ms);  // its host is slow
  EXPECT_EQ(blank.slave.state(), lss::State::waiting);
}

// An answer that is late, to the last bit say, names a serial number that the device does not have. `04 00` behind the
// proof that fails makes the slave forget the parts that it had answered: it is led to its serial number again, and not
// asked for bit by bit in vain.
TEST_P(Stayers, AWrongLastBitCostsNoSecondSearch) {
  rt::Duration longest{};
  for (unsigned seed = 1; seed <= 40; ++seed) {
    World w(seed);
    NodeOptions slow = lely(4);
    slow.timing = {.response_min = 1ms, .response_max = 8ms};
    slow.timing.outlier_per_million = 20'000;
    slow.timing.outlier = 30ms;
    w.add(slow);
    Giver giver;
    w.options.assigner = &giver;
    w.known.kinds = {{type, std::nullopt}};
    const auto report = w.find(GetParam());
    ASSERT_TRUE(report) << describe(report.error());
    EXPECT_EQ(addresses(*report), addresses(w)) << seed;
    longest = std::max(longest, report->ended - report->began);
  }
  EXPECT_LT(longest, 8s);
}

// It is 360h-5-3-4 in memory of the peers' trial: one blank slave, every later search meets it again.
TEST_P(Stayers, WhoIsSeatedIsNotFoundAgain) {
  World w;
  w.add(lely(4, NodeId(2)));
  w.known.kinds = {{type, revision}};
  w.known.registered = {w.nodes[0]->options.address};
  Giver giver;
  w.options.assigner = &giver;
  const auto report = w.find(GetParam());
  ASSERT_TRUE(report) << describe(report.error());
  expect_each_once(*report, giver, 0);
  EXPECT_EQ(w.nodes[0]->slave.pending().node_id, NodeId(2));
  EXPECT_LT(report->ended - report->began, 3s);
}

// A node-ID that was in its memory: told, and left.
TEST_P(Stayers, WhoHasANodeIdKeepsIt) {
  World w;
  w.add(lely(4, NodeId(77)));
  Giver giver;
  w.options.assigner = &giver;
  const auto report = w.find(GetParam());
  ASSERT_TRUE(report) << describe(report.error());
  EXPECT_EQ(report->end, Report::End::complete);
  EXPECT_TRUE(giver.asked.empty());
  ASSERT_EQ(report->found.size(), 1U);
  EXPECT_EQ(report->found[0].active, NodeId(77));
  EXPECT_EQ(w.nodes[0]->slave.pending().node_id, NodeId(77));
}

// A registered device that lost its node-ID is found, whoever else stays.
TEST_P(Stayers, ARegisteredOneWithoutANodeIdIsFound) {
  World w;
  w.add(lely(4, NodeId(2)));
  w.add(lely(5));
  w.known.kinds = {{type, revision}};
  for (const auto& n : w.nodes) w.known.registered.push_back(n->options.address);
  Giver giver;
  giver.next = 50;
  w.options.assigner = &giver;
  const auto report = w.find(GetParam());
  ASSERT_TRUE(report) << describe(report.error());
  expect_each_once(*report, giver, 1);
  EXPECT_EQ(w.nodes[1]->slave.pending().node_id, NodeId(50));
}

TEST_P(Stayers, ANewOneAmongThirtyThatAreSeated) {
  for (const bool random_serials : {true, false}) {
    for (const bool stays : {true, false}) {
      for (const auto feedback : {lss::Feedback::none, lss::Feedback::extended}) {
        SCOPED_TRACE(testing::Message() << random_serials << stays << int(feedback));
        World w(30);
        for (unsigned i = 0; i < 30; ++i) {
          const auto number = random_serials ? static_cast<std::uint32_t>(w.random.next()) : 100 + i;
          w.add(lely(number, NodeId(static_cast<std::uint8_t>(1 + i))));
          w.known.registered.push_back(w.nodes.back()->options.address);
        }
        NodeOptions blank = lely(random_serials ? static_cast<std::uint32_t>(w.random.next()) : 130);
        if (!stays) blank.habit = device::LssHabit::none;
        blank.feedback = feedback;
        w.add(blank);
        w.known.kinds = {{type, revision}};
        Giver giver;
        giver.next = 50;
        w.options.assigner = &giver;
        const auto report = w.find(GetParam());
        ASSERT_TRUE(report) << describe(report.error());
        expect_each_once(*report, giver, 1);
        EXPECT_EQ(w.nodes.back()->slave.pending().node_id, NodeId(50));
        EXPECT_LT(report->known - report->began, 6s);
        EXPECT_LT(report->ended - report->began, 10s);
      }
    }
  }
}

struct Sliced {
  unsigned slices = 0;
  unsigned asked = 0;
  std::vector<LssAddress> found;
};

// Slice by slice to the end.
Sliced find_in_slices(World& w, Discovery& walker) {
  constexpr unsigned most = 400;
  Sliced all;
  for (auto end = Report::End::more; end == Report::End::more && all.slices < most; ++all.slices) {
    const auto report = w.run(walker.find(w.known, w.options));
    EXPECT_TRUE(report) << describe(report.error());
    if (!report) break;
    end = report->end;
    all.asked += report->requests;
    for (const auto& f : report->found) {
      all.found.push_back(f.address);
      w.known.registered.push_back(f.address);
    }
    if (report->found.empty()) {
      EXPECT_LT(report->requests, w.options.slice + 15);
    }
    if (end != Report::End::more) {
      EXPECT_EQ(end, Report::End::complete) << name(end);
    }
  }
  EXPECT_LT(all.slices, most) << "it does not end: " << all.asked << " questions";
  return all;
}

// On a bus at rest: each slice is of about so many questions, and what was asked once is not asked again.
TEST_P(Stayers, InSlicesEachIsShortAndTheWholeEnds) {
  constexpr unsigned devices = 40;
  for (const unsigned types : {1U, 4U}) {
    for (const unsigned blank_at : {0U, 20U, devices}) {  // where the blank one is among them; the last: there is none
      SCOPED_TRACE(testing::Message() << types << " " << blank_at);
      World w(types + blank_at);
      std::vector<std::uint32_t> serials;
      for (unsigned i = 0; i < devices; ++i) serials.push_back(static_cast<std::uint32_t>(w.random.next()));
      std::ranges::sort(serials);
      for (unsigned i = 0; i < devices; ++i) {
        NodeOptions one = lely(serials[i], i == blank_at ? NodeId() : NodeId(static_cast<std::uint8_t>(1 + i)));
        one.address.product += i % types;
        if (i == blank_at) one.habit = device::LssHabit::none;
        w.add(one);
        if (i != blank_at) w.known.registered.push_back(one.address);
      }
      w.known.kinds = {{type, revision}};
      Giver giver;
      giver.next = 100;
      w.options.assigner = &giver;
      w.options.slice = 20;
      const auto walker = make(GetParam(), w.services());
      const Sliced first = find_in_slices(w, *walker);
      EXPECT_EQ(first.found.size(), blank_at < devices ? 1U : 0U);
      if (blank_at < devices) {
        EXPECT_EQ(w.nodes[blank_at]->slave.pending().node_id, NodeId(100));
      }
      EXPECT_GT(first.slices, 20U);
      if (blank_at < devices) continue;
      const Sliced second = find_in_slices(w, *walker);
      EXPECT_TRUE(second.found.empty());
      EXPECT_LT(second.asked, first.asked) << "those that answer with their node-IDs are known by then";
    }
  }
}

// One of them has lost its node-ID since: a search that is not in slices asks for it, too.
TEST_P(Stayers, WhoIsGoneRoundInSlicesIsFoundByTheNextWholeSearch) {
  World w;
  for (const unsigned i : {1U, 2U, 3U}) {
    w.add(lely(0x100 * i, NodeId(static_cast<std::uint8_t>(i))));
    w.known.registered.push_back(w.nodes.back()->options.address);
  }
  w.known.kinds = {{type, revision}};
  Giver giver;
  giver.next = 50;
  w.options.assigner = &giver;
  w.options.slice = 20;
  const auto walker = make(GetParam(), w.services());
  static_cast<void>(find_in_slices(w, *walker));
  w.nodes[1]->slave.power_on({});
  w.options.slice = 0;
  const auto report = w.run(walker->find(w.known, w.options));
  ASSERT_TRUE(report) << describe(report.error());
  expect_each_once(*report, giver, 1);
  EXPECT_EQ(w.nodes[1]->slave.pending().node_id, NodeId(50));
}

NodeOptions leaves(TypeCode type_of, std::uint32_t serial) {
  NodeOptions o;
  o.address = {type_of.vendor, type_of.product, revision, serial};
  o.habit = device::LssHabit::canopennode;
  return o;
}

// Where one stayed, whoever is found after it is gone round too, though it left the search with its node-ID: nobody is
// led to its address any more, and that is no reason to begin again.
TEST_P(Stayers, WhoLeavesBesideOneThatStaysEndsNoSearch) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    for (const bool other_type : {true, false}) {
      SCOPED_TRACE(testing::Message() << seed << other_type);
      World w(seed);
      w.add(lely(4));
      w.add(leaves(other_type ? TypeCode{0x360, 2} : type, 7));
      w.add(leaves(other_type ? TypeCode{0x361, 9} : type, 0x12345678));
      w.known.kinds = {{type, revision}, {{0x360, 2}, revision}};
      Giver giver;
      w.options.assigner = &giver;
      w.options.window = 100ms;
      const auto report = w.find(GetParam());
      ASSERT_TRUE(report) << describe(report.error());
      expect_each_once(*report, giver, 3);
      EXPECT_LT(report->ended - report->began, 15s);
    }
  }
}

// As SocketCAN's port: what was received is told a little later, when the next request is on the wire.
TEST_P(Stayers, ANewOneIsFoundSoonThroughASlowHost) {
  rt::Duration sum{0};
  rt::Duration longest{0};
  constexpr unsigned runs = 60;
  for (std::uint64_t seed = 1; seed <= runs; ++seed) {
    World w(seed);
    const auto controller = w.bus.attach();
    const device::Timing host{.response_min = 100us, .response_max = 1500us};
    device::TimedPort slow(w.world.executor(), *controller, host, Random(seed));
    can::Dispatcher dispatcher(w.world.executor(), slow);
    lss::Master master(dispatcher);
    w.add(lely(4, NodeId(2)));
    w.known.registered = {w.nodes[0]->options.address};
    w.add(seed % 2 == 0 ? lely(0x12345678) : leaves({0x360, 2}, 0x12345678));
    w.known.kinds = {{type, revision}};
    Giver giver;
    giver.next = 50;
    w.options.assigner = &giver;
    w.options.window = 100ms;
    const auto walker = make(GetParam(), {dispatcher, master});
    const auto report = w.run(walker->find(w.known, w.options));
    ASSERT_TRUE(report) << describe(report.error());
    expect_each_once(*report, giver, 1);
    const auto time = report->ended - report->began;
    sum += time;
    longest = std::max<rt::Duration>(longest, time);
  }
  EXPECT_LT(sum / runs, 6s);
  EXPECT_LT(longest, 15s);
}

// Two with one address are told by two answers to one question, staying or not.
TEST_P(Stayers, ClonesAreTold) {
  unsigned told = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    World w(seed);
    w.add(lely(4));
    w.add(lely(4));
    Giver giver;
    w.options.assigner = &giver;
    const auto report = w.find(GetParam());
    ASSERT_TRUE(report);
    ASSERT_EQ(report->found.size(), 1U);
    told += report->found[0].possible_clone ? 1U : 0U;
  }
  EXPECT_GE(told, 18U);
}

// The published procedure cannot look past who answers on: found once, lent one node-ID, and it says why it ends.
TEST(StayersPublished, TheProcedureEndsInWords) {
  for (const NodeId has : {NodeId(), NodeId(33)}) {
    World w;
    w.add(lely(4, has));
    Giver giver;
    w.options.assigner = &giver;
    w.options.confirm = true;
    const auto report = w.find(Method::fastscan);
    ASSERT_TRUE(report) << describe(report.error());
    EXPECT_EQ(report->end, Report::End::stuck) << name(report->end);
    ASSERT_EQ(report->found.size(), 1U);
    EXPECT_FALSE(report->found[0].possible_clone);
    EXPECT_EQ(report->found[0].active, has);
    EXPECT_EQ(giver.asked.size(), has.configured() ? 0U : 1U);
    EXPECT_EQ(w.nodes[0]->slave.pending().node_id, has.configured() ? has : NodeId(1));
  }
}

TEST(StayersPublished, WhoIsRegisteredIsNotToldAgain) {
  World w;
  w.add(lely(4, NodeId(33)));
  w.known.registered = {w.nodes[0]->options.address};
  Giver giver;
  w.options.assigner = &giver;
  w.options.confirm = true;
  const auto report = w.find(Method::fastscan);
  ASSERT_TRUE(report) << describe(report.error());
  EXPECT_TRUE(report->found.empty());
  EXPECT_EQ(report->end, Report::End::stuck);
}

TEST(StayersAuto, FindsEachOnceAndEnds) {
  World w;
  w.add(lely(4));
  w.add(lely(9, NodeId(2)));
  w.add(lely(10, NodeId(3)));
  w.known.kinds = {{type, revision}};
  w.known.registered = {w.nodes[1]->options.address};
  Giver giver;
  giver.next = 50;
  w.options.assigner = &giver;
  Auto all(w.services(), {});
  const auto report = w.run(all.find(w.known, w.options));
  ASSERT_TRUE(report) << describe(report.error());
  EXPECT_EQ(report->end, Report::End::complete) << name(report->end);
  EXPECT_EQ(giver.asked.size(), 1U);
  ASSERT_EQ(report->found.size(), 2U);
  for (const auto& d : report->found) EXPECT_FALSE(d.possible_clone);
  EXPECT_EQ(w.nodes[2]->slave.pending().node_id, NodeId(3));
  EXPECT_LT(report->ended - report->began, 5s);
}

}  // namespace
}  // namespace berth::discovery::test::stayers_tests

// Gateways of a plant that are the NMT masters of the buses beneath: node-IDs, boot-up from the bottom, what is told
// above (docs/multilevel.md).
#include <gtest/gtest.h>
#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "boom.hpp"

namespace berth::plant::gateway_master_tests {

// Blank devices beneath, by RAND and by Fastscan, get the node-IDs of the network list that came through the gateway.
TEST_F(Boom, GivesNodeIdsByItsNetworkList) {
  world->sim().run_for(500ms);
  EXPECT_EQ(truth("boom gateway").state, NmtState::pre_operational);
  commission();
  EXPECT_TRUE(world->sim().run_until([&] { return all_run(); }, 20s));
  EXPECT_EQ(truth("valve 1").persistent, NodeId(4));
  EXPECT_EQ(truth("valve 2").persistent, NodeId(5));
  EXPECT_EQ(truth("sensor").persistent, NodeId(6));
}

// A device that RAND has found and that has no place yet answers the next search, too: its place may come. Else it
// would have to be found by LSS, its address asked for in halves.
TEST_F(Boom, ADeviceThatWasFoundBeforeItHadAPlaceIsFoundAgainByRand) {
  world->sim().run_for(500ms);
  auto rows = list();
  std::erase_if(rows, [](const Row& row) { return row.object.index != 0x1016 && row.object.sub == 5; });
  rows.push_back({{0x1010, 1}, 0x65766173});
  rows.push_back({{0x1F82, 1}, 6, 1});
  write(rows);
  ASSERT_TRUE(world->sim().run_until([&] { return truth("sensor").state == NmtState::operational; }, 20s));
  world->sim().run_for(5s);
  EXPECT_EQ(truth("valve 1").persistent, NodeId(4));
  EXPECT_FALSE(truth("valve 2").active.configured());
  const Record boom(*world->bus("boom"));
  commission();
  EXPECT_TRUE(world->sim().run_until([&] { return all_run(); }, 20s));
  EXPECT_EQ(truth("valve 2").persistent, NodeId(5));
  const auto halves = [](const std::string& frame) {
    return frame.starts_with("7E5#4A") || frame.starts_with("7E5#4B");
  };
  EXPECT_EQ(std::ranges::count_if(boom.text, halves), 0);
}

// Devices that boot with their node-IDs while the master searches for them answer the search, too: they keep what they
// have, and none is given the other's.
TEST_F(Boom, DevicesThatBootDuringASearchKeepTheirNodeIds) {
  world->sim().run_for(500ms);
  commission();
  ASSERT_TRUE(world->sim().run_until([&] { return all_run(); }, 20s));
  for (auto later = 0ms; later < 1300ms; later += 25ms) {
    for (const char* const name : {"valve 1", "valve 2"}) world->find(name)->power(false);
    world->sim().run_for(2s + later);
    world->find("valve 2")->power(true);
    world->sim().run_for(200ms);
    world->find("valve 1")->power(true);
    ASSERT_TRUE(world->sim().run_until([&] { return all_run(); }, 20s)) << later.count();
    world->sim().run_for(2s);
    EXPECT_EQ(truth("valve 1").persistent, NodeId(4)) << later.count();
    EXPECT_EQ(truth("valve 2").persistent, NodeId(5)) << later.count();
  }
}

// Beside one that boots with its node-ID a new one is looked for: it does not get that one's.
TEST_F(Boom, ANewDeviceDoesNotGetWhatBootsMeanwhile) {
  world->sim().run_for(500ms);
  commission();
  ASSERT_TRUE(world->sim().run_until([&] { return all_run(); }, 20s));
  auto& fresh = *world->find("valve 2");
  auto& other = *world->find("valve 1");  // with the lower node-ID, which would be given first
  std::uint32_t serial = 1000;
  unsigned counted = 0;
  for (auto gap = 100ms; gap < 1500ms; gap += 100ms) {
    for (auto later = 0ms; later < 1300ms; later += 100ms) {
      SCOPED_TRACE(std::to_string(gap.count()) + " ms, " + std::to_string(later.count()) + " ms");
      fresh.power(false);
      other.power(false);
      world->sim().run_for(2s + later);
      fresh.next_power_on() = {.serial = ++serial, .node_id = NodeId()};
      fresh.power(true);
      world->sim().run_for(gap);
      other.power(true);
      const auto given = [&] { return truth("valve 2").persistent.configured(); };
      const auto booted = [&] { return truth("valve 1").state == NmtState::pre_operational; };
      ASSERT_TRUE(world->sim().run_until([&] { return given() || booted(); }, 20s));
      // Not before it was asked to store (17h): else the new device has replaced the other, which comes back too late.
      world->sim().run_for(50ms);
      const bool in_time = !given();
      ASSERT_TRUE(world->sim().run_until([&] { return all_run(); }, 20s));
      counted += in_time ? 1U : 0U;
      EXPECT_TRUE(!in_time || world->duplicates().empty());
      if (!in_time) other.next_power_on() = {.node_id = NodeId(truth("valve 2").persistent == NodeId(4) ? 5 : 4)};
    }
  }
  EXPECT_GT(counted, 20U);
}

namespace {

// Devices by RAND with node-IDs of their own, in the NMT state stopped and without a heartbeat: neither SDO nor error
// control tells of them, LSS alone does.
struct Silent : Boom {
  Silent() { build(std::string(master_beneath) + devices); }
  static constexpr const char* devices = R"(
[[device]]
name = "blank"
bus = "boom"
type = { vendor = 1, product = 3 }
serial = 10
[[device]]
name = "own"
bus = "boom"
type = { vendor = 1, product = 3 }
serial = 11
node_id = 4
[[device]]
name = "foreign"
bus = "boom"
type = { vendor = 1, product = 7 }
serial = 12
node_id = 5
)";
  /// The list has these node-IDs for devices of product 3.
  void commission_for(const std::vector<std::uint8_t>& nodes) {
    world->sim().run_for(500ms);
    for (const char* const name : {"own", "foreign"}) {
      if (auto* const device = world->find(name)) device->device().apply(co::NmtCommand::stop);
    }
    std::vector<Row> rows;
    for (const std::uint8_t node : nodes) {
      rows.push_back({{0x1F81, node}, 0x05});
      rows.push_back({{0x1F85, node}, 1});
      rows.push_back({{0x1F86, node}, 3});
    }
    rows.push_back({{0x1010, 1}, 0x65766173});
    rows.push_back({{0x1F82, 1}, 6, 1});
    write(rows);
  }
  void the_blank_one_gets_6_and_own_keeps_4() {
    ASSERT_TRUE(world->sim().run_until([&] { return truth("blank").persistent.configured(); }, 10s));
    world->sim().run_for(2s);
    EXPECT_EQ(truth("blank").persistent, NodeId(6));
    EXPECT_EQ(truth("own").persistent, NodeId(4));
    EXPECT_TRUE(world->duplicates().empty());
  }
};

// Two blank devices of one type.
struct Equal : Silent {
  static constexpr const char* devices = R"(
[[device]]
name = "low"
bus = "boom"
type = { vendor = 1, product = 3 }
serial = 10
[[device]]
name = "high"
bus = "boom"
type = { vendor = 1, product = 3 }
serial = 20
)";
};

}  // namespace

// One that keeps its own node-ID is seen before the first is given, also where the list has one place alone for its
// type.
TEST_F(Silent, NoneGetsWhatASilentDeviceHas) {
  commission_for({4});
  world->sim().run_for(5s);
  EXPECT_FALSE(truth("blank").persistent.configured());
  EXPECT_EQ(truth("own").persistent, NodeId(4));
  EXPECT_TRUE(world->duplicates().empty());
}

TEST_F(Silent, TheOtherPlaceOfItsTypeIsGiven) {
  commission_for({4, 6});
  the_blank_one_gets_6_and_own_keeps_4();
}

// It does not answer guarding either: its heartbeat producer is on, and its next heartbeat far away.
TEST_F(Silent, NorWhatOneHasThatAnswersLssAlone) {
  std::string text = std::string(master_beneath) + devices;
  const std::string own = "name = \"own\"\n";
  text.insert(text.find(own) + own.size(), "heartbeat = \"60 s\"\n");
  build(text);
  commission_for({4, 6});
  the_blank_one_gets_6_and_own_keeps_4();
}

// One of another type, which the list does not know.
TEST_F(Silent, NorWhatADeviceOfAnotherTypeHas) {
  commission_for({5, 6});
  ASSERT_TRUE(world->sim().run_until([&] { return truth("blank").persistent.configured(); }, 10s));
  world->sim().run_for(3s);
  EXPECT_EQ(truth("blank").persistent, NodeId(6));
  EXPECT_EQ(truth("foreign").persistent, NodeId(5));
  EXPECT_TRUE(world->duplicates().empty());
}

// Of two of one type the one with the higher serial number is found first, as the other comes while the search is on.
// Which one the search found first is the order in which it selects them (43h) before the first node-ID (11h).
TEST_F(Equal, TheLowerSerialNumberGetsTheLowerNodeIdInWhateverOrderTheyAreFound) {
  unsigned turned_round = 0;
  for (auto later = 0ms; later < 3000ms; later += 20ms) {
    build(std::string(master_beneath) + devices);
    Record beneath(*world->bus("boom"));
    world->sim().run_for(500ms);
    world->find("low")->unplug();
    commission_for({4, 6});
    world->sim().run_for(later);
    world->find("low")->plug();
    const auto both = [&] { return truth("low").persistent.configured() && truth("high").persistent.configured(); };
    ASSERT_TRUE(world->sim().run_until(both, 30s)) << later.count();
    const auto first = [&](std::string_view begin) {
      const auto is = [&](const std::string& frame) { return frame.starts_with(begin); };
      return std::ranges::find_if(beneath.text, is) - beneath.text.begin();
    };
    const auto low = first("7E5#430A"), high = first("7E5#4314"), given = first("7E5#11");
    if (high > low || low > given) continue;
    ++turned_round;
    EXPECT_EQ(truth("low").persistent, NodeId(4)) << later.count();
    EXPECT_EQ(truth("high").persistent, NodeId(6)) << later.count();
  }
  EXPECT_GT(turned_round, 0U);
}

// The master is gone in the middle of a search.
TEST_F(Boom, AWorldEndsDuringASearch) {
  for (auto later = 0ms; later < 1300ms; later += 50ms) {
    build();
    world->sim().run_for(500ms);
    world->find("sensor")->unplug();
    commission();
    world->sim().run_for(later);
  }
}

// A power cycle: the device above boots when the bus beneath is operational, not before (S3.3).
TEST_F(Boom, BootsFromTheBottomUp) {
  world->sim().run_for(500ms);
  commission();
  ASSERT_TRUE(world->sim().run_until([&] { return all_run(); }, 20s));
  SimDevice& above = *world->find("boom gateway");
  above.power(false);
  world->sim().run_for(100ms);
  record->text.clear();
  above.power(true);
  const auto booted = [&] { return !record->text.empty(); };
  ASSERT_TRUE(world->sim().run_until(booted, 20s));
  EXPECT_EQ(record->text.front(), "703#00");
  EXPECT_EQ(truth("boom port").state, NmtState::operational);
  EXPECT_EQ(truth("sensor").state, NmtState::operational);
}

// A device of a mandatory slave's type that comes later gets the node-ID that is free, and the bus goes on. It is as
// well when a device is gone for good and a new one comes in its place.
TEST_F(Boom, PutsAReplacementToWork) {
  world->sim().run_for(500ms);
  world->find("valve 2")->unplug();
  commission();
  ASSERT_TRUE(world->sim().run_until([&] { return truth("sensor").state == NmtState::operational; }, 20s));
  world->sim().run_for(5s);
  EXPECT_EQ(truth("boom port").state, NmtState::pre_operational) << "node 5 is mandatory";
  world->find("valve 2")->plug();
  ASSERT_TRUE(world->sim().run_until([&] { return all_run(); }, 20s));
  EXPECT_EQ(truth("boom port").state, NmtState::operational);
  EXPECT_EQ(truth("valve 2").persistent, NodeId(5));
  world->find("valve 1")->unplug();
  world->sim().run_for(2s);
  world->find("valve 1")->next_power_on() = {.serial = 77, .node_id = NodeId()};
  world->find("valve 1")->plug();
  ASSERT_TRUE(world->sim().run_until([&] { return all_run(); }, 20s));
  EXPECT_EQ(truth("valve 1").persistent, NodeId(4));
}

// One heartbeat beneath that stops is one emergency above, its return another (S3.12).
TEST_F(Boom, TellsAboveWhatIsLostBeneathOnce) {
  world->sim().run_for(500ms);
  commission();
  ASSERT_TRUE(world->sim().run_until([&] { return all_run(); }, 20s));
  world->find("boom gateway")->device().apply(co::NmtCommand::start);
  world->sim().run_for(1s);
  record->text.clear();
  world->find("valve 2")->unplug();
  world->sim().run_for(2s);
  EXPECT_EQ(record->text, std::vector<std::string>{"083#3081110500000000"});
  record->text.clear();
  world->find("valve 2")->plug();
  ASSERT_TRUE(world->sim().run_until([&] { return all_run(); }, 20s));
  world->sim().run_for(1s);
  EXPECT_EQ(record->text, std::vector<std::string>{"083#0000000500003081"});
}

}  // namespace berth::plant::gateway_master_tests

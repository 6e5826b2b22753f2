// Devices of a plant as flying masters (docs/flying-master.md; key `master` of the plant file).
#include <gtest/gtest.h>

#include <algorithm>

#include <string>

#include "berth/plant/world.hpp"

using namespace berth;
using namespace berth::plant;
using namespace std::chrono_literals;

namespace {

constexpr const char* two_masters = R"(
[bus.line]
bitrate = 250_000

[[device]]
bus     = "line"
name    = "io {n}"
type    = { vendor = 1, product = 2 }
count   = 1
node_id = 3

[[device]]
bus     = "line"
name    = "drive"
type    = { vendor = 1, product = 3 }
node_id = 4
heartbeat = "200 ms"

[[device]]
bus     = "line"
name    = "first"
type    = { vendor = 1, product = 9 }
serial  = 1
node_id = 10
master  = { priority = 0, slaves = "3, 4" }

[[device]]
bus     = "line"
name    = "second"
type    = { vendor = 1, product = 9 }
serial  = 2
node_id = 11
master  = { priority = 1, slaves = "3, 4" }

[[event]]
at     = "10 s"
action = "power-off"
device = "first"

[[event]]
at     = "20 s"
action = "power-on"
device = "first"
)";

const Truth& of(const std::vector<Truth>& all, const std::string& name) {
  return *std::ranges::find(all, name, &Truth::name);
}

std::string first_problem(const std::string& text) {
  const auto result = read_plant(text, "plant.toml");
  return result.findings.empty() ? "" : to_string(result.findings.front());
}

}  // namespace

TEST(PlantMasters, TheStandbyTakesOver) {
  const auto read = read_plant(two_masters, "plant.toml");
  ASSERT_TRUE(read.plant) << to_string(read.findings.front());
  Findings findings;
  const auto world = World::make(*read.plant, {}, findings);
  ASSERT_TRUE(world);
  world->start();
  const auto state = [&](const std::string& name) { return of(world->truth(), name).state; };
  world->sim().run_for(9s);
  EXPECT_TRUE(of(world->truth(), "first").leads);
  EXPECT_EQ(of(world->truth(), "second").active_master, NodeId(10));
  EXPECT_EQ(state("drive"), NmtState::operational);
  world->sim().run_for(6s);  // the first is off since 10 s
  EXPECT_TRUE(of(world->truth(), "second").leads);
  EXPECT_EQ(state("drive"), NmtState::operational);
  world->sim().run_for(15s);  // and back since 20 s: it is better
  EXPECT_TRUE(of(world->truth(), "first").leads);
  EXPECT_FALSE(of(world->truth(), "second").leads);
  EXPECT_EQ(of(world->truth(), "second").active_master, NodeId(10));
  EXPECT_EQ(state("drive"), NmtState::operational);
}

TEST(PlantMasters, ReadAndWritten) {
  const auto read = read_plant(two_masters, "plant.toml");
  ASSERT_TRUE(read.plant);
  const auto* const first = read.plant->device("first");
  ASSERT_TRUE(first->does.master);
  EXPECT_EQ(first->does.master->priority, 0);
  EXPECT_EQ(first->does.master->slaves, (std::vector<unsigned>{3, 4}));
  EXPECT_TRUE(first->does.master->keep_alive);
  EXPECT_EQ(first->heartbeat, 500ms);
  const auto again = read_plant(write_plant(*read.plant), "plant.toml");
  ASSERT_TRUE(again.plant) << to_string(again.findings.front());
  EXPECT_EQ(*again.plant, *read.plant);
}

TEST(PlantMasters, WhatMakesNoSense) {
  const std::string head =
      "[bus.line]\nbitrate = 250_000\n[[device]]\nbus = \"line\"\nname = \"m\"\ntype = { vendor = 1, product = 1 }\n";
  EXPECT_NE(first_problem(head + "node_id = 1\nmaster = { priority = 3, slaves = \"2\" }\n").find("priority"),
            std::string::npos);
  EXPECT_NE(first_problem(head + "node_id = 1\nmaster = { priority = 1 }\n").find("slaves"), std::string::npos);
  EXPECT_NE(first_problem(head + "node_id = 1\nmaster = { slaves = \"5..2\" }\n").find("are not node-IDs"),
            std::string::npos);
  EXPECT_NE(first_problem(head + "master = { slaves = \"2\" }\n").find("a master has a node-ID"), std::string::npos);
  EXPECT_NE(
      first_problem(head + "node_id = 1\nscript = \"a.lua\"\nmaster = { slaves = \"2\" }\n").find("leave eds, script"),
      std::string::npos);
}

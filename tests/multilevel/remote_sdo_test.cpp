// CiA 302-7's remote SDO beside the paper's gateway (docs/multilevel.md §CiA 302-7).
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/multilevel/remote_sdo.hpp"
#include "tree.hpp"

using namespace berth;
using namespace berth::multilevel;
using namespace berth::multilevel::test;

namespace {

// Client, router 3 with network 2 beneath, router 4 there with network 7 beneath that. Devices: 5 in network 2, 50
// in 7.
struct Remote : ::testing::Test {
  Remote() {
    first.emplace(world, *lines[0], 3, *lines[1], 1);
    second.emplace(world, *lines[1], 4, *lines[2], 1);
    near.emplace(world, *lines[1], 5);
    far.emplace(world, *lines[2], 50);
    RemoteNetwork beneath{.network = 2, .beneath = &first->down.dispatcher, .client = &first->client};
    RemoteNetwork beyond{.network = 7, .beneath = &first->down.dispatcher, .router = NodeId(4)};
    RemoteNetwork last{.network = 7, .beneath = &second->down.dispatcher};
    upper.emplace(world.executor(), first->upper.values(), std::vector<RemoteNetwork>{beneath, beyond});
    lower.emplace(world.executor(), second->upper.values(), std::vector<RemoteNetwork>{last});
    client.emplace(master.dispatcher);
    world.run_for(50ms);
    for (auto& line : lines) line->clear();
  }
  ~Remote() override {
    upper.reset();
    lower.reset();
  }
  std::string ask(const std::string& request, rt::Duration time = 10ms) {
    const auto before = lines[0]->log.size();
    master.send("603#" + request);
    world.run_for(time);
    std::string answer;
    for (auto i = before; i < lines[0]->log.size(); ++i) {
      if (lines[0]->log[i].starts_with("583#")) answer = lines[0]->log[i].substr(4);
    }
    return answer;
  }
  RemoteAccess access(std::uint16_t network, unsigned node) {
    return {master.dispatcher, *client, NodeId(3), network, NodeId(static_cast<std::uint8_t>(node)), turn};
  }
  sim::World world;
  std::vector<std::unique_ptr<Line>> lines = [this] {
    std::vector<std::unique_ptr<Line>> made;
    for (int i = 0; i < 3; ++i) made.push_back(std::make_unique<Line>(world, "bus" + std::to_string(i)));
    return made;
  }();
  Station master{world, *lines[0]};
  std::optional<Gateway> first, second;
  std::optional<Leaf> near, far;
  std::optional<RemoteSdo> upper, lower;
  std::optional<co::SdoClient> client;
  rt::Turn turn;
};

}  // namespace

// S3.38: indication, confirmation, and then the transfer as it is, frame by frame; the next one without an indication
// is the router's own.
TEST_F(Remote, IndicationAndTransfer) {
  EXPECT_EQ(ask("E002000500000000"), "E002000500000000");
  EXPECT_EQ(ask("4000100000000000"), "4300100092010200");
  EXPECT_EQ(lines[1]->log, (Log{"605#4000100000000000", "585#4300100092010200"}));
  EXPECT_EQ(upper->busy(), 0U);
  EXPECT_EQ(ask("4000100000000000"), "4300100000000000");
  EXPECT_EQ(ask("E002000500000000"), "E002000500000000");
  EXPECT_EQ(ask("2B01200034120000"), "6001200000000000");
  EXPECT_EQ(near->device.values().get<std::uint16_t>({0x2001, 0}), 0x1234);
  EXPECT_EQ(ask("E002000500000000"), "E002000500000000");
  EXPECT_EQ(ask("4034560000000000"), "8034560000000206");  // the node's own refusal
  EXPECT_EQ(upper->busy(), 0U);
}

// Two routers: the indication goes on to the next one, which confirms it.
TEST_F(Remote, ThroughTwoRouters) {
  EXPECT_EQ(ask("E007003200000000"), "E007003200000000");
  EXPECT_EQ(ask("4000100000000000"), "4300100092010200");
  EXPECT_EQ(lines[1]->log,
            (Log{"604#E007003200000000", "584#E007003200000000", "604#4000100000000000", "584#4300100092010200"}));
  EXPECT_EQ(lines[2]->log, (Log{"632#4000100000000000", "5B2#4300100092010200"}));
  EXPECT_EQ(upper->busy() + lower->busy(), 0U);
}

// Network 0 is this one; others that are not known, and node-IDs that are none, are refused.
TEST_F(Remote, WhatIsRefused) {
  EXPECT_EQ(ask("E000000000000000"), "E000000000000000");
  EXPECT_EQ(ask("4000100000000000"), "4300100000000000");
  EXPECT_EQ(ask("E009000500000000"), "8009000523000A06");
  EXPECT_EQ(ask("E002000000000000"), "8002000023000A06");
  EXPECT_EQ(ask("E002008000000000"), "8002008023000A06");
  EXPECT_EQ(upper->busy(), 0U);
  // The router itself is busy with that node: its own transfer is not mixed with another's.
  near->device.power_off();
  rt::Scope scope(world.executor());
  co::NodeAccess own(first->client, NodeId(5));
  std::optional<Result<std::uint32_t>> value;
  scope.spawn(keep(own.read_u32(0x1000, 0), value));
  world.run_for(1ms);
  EXPECT_EQ(ask("E002000500000000"), "8002000521000008");
  world.run_for(2s);
}

// Any length, both ways, segmented and in blocks.
TEST_F(Remote, AnyLength) {
  for (const auto mode : {co::SdoMode::segmented, co::SdoMode::block, co::SdoMode::automatic}) {
    co::SdoOptions options;
    options.mode = mode;
    client->set_options(options);
    for (auto* const leaf : {&*near, &*far}) {
      auto remote = leaf == &*near ? access(2, 5) : access(7, 50);
      for (const std::size_t length : {1U, 4U, 5U, 7U, 8U, 50U, 889U, 890U, 5000U}) {
        SCOPED_TRACE(length);
        const auto bytes = numbers(length, length);
        const auto done = await(world, remote.write(0x2004, 0, bytes));
        ASSERT_TRUE(done) << describe(done.error());
        const auto stored = leaf->device.values().bytes({0x2004, 0});
        EXPECT_EQ(Bytes(stored.begin(), stored.end()), bytes);
        EXPECT_EQ(bytes_of(await(world, remote.read(0x2004, 0))), bytes);
        world.run_for(5ms);  // the end of a block upload is on its way down
        EXPECT_EQ(upper->busy() + lower->busy(), 0U);
      }
    }
  }
}

// A node that is not there costs one time-out of the router's; a router that is not there one of the client's.
TEST_F(Remote, Silence) {
  auto nobody = access(2, 99);
  const auto before = world.now();
  const auto value = await(world, nobody.read(0x1000, 0));
  ASSERT_FALSE(value);
  EXPECT_EQ(value.error().code, Errc::timeout);
  EXPECT_EQ(value.error().node, 99);
  EXPECT_LT(world.now() - before, 1100ms);
  EXPECT_EQ(upper->busy(), 0U);
  first->upper.power_off();
  auto remote = access(2, 5);
  EXPECT_EQ(await(world, remote.read(0x1000, 0)).error().code, Errc::timeout);
  first->upper.power_on();
  world.run_for(50ms);
  EXPECT_TRUE(await(world, remote.read(0x1000, 0)));
}

// Frames are lost on all buses: an access may fail, but it ends, and no wrong value comes of it.
TEST_F(Remote, FramesAreLost) {
  auto remote = access(7, 50);
  for (auto& line : lines) line->bus.faults().draw_from({.overrun_per_million = 5000});
  unsigned good = 0;
  for (unsigned i = 0; i < 100; ++i) {
    const auto bytes = numbers(1 + i * 7 % 200, i);
    const auto done = await(world, remote.write(0x2004, 0, bytes), 120s);
    const auto stored = far->device.values().bytes({0x2004, 0});
    if (done) {
      ASSERT_EQ(Bytes(stored.begin(), stored.end()), bytes);
      ++good;
    }
  }
  EXPECT_GT(good, 30U);
  for (auto& line : lines) line->bus.faults().draw_from({});
  world.run_for(10s);
  EXPECT_EQ(upper->busy() + lower->busy(), 0U);
  EXPECT_TRUE(await(world, remote.read(0x1000, 0)));
}

// S3.38: measured against the paper's: frames on the client's bus for one upload of four bytes, the first and a further
// one.
TEST_F(Remote, FramesBesideThePapers) {
  const auto frames = [&](co::SdoAccess& use) {
    lines[0]->clear();
    EXPECT_TRUE(await(world, use.read_u32(0x1000, 0)));
    return lines[0]->log.size();
  };
  Routes routes(*client);
  auto& beneath = routes.access(*parse_path("3/5"));
  auto& beyond = routes.access(*parse_path("3/4/50"));
  auto remote = access(2, 5);
  auto remote_beyond = access(7, 50);
  EXPECT_EQ(frames(beneath), 6U);
  EXPECT_EQ(frames(beneath), 4U);
  EXPECT_EQ(frames(remote), 4U);
  EXPECT_EQ(frames(remote), 4U);
  EXPECT_EQ(frames(beyond), 2U * 6 + 2);  // node 5 was selected, not 4: all seven accesses
  EXPECT_EQ(frames(beyond), 8U);
  EXPECT_EQ(frames(remote_beyond), 4U);
}

// Who is on a bus that runs: what is heard, and what a device tells. Expected values: CiA 301, objects 1000h, 1017h and
// 1018h, SDO upload (expedited answers 4Fh, 4Bh, 47h, 43h; abort 80h), heartbeat on 700h + node-ID.
#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <map>
#include <vector>

#include "berth/live/census.hpp"

#include "../pch.hpp"
#include "berth/rt/scope.hpp"
#include "berth/sim/world.hpp"

namespace berth::live {
namespace {

using namespace std::chrono_literals;
using can::Frame;

using Objects = std::map<std::uint32_t, std::vector<std::uint8_t>>;  // index << 8 | sub

// Node 5: answers uploads from a list, in one segment, and beats when it is told to.
class Node final : private can::Handler, private rt::Job {
 public:
  Node(can::Dispatcher& dispatcher, Objects objects) : dispatcher_(&dispatcher), objects_(std::move(objects)) {
    dispatcher.add({0x605, 0x605}, *this);
  }
  void beat() { dispatcher_->send(Frame::base(0x705, {0x05})); }
  unsigned asked = 0;
  std::uint32_t endless = 0;  // of this object there is no last segment
  std::uint8_t piece = 7;     // bytes in each
  rt::Duration after{0};

 private:
  void received(const Frame& frame, rt::Time) noexcept override {
    ++asked;
    const auto& in = frame.data;
    const auto object = std::uint32_t(in[2]) << 16U | std::uint32_t(in[1]) << 8U | in[3];
    if (endless != 0 && in[0] == 0x40 && object == endless) {
      dispatcher_->send(Frame::base(0x585, {0x40, in[1], in[2], in[3], 0, 0, 0, 0}));
      return;
    }
    if ((in[0] & 0xE0U) == 0x60) {
      const auto command = static_cast<std::uint8_t>((in[0] & 0x10U) | (7U - piece) << 1U);
      next_ = Frame::base(0x585, {command, 'x', 'x', 'x', 'x', 'x', 'x', 'x'});
      dispatcher_->executor().after(after, *this);
      return;
    }
    if (in[0] == 0x80) return;
    Frame answer = Frame::base(0x585, {0x80, in[1], in[2], in[3], 0x00, 0x00, 0x02, 0x06});
    const auto found = objects_.find(std::uint32_t(in[2]) << 16U | std::uint32_t(in[1]) << 8U | in[3]);
    if (found != objects_.end()) {
      const auto& bytes = found->second;
      answer.data[0] = static_cast<std::uint8_t>(0x43U | (4 - bytes.size()) << 2U);
      std::copy_n(std::vector<std::uint8_t>(4).begin(), 4, answer.data.begin() + 4);
      std::ranges::copy(bytes, answer.data.begin() + 4);
    }
    dispatcher_->send(answer);
  }
  void run() noexcept override { dispatcher_->send(next_); }
  can::Dispatcher* dispatcher_;
  Objects objects_;
  Frame next_;
};

const Objects complete{{0x100000, {0x91, 0x01, 0, 0}}, {0x101801, {1, 0, 0, 0}},    {0x101802, {2, 0, 0, 0}},
                       {0x101803, {3, 0, 0, 0}},       {0x101804, {4, 0, 0, 0x80}}, {0x100800, {'p', 'u', 'm', 'p'}}};

class CensusOnABus : public ::testing::Test {
 protected:
  // Beats that another computer's load has moved: 60 to 140 ms apart.
  void uneven_beats(Node& node) {
    for (const auto gap : {60ms, 140ms, 60ms, 140ms, 60ms, 60ms, 140ms, 60ms}) {
      world.run_for(gap);
      node.beat();
    }
    world.run_for(1ms);
  }
  std::vector<NodeSeen> ask() {
    bool over = false;
    rt::Scope scope(world.executor());
    scope.spawn(run(over));
    for (int i = 0; i < 100 && !over; ++i) world.run_for(100ms);
    EXPECT_TRUE(over);
    return census.nodes();
  }
  rt::Task<void> run(bool& over) {
    const auto asked = co_await census.ask(options);
    EXPECT_TRUE(asked);
    over = true;
  }
  sim::World world{7};
  sim::Bus& bus = world.add_bus("line", 250'000);
  std::unique_ptr<sim::Controller> mine = bus.attach({});
  std::unique_ptr<sim::Controller> theirs = bus.attach({});
  can::Dispatcher ours{world.executor(), *mine};
  can::Dispatcher device{world.executor(), *theirs};
  Census census{ours};
  CensusOptions options;
};

TEST_F(CensusOnABus, TheHeartbeatIsTheOneThatTheDeviceTells) {
  Objects objects = complete;
  objects[0x101700] = {100, 0};
  Node node(device, objects);
  uneven_beats(node);
  EXPECT_EQ(census.nodes().at(0).period, 60ms) << "heard only: the median";
  const auto nodes = ask();
  ASSERT_EQ(nodes.size(), 1U);
  EXPECT_EQ(nodes[0].period, 100ms);
  EXPECT_EQ(nodes[0].identity, (LssAddress{1, 2, 3, 0x80000004}));
  EXPECT_EQ(nodes[0].device_type, 0x191U);
  EXPECT_EQ(nodes[0].name, "pump");
  EXPECT_EQ(nodes[0].problem, "");
}

TEST_F(CensusOnABus, ADeviceWithoutTheObjectIsNoMaster) {
  Objects objects = complete;
  Node plain(device, objects);
  plain.beat();
  world.run_for(1ms);
  EXPECT_FALSE(ask().front().nmt_master) << "it has no 1F80h";
}

// A master with nothing but a heartbeat looks like a device until it is asked.
TEST_F(CensusOnABus, AMasterIsToldByBit0Of1F80) {
  for (const std::uint8_t startup : std::array<std::uint8_t, 4>{0x00, 0x08, 0x01, 0x0F}) {
    Objects objects = complete;
    objects[0x1F8000] = {startup, 0, 0, 0};
    objects[0x1F8100] = {127};
    Node node(device, objects);
    node.beat();
    world.run_for(1ms);
    const auto seen = ask();
    ASSERT_EQ(seen.size(), 1U);
    EXPECT_EQ(seen.front().nmt_master, (startup & 1U) != 0) << int{startup};
    EXPECT_EQ(seen.front().network_list.has_value(), (startup & 1U) != 0);
    EXPECT_EQ(seen.front().name, "pump") << "and the rest is read";
  }
}

TEST_F(CensusOnABus, WithoutTheObjectTheHeartbeatIsWhatWasHeard) {
  for (const bool wrong_size : {false, true}) {
    Objects objects = complete;
    if (wrong_size) objects[0x101700] = {100, 0, 0, 0};  // 1017h has 16 bits
    Node node(device, objects);
    uneven_beats(node);
    const auto nodes = ask();
    EXPECT_EQ(nodes.at(0).period, 60ms);
    EXPECT_TRUE(nodes[0].identity);
  }
}

TEST_F(CensusOnABus, ANodeThatAnotherClientTalksToIsLeftAlone) {
  Node node(device, complete);
  node.beat();
  auto third = bus.attach({});
  third->send(Frame::base(0x605, {0x40, 0x00, 0x10, 0, 0, 0, 0, 0}), 0);
  world.run_for(1s);
  EXPECT_EQ(node.asked, 1U);
  const auto nodes = ask();
  EXPECT_EQ(node.asked, 1U);
  EXPECT_TRUE(nodes.at(0).foreign_client);
  EXPECT_FALSE(nodes[0].identity);
  EXPECT_EQ(nodes[0].problem, "another SDO client talks to it");
}

TEST_F(CensusOnABus, WithoutAnIdentityItSaysSo) {
  Node node(device, {{0x100000, {0, 0, 0, 0}}});
  node.beat();
  world.run_for(1ms);
  const auto nodes = ask();
  ASSERT_TRUE(nodes.at(0).identity);
  EXPECT_EQ(nodes[0].identity->unknown, Identity::all_unknown);
  EXPECT_EQ(nodes[0].identity->at, nodes[0].id) << "it is known by its node-ID";
  EXPECT_EQ(nodes[0].problem, "it has no identity object 1018h");
}

// CiA 301 makes the vendor-ID alone mandatory.
TEST_F(CensusOnABus, WhatItDoesNotSayIsUnknown) {
  Node node(device, {{0x100000, {0, 0, 0, 0}}, {0x101801, {7, 0, 0, 0}}});
  node.beat();
  world.run_for(1ms);
  const auto nodes = ask();
  ASSERT_TRUE(nodes.at(0).identity);
  EXPECT_EQ(nodes[0].identity->address.vendor, 7U);
  EXPECT_EQ(nodes[0].identity->unknown, 0b1110);
  EXPECT_EQ(nodes[0].problem, "");
}

// A node may give segments for ever, fast or each just in time: it is left, and the next one is asked.
class EndlessNode : public CensusOnABus, public ::testing::WithParamInterface<std::tuple<std::uint32_t, bool>> {};
INSTANTIATE_TEST_SUITE_P(Objects, EndlessNode,
                         ::testing::Combine(::testing::Values(0x100000U, 0x101801U, 0x101700U, 0x100800U),
                                            ::testing::Bool()));

TEST_P(EndlessNode, IsGivenUp) {
  const auto [object, trickles] = GetParam();
  Node node(device, complete);
  node.endless = object;
  node.piece = trickles ? 1 : 7;
  node.after = trickles ? rt::Duration(450ms) : rt::Duration(0);
  node.beat();
  device.send(Frame::base(0x706, {0x05}));
  world.run_for(1ms);
  const auto nodes = ask();
  ASSERT_EQ(nodes.size(), 2U);
  EXPECT_GT(node.asked, 3U) << "it gave segments";
  EXPECT_EQ(nodes[1].problem, "no answer to SDO") << "node 6, which only beats, was asked after it";
  EXPECT_LT(nodes[0].name.size(), 65U);
  EXPECT_EQ(nodes[0].identity.has_value(), object == 0x101700U || object == 0x100800U);
}

}  // namespace
}  // namespace berth::live

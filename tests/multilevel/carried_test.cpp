// What a listener on the bus above tells of the nodes beneath: real accesses through real gateways, heard on their way.
#include "berth/multilevel/carried.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "berth/base/random.hpp"
#include "tests/multilevel/tree.hpp"

namespace berth::multilevel::test {
namespace {

// What each frame of a bus was about, "" for its own.
std::vector<std::string> heard(Carried& carried, const Line& line) {
  std::vector<std::string> all;
  for (const auto& text : line.log) {
    const auto path = carried.about(*can::parse_frame(text));
    all.push_back(path ? to_string(*path) : "");
  }
  return all;
}

std::bitset<128> only(unsigned node) {
  std::bitset<128> nodes;
  nodes.set(node);
  return nodes;
}

}  // namespace

// Every frame of the first access, whatever the depth: only those that tell the gateways on the way their next node are
// about these.
TEST(CarriedFrames, OfAnAccessToAnyDepth) {
  for (unsigned depth = 1; depth <= 5; ++depth) {
    SCOPED_TRACE(depth);
    Chain chain(depth);
    Routes routes(*chain.client);
    Carried carried(only(3));
    auto& access = routes.access(chain.path);
    const std::string whole = to_string(chain.path);
    ASSERT_TRUE(await(chain.world, access.write_u32(0x2002, 0, 7)));
    const auto first = heard(carried, *chain.lines[0]);
    ASSERT_FALSE(first.empty());
    EXPECT_EQ(first.back(), whole);
    for (const auto& path : first) EXPECT_FALSE(path.empty());
    chain.lines[0]->clear();
    // The gateways know the way: all that follows is about the node.
    ASSERT_TRUE(await(chain.world, access.write_u32(0x2002, 0, 8)));
    ASSERT_TRUE(await(chain.world, access.read_u32(0x1000, 0)));
    const auto further = heard(carried, *chain.lines[0]);
    EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(further, whole)), further.size());
  }
}

// Segments and blocks hold bytes that look like commands.
TEST(CarriedFrames, LongTransfersBelongToTheirNode) {
  for (const auto mode : {co::SdoMode::segmented, co::SdoMode::automatic}) {
    Chain chain(1);
    co::SdoOptions options;
    options.mode = mode;
    Routes routes(*chain.client, options);
    auto& access = routes.access(chain.path);
    Carried carried(only(3));
    Bytes data(2000, 0x2F);  // "expedited download of one byte"
    ASSERT_TRUE(await(chain.world, access.write(0x2004, 0, data)));
    EXPECT_EQ(bytes_of(await(chain.world, access.read(0x2004, 0))), data);
    const auto all = heard(carried, *chain.lines[0]);
    EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(all, "3/50")), all.size());
  }
}

TEST(CarriedFrames, WhatIsTheBussOwn) {
  Carried carried(only(3));
  const auto about = [&](const char* text) {
    const auto path = carried.about(*can::parse_frame(text));
    return path ? to_string(*path) : "";
  };
  EXPECT_EQ(about("604#2F305F0005000000"), "") << "node 4 is no gateway";
  EXPECT_EQ(about("603#2B315F0034120000"), "") << "no node-ID was written yet";
  EXPECT_EQ(about("603#2F345F0005000000"), "3.2/5");
  EXPECT_EQ(about("583#60345F0000000000"), "3.2/5");
  EXPECT_EQ(about("603#4000100000000000"), "") << "an object of the gateway itself";
  EXPECT_EQ(about("583#4300100092010000"), "");
  EXPECT_EQ(about("603#2F305F00FF000000"), "") << "no node-ID";
  EXPECT_EQ(about("603#2F305F0080000000"), "");
  EXPECT_EQ(about("183#0000000000000000"), "");
}

// By the sub-net bytes; those of a device that uses them for itself make no path.
TEST(CarriedFrames, Emergencies) {
  Carried carried(only(3));
  const auto about = [&](const char* text) {
    const auto path = carried.about(*can::parse_frame(text));
    return path ? to_string(*path) : "";
  };
  EXPECT_EQ(about("083#1023030405000000"), "3/4/5");
  EXPECT_EQ(about("083#1023030000000000"), "") << "the gateway's own";
  EXPECT_EQ(about("083#1023030005000000"), "") << "a node behind no node";
  EXPECT_EQ(about("084#1023030405000000"), "") << "no gateway";
}

// Commands without end, each to another gateway: what is not followed any more is about the last that is.
TEST(CarriedFrames, HasABound) {
  Carried carried(only(3));
  const auto write = [&](unsigned index, std::initializer_list<std::uint8_t> value) {
    can::Frame frame = can::Frame::base(0x603, {0x23, 0, 0x5F, 0, 0, 0, 0, 0});
    frame.data[0] = static_cast<std::uint8_t>(0x23 | (4 - value.size()) << 2U);
    frame.data[1] = static_cast<std::uint8_t>(index);
    std::ranges::copy(value, frame.data.begin() + 4);
    return carried.about(frame);
  };
  const auto byte = [](unsigned value) { return static_cast<std::uint8_t>(value); };
  for (unsigned port = 0; port < 8; ++port) {
    for (unsigned node = 1; node <= 127; ++node) {
      ASSERT_TRUE(write(0x30 + 4 * port, {byte(node)}));
      ASSERT_TRUE(write(0x32 + 4 * port, {0x40, 0x30, 0x5F, 0}));
    }
  }
  EXPECT_EQ(carried.levels(), 8U * 127U);
  for (unsigned node = 1; node <= 127; ++node) {
    ASSERT_TRUE(write(0x31, {byte(node)}));
    ASSERT_TRUE(write(0x32, {0x2F, 0x30, 0x5F, 0}));  // gateway 127 beneath: its node-ID
    ASSERT_TRUE(write(0x31, {0x40, 0x30, 0x5F, 0}));
    ASSERT_TRUE(write(0x32, {0x23, 0x32, 0x5F, 0}));  // and its command, to a gateway beneath that
  }
  EXPECT_EQ(carried.levels(), Carried::most_levels);
}

TEST(CarriedFrames, AnyFrames) {
  Random random(16);
  std::bitset<128> gateways;
  for (const unsigned node : {3U, 4U, 5U}) gateways.set(node);
  Carried carried(gateways);
  for (unsigned i = 0; i < 100'000; ++i) {
    constexpr std::array<std::uint32_t, 3> bases{0x80, 0x580, 0x600};
    can::Frame frame = can::Frame::base(bases[random.below(3)] + 3 + static_cast<std::uint32_t>(random.below(4)),
                                        {0, 0, 0, 0, 0, 0, 0, 0});
    for (auto& byte : std::span(frame.data).first(8)) byte = static_cast<std::uint8_t>(random.below(256));
    // Half of them are commands to the three objects.
    if (random.below(2) == 0) {
      constexpr std::array<std::uint8_t, 6> specifiers{0x2F, 0x2B, 0x23, 0x40, 0xC2, 0x21};
      frame.data[0] = specifiers[random.below(6)];
      frame.data[1] = static_cast<std::uint8_t>(0x30 + random.below(32));
      frame.data[2] = 0x5F;
    }
    const auto path = carried.about(frame);
    if (path) {
      ASSERT_FALSE(path->gateways.empty());
      ASSERT_TRUE(gateways.test(path->gateways.front().gateway.value()));
      ASSERT_TRUE(path->node.configured());
    }
  }
  EXPECT_LE(carried.levels(), Carried::most_levels);
}

}  // namespace berth::multilevel::test

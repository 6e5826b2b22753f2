// The device's answers to RAND, its extension and AND, and its claims; expected frames by hand from docs/rand.md,
// docs/and.md and docs/claim.md.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/nodeid/rand_walk.hpp"
#include "rig.hpp"

namespace berth::device::test::node_id_methods_tests {
namespace {

constexpr LssAddress odd{0x0102'0304, 0x0506'0708, 0x090A'0B0C, 0x0D0E'0F10};

struct Line {
  explicit Line(Options options, std::uint32_t bit_rate = 500'000) : rig(bit_rate) {
    options.address = odd;
    node = std::make_unique<Node>(rig.world, rig.bus, std::move(options));
    node->on();
    rig.run(milliseconds(10));
    rig.record.clear();
  }
  std::string ask(std::string_view frame) {
    rig.record.clear();
    rig.ask(frame, milliseconds(2));
    return rig.record.text.size() > 1 ? rig.record.text.back() : "";
  }
  Rig rig;
  std::unique_ptr<Node> node;
};

TEST(NodeIdMethods, RandWithAndWithoutTheExtension) {
  for (const bool resume : {false, true}) {
    Line l({.rand_resume = resume});
    EXPECT_EQ(l.ask("1F940000#8600000000000000"), resume ? "1F500408#" : "");
    EXPECT_EQ(l.ask("1F940000#8601010200000000"), resume ? "1F500C10#" : "");
    EXPECT_EQ(l.ask("1F940000#8601010300000000"), "");
    EXPECT_EQ(l.ask("1F940000#80000000"), "1F500408#") << "the published one works with both";
    EXPECT_EQ(l.ask("7C2#8000000000000000"), "") << "AND is off";
  }
}

TEST(NodeIdMethods, S1_44_And) {
  Line l({.rand = RandMode::off, .and_protocol = true});
  EXPECT_EQ(l.ask("7C2#8000000000000000"), "7A0#0000000000000000");
  EXPECT_EQ(l.ask("7C2#8001000000000000"), "7A7#0000000000000000");
  EXPECT_EQ(l.ask("7C2#800C07080D0E0F10"), "7B0#0000000000000000");
  EXPECT_EQ(l.node->device.schemes().and_identification(), nodeid::Identification::identified);
  EXPECT_EQ(l.ask("7C2#8301000000000000"), "7C1#090A0B0C0D0E0F10");
  EXPECT_EQ(l.ask("1F940000#80000000"), "") << "RAND is off";
  EXPECT_EQ(l.ask("7C2#8000000000000000"), "");
  l.node->off();
  l.node->on();
  l.rig.run(milliseconds(5));
  EXPECT_EQ(l.ask("7C2#8000000000000000"), "7A0#0000000000000000") << "power-on: unknown";
}

// Devices with a receive buffer of one frame, which they take 3 ms to read: requests that come faster are lost.
TEST(NodeIdMethods, SlowDevicesWithOneReceiveBufferAreFoundByTheWalk) {
  for (const bool resume : {false, true}) {
    Rig rig(125'000);
    std::vector<std::unique_ptr<Node>> nodes;
    Random random(3);
    for (unsigned i = 0; i < 6; ++i) {
      const Timing slow{.response_min = milliseconds(3), .response_max = milliseconds(3), .rx_depth = 1};
      auto address = address_of(static_cast<std::uint32_t>(random.next()));
      nodes.push_back(
          std::make_unique<Node>(rig.world, rig.bus, Options{.address = address, .rand_resume = resume}, slow));
      nodes.back()->on();
    }
    rig.run(milliseconds(10));
    can::Dispatcher dispatcher(rig.world.executor(), *rig.me);
    nodeid::RandWalk walk(dispatcher);
    const nodeid::WalkOptions options{.longest = milliseconds(10)};
    struct Done final : rt::Job {
      void run() noexcept override { is = true; }
      bool is = false;
    } done;
    auto task = walk.discover({}, options);
    done.is = task.start(rig.world.executor(), done);
    ASSERT_TRUE(rig.world.run_until([&] { return done.is; }, seconds(60)));
    const auto report = task.take();
    ASSERT_TRUE(report);
    EXPECT_EQ(report->end, nodeid::DiscoveryReport::End::complete);
    ASSERT_EQ(report->found.size(), 6U) << resume;
    for (const auto& n : nodes) {
      EXPECT_EQ(std::ranges::count(report->found, n->device.lss().address(), &nodeid::Walked::address), 1);
      EXPECT_EQ(n->device.schemes().identification(), nodeid::Identification::identified);
    }
  }
}

// ---- claiming in the data field (S2.4) -----------------------------------------------------------------------------

constexpr auto wait = milliseconds(250);

TEST(Claiming, S2_4_OneDeviceClaimsAndBoots) {
  Line l({.claim = true});
  // NAME: bit 63, product 0708h: 08h << 40, 07h << 49; revision Ch: << 35; vendor 304h << 21; serial 0E0F10h.
  const std::uint64_t name =
      0x8000'0000'0000'0000 | 0x08ULL << 40 | 0x07ULL << 49 | 0x0CULL << 35 | 0x304ULL << 21 | 0x0E'0F10ULL;
  ASSERT_NE(l.node->device.schemes().claimer(), nullptr);
  EXPECT_EQ(l.node->device.schemes().claimer()->name(), name);
  const auto id = static_cast<unsigned>(1 + name % 127);
  l.rig.run(wait);
  EXPECT_EQ(l.node->device.node_id().value(), id);
  EXPECT_EQ(l.node->device.state(), NmtState::pre_operational);
  EXPECT_EQ(l.rig.record.text, std::vector<std::string>{"7" + Rig::hex8(id) + "#00"}) << "the boot-up message";
  // Asked, it answers with its claim; a higher NAME is answered too, a lower one takes the node-ID away.
  const auto own = l.ask("18EAFFFE#00EE00");
  EXPECT_TRUE(own.starts_with("18EEFF" + Rig::hex8(id) + "#")) << own;
  EXPECT_EQ(l.ask("18EEFF" + Rig::hex8(id) + "#FFFFFFFFFFFFFFFF"), own);
  EXPECT_EQ(l.node->device.node_id().value(), id);
  l.ask("18EEFF" + Rig::hex8(id) + "#0100000000000000");
  EXPECT_FALSE(l.node->device.node_id().configured());
  l.rig.run(wait + milliseconds(5));
  EXPECT_EQ(l.node->device.node_id().value(), id % 127 + 1) << "the next";
}

TEST(Claiming, AConfiguredDeviceNeverYields) {
  Line l({.node_id = NodeId(9), .claim = true});
  EXPECT_EQ(l.node->device.node_id(), NodeId(9));
  EXPECT_TRUE(l.ask("18EEFF09#0100000000000000").starts_with("18EEFF09#"));
  EXPECT_EQ(l.node->device.node_id(), NodeId(9));
}

/// What two devices of one product do to each other that get their power at one instant. Their serial numbers differ
/// by 127: they prefer one node-ID.
struct Pair {
  explicit Pair(const Options& how, rt::Duration apart = rt::Duration{0}) {
    for (const std::uint32_t serial : {1000U, 1127U}) {
      auto options = how;
      options.address = address_of(serial);
      options.negotiator.seed = serial;
      nodes.push_back(std::make_unique<Node>(rig.world, rig.bus, options));
    }
    rig.run(milliseconds(10));
    nodes[0]->on();
    rig.run(apart);
    nodes[1]->on();
  }
  Rig rig;
  std::vector<std::unique_ptr<Node>> nodes;
};

// S2.4: "it collides": equal identifiers, different data, bit errors until one controller is error-passive
// (docs/protocols/can-frames.md §Arbitration).
TEST(Claiming, S2_4_TwoClaimsAtOneMomentCollide) {
  Pair p({.claim = true});
  std::uint16_t worst = 0;
  bool passive = false;
  for (int i = 0; i < 400; ++i) {
    p.rig.run(microseconds(100));
    for (const auto& n : p.nodes) {
      worst = std::max(worst, n->controller->errors().tec());
      passive |= n->controller->errors().state() == sim::ErrorState::passive;
    }
  }
  EXPECT_GE(p.rig.bus.statistics().collisions, 16U) << "each repetition collides again";
  EXPECT_GE(p.rig.bus.statistics().error_frames, 16U);
  EXPECT_GE(worst, 128U);
  EXPECT_TRUE(passive);
  EXPECT_GT(p.rig.me->errors().rec(), 0U) << "and everybody else saw the errors";
  p.rig.run(seconds(1));
  EXPECT_NE(p.nodes[0]->device.node_id(), p.nodes[1]->device.node_id()) << "after the storm the lower NAME keeps it";
  for (const auto& n : p.nodes) EXPECT_TRUE(n->device.node_id().configured());
  EXPECT_EQ(p.nodes[0]->device.node_id().value(), p.nodes[0]->device.schemes().claimer()->name() % 127 + 1);
}

// S2.4, S2.19: the same two devices by paper 2's negotiation: no error at all.
TEST(Claiming, S2_4_NegotiationOfPaper2DoesNotCollide) {
  Pair p({.negotiation = NegotiationMode::on});
  p.rig.run(seconds(3));
  EXPECT_EQ(p.rig.bus.statistics().collisions, 0U);
  EXPECT_EQ(p.rig.bus.statistics().error_frames, 0U);
  for (const auto& n : p.nodes) {
    EXPECT_EQ(n->controller->errors().tec(), 0U);
    EXPECT_EQ(n->controller->errors().rec(), 0U);
    EXPECT_TRUE(n->device.node_id().configured());
  }
  EXPECT_NE(p.nodes[0]->device.node_id(), p.nodes[1]->device.node_id());
}

TEST(Claiming, S2_4_ClaimsOneAfterTheOtherDoNotCollide) {
  Pair p({.claim = true}, milliseconds(3));
  p.rig.run(seconds(2));
  EXPECT_EQ(p.rig.bus.statistics().collisions, 0U);
  EXPECT_NE(p.nodes[0]->device.node_id(), p.nodes[1]->device.node_id());
}

}  // namespace
}  // namespace berth::device::test::node_id_methods_tests

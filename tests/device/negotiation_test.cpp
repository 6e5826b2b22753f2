// Paper 2's rules on a whole device, one by one: what another node sends is typed by hand.
#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "rig.hpp"

namespace berth::device::test {
namespace {

constexpr LssAddress mine{0x00000319, 0xAA55EEFF, 0xDEADBEEF, 0x12345678};

Options negotiating(std::uint8_t prefers, NegotiationMode mode = NegotiationMode::on) {
  Options o;
  o.address = mine;
  o.rand = RandMode::off;
  o.negotiation = mode;
  o.negotiator.configured = NodeId(prefers);
  o.presets = {{{0x1017, 0}, 100}};
  return o;
}

Options fixed(std::uint8_t id, NegotiationMode mode = NegotiationMode::on) {
  auto o = negotiating(1, mode);
  o.source = NodeIdSource::fixed;
  o.node_id = NodeId(id);
  o.presets.clear();
  return o;
}

struct Frames : Rig {
  using Rig::Rig;
  [[nodiscard]] std::size_t identity() const {
    return static_cast<std::size_t>(
        std::ranges::count_if(record.text, [](const std::string& f) { return f.starts_with("00001"); }));
  }
  /// Runs until this frame is on the bus.
  bool until(std::string_view frame, rt::Duration limit = seconds(5)) {
    return world.run_until([&] { return record.count(frame) > 0; }, limit);
  }
};

// S2.11, S2.12: who has a node-ID answers and does not compete, whatever it hears.
TEST(NegotiationDevice, OneWithANodeIdAnswersAndIgnoresTheRest) {
  Frames rig;
  Node node(rig.world, rig.bus, fixed(0x31));
  node.on();
  rig.run(milliseconds(10));
  rig.record.clear();
  rig.ask("00000100#", milliseconds(100));
  EXPECT_EQ(rig.record.text, (std::vector<std::string>{"00000100#", "00000231#"}));
  rig.ask("00001F00#", milliseconds(100));
  rig.ask("00001000#", milliseconds(100));
  EXPECT_EQ(rig.record.text.size(), 4U);
}

// S2.5, S2.6, S2.10: no request: base frame, with data, with a data field, a reserved bit, a reserved code.
TEST(NegotiationDevice, FramesThatAreNotOurs) {
  Frames rig;
  Node node(rig.world, rig.bus, fixed(0x31));
  node.on();
  rig.run(milliseconds(10));
  rig.record.clear();
  const std::vector<std::string> sent{"100#", "00000100#00", "00000101#", "00002100#", "00000300#", "00000000#"};
  for (const auto& frame : sent) rig.ask(frame, milliseconds(100));
  EXPECT_EQ(rig.record.text, sent);
}

// S2.2: nothing but the negotiation before there is a node-ID.
TEST(NegotiationDevice, NoBootUpWithoutANodeId) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20));
  node.on();
  ASSERT_TRUE(rig.until("00001F12#"));
  rig.run(milliseconds(95));
  for (const auto& frame : rig.record.text) EXPECT_TRUE(frame.starts_with("0000")) << frame;
  EXPECT_EQ(node.device.state(), NmtState::initialising);
  ASSERT_TRUE(rig.until("00000220#"));
  rig.run(milliseconds(5));
  EXPECT_EQ(rig.record.text.back(), "720#00");
}

// S2.13, S2.14, S2.27: a lower byte of any number stops it, at any time; after 100 ms of silence it starts again.
TEST(NegotiationDevice, LowerByteStops) {
  for (const char* lower : {"00001018#", "00001454#", "00001F11#"}) {
    Frames rig;
    Node node(rig.world, rig.bus, negotiating(0x20));
    node.on();
    ASSERT_TRUE(rig.until("00001655#")) << "byte 6";
    const auto sent = rig.identity();
    rig.send(lower);
    rig.run(milliseconds(60));
    EXPECT_EQ(rig.identity(), sent + 1) << lower;
    rig.send("000018EF#");  // the other goes on: the wait begins anew
    rig.run(milliseconds(95));
    EXPECT_EQ(rig.record.count("00000100#"), 1U);
    rig.run(milliseconds(15));
    EXPECT_EQ(rig.record.count("00000100#"), 2U) << lower;
    EXPECT_TRUE(rig.until("00000220#")) << "the other is gone";
  }
}

// S2.13: higher and equal bytes do not.
TEST(NegotiationDevice, HigherByteDoesNot) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20));
  node.on();
  ASSERT_TRUE(rig.until("00001655#"));
  rig.send("0000101A#");
  rig.send("000017AB#");
  rig.send("00001F12#");
  rig.run(milliseconds(250));
  EXPECT_EQ(rig.record.count("00000220#"), 1U);
  EXPECT_EQ(rig.record.count("00000100#"), 1U);
}

// None that was heard; the next one that is free.
TEST(NegotiationDevice, TakesNoneThatWasHeard) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x7E));
  node.on();
  ASSERT_TRUE(rig.until("00000100#"));
  for (const char* taken : {"0000027E#", "0000027F#", "00000201#"}) rig.ask(taken);
  rig.run(milliseconds(400));
  EXPECT_EQ(node.device.node_id(), NodeId(2));
}

// S2.21: with nothing kept and nothing set it is derived from the identity: FNV-1a of the sixteen bytes in the order of
// sending, modulo 127, counted apart from Berth. And so it is the same each time, and of neighbours different.
TEST(NegotiationDevice, S2_21_DerivedFromTheIdentity) {
  const std::pair<LssAddress, unsigned> derived[] = {
      {mine, 127}, {{1, 1, 1, 1}, 50}, {{0x319, 2, 0x10000, 0x1000}, 25}, {{0x319, 2, 0x10000, 0x1001}, 110}};
  for (const auto& [address, id] : derived) {
    Frames rig;
    auto options = negotiating(1);
    options.address = address;
    options.negotiator.configured = NodeId();
    Node node(rig.world, rig.bus, options);
    node.on();
    rig.run(seconds(1));
    EXPECT_EQ(node.device.node_id().value(), id) << to_string(address);
  }
}

// S2.21: kept: it counts more than what is set and than what would be derived; heard is still not taken.
TEST(NegotiationDevice, S2_21_KeptUnlessHeard) {
  for (const bool set : {true, false}) {
    Frames rig;
    auto options = negotiating(0x20);
    if (!set) options.negotiator.configured = NodeId();
    Node node(rig.world, rig.bus, options, {}, milliseconds(20));
    node.on();
    ASSERT_TRUE(rig.until("00000100#"));
    for (unsigned id = 1; id <= 127; ++id) {
      if (id != 0x4D && id != 0x50) rig.ask("000002" + Rig::hex8(id) + "#", milliseconds(1));
    }
    rig.run(seconds(1));
    ASSERT_TRUE(node.device.node_id() == NodeId(0x4D) || node.device.node_id() == NodeId(0x50));
    const auto kept = node.device.node_id();
    const auto power_cycle = [&] {
      node.off();
      rig.run(milliseconds(50));
      rig.record.clear();
      node.on();
    };
    power_cycle();
    rig.run(seconds(1));
    EXPECT_EQ(node.device.node_id(), kept);
    power_cycle();
    ASSERT_TRUE(rig.until("00000100#"));
    rig.ask("000002" + Rig::hex8(kept.value()) + "#");
    rig.run(seconds(1));
    EXPECT_EQ(node.device.node_id().value(), kept.value() + 1U);
  }
}

/// Runs until this frame was on the bus so often.
bool world_has(Frames& rig, std::string_view frame, std::size_t times) {
  return rig.world.run_until([&] { return rig.record.count(frame) >= times; }, seconds(5));
}

/// When each frame of this beginning was on the bus.
std::vector<rt::Time> times(const Record& record, std::string_view start) {
  std::vector<rt::Time> found;
  for (std::size_t i = 0; i < record.text.size(); ++i) {
    if (record.text[i].starts_with(start)) found.push_back(record.times[i]);
  }
  return found;
}

// S2.22: ReqUsedNodeId heard by a device that negotiates is not answered, and its wait begins anew with it: the first
// byte comes 100 ms behind the last request, not behind its own.
TEST(NegotiationDevice, S2_22_AskedWhileItWaitsItWaitsAnew) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20));
  node.on();
  ASSERT_TRUE(rig.until("00000100#"));
  for (int i = 0; i < 5; ++i) {
    rig.run(milliseconds(80));
    rig.send("00000100#");
  }
  ASSERT_TRUE(rig.until("00001019#"));
  const auto asked = times(rig.record, "00000100#");
  ASSERT_EQ(asked.size(), 6U);
  const auto wait = *rig.record.first("00001019#") - asked.back();
  EXPECT_GE(wait, milliseconds(100));
  EXPECT_LE(wait, milliseconds(110));
  EXPECT_EQ(rig.record.count("00000220#"), 0U);
}

// S2.22: while it sends its bytes: no answer, and no second begin; in the end it has its node-ID all the same.
TEST(NegotiationDevice, S2_22_DoesNotAnswerWhileItCompetes) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20));
  node.on();
  ASSERT_TRUE(rig.until("00001200#"));
  rig.ask("00000100#", milliseconds(20));
  EXPECT_EQ(rig.record.count("00000220#"), 0U);
  ASSERT_TRUE(rig.until("00001F12#"));
  EXPECT_EQ(rig.record.count("00000220#"), 0U);
  EXPECT_EQ(rig.record.count("00001019#"), 1U);
  EXPECT_TRUE(rig.until("00000220#"));
}

// S2.23: it comes into a negotiation of others that lasts a second: not a frame of it before 100 ms of silence.
TEST(NegotiationDevice, S2_23_WhoJoinsLateListensFirst) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20));
  const auto say = [&](unsigned i) {
    // Bytes that are higher than its own: it would win if it competed.
    rig.ask("00001" + std::string(1, "0123456789ABCDEF"[i % 16]) + "FF#", milliseconds(i % 2 == 0 ? 20 : 90));
  };
  for (unsigned i = 0; i < 5; ++i) say(i);
  node.on();
  for (unsigned i = 0; i < 16; ++i) say(i);
  const auto others = rig.record.times.back();
  EXPECT_EQ(rig.record.text.size(), 21U) << rig.record.text.back();
  ASSERT_TRUE(rig.until("00000100#"));
  const auto silence = *rig.record.first("00000100#") - others;
  EXPECT_GE(silence, milliseconds(100));
  EXPECT_LE(silence, milliseconds(115));
  EXPECT_EQ(rig.record.text.size(), 22U);
}

// S2.29: all 127 are heard: no byte is sent, it stays in initialising and says so.
TEST(NegotiationDevice, AllTaken) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20));
  node.on();
  ASSERT_TRUE(rig.until("00000100#"));
  for (unsigned id = 1; id <= 127; ++id) rig.ask("000002" + Rig::hex8(id) + "#", milliseconds(1));
  rig.run(seconds(1));
  EXPECT_EQ(node.device.schemes().negotiator()->state(), research::Negotiating::exhausted);
  EXPECT_EQ(node.device.state(), NmtState::initialising);
  EXPECT_EQ(rig.identity(), 0U);
}

// S2.17, as published: who has the node-ID repeats the announcement, gives the node-ID up and resets; both begin again,
// and who loses then takes another that nobody announced. The other is played by hand: its identity is the lower one.
TEST(NegotiationDevice, S2_17_AsPublishedBothBeginAgain) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20, NegotiationMode::literal));
  node.on();
  rig.run(seconds(3));
  ASSERT_EQ(node.device.node_id(), NodeId(0x20));
  rig.record.clear();
  rig.ask("00000220#", milliseconds(20));
  EXPECT_EQ(std::erase(rig.record.text, "0A0#5081112003000000"), 1U) << "Berth's own: EMCY 8150h says why";
  EXPECT_EQ(rig.record.text, (std::vector<std::string>{"00000220#", "00000220#"})) << "the other's and its own";
  EXPECT_FALSE(node.device.node_id().configured());
  EXPECT_EQ(node.device.state(), NmtState::initialising);
  ASSERT_TRUE(rig.until("00000100#"));
  EXPECT_EQ(rig.record.text.size(), 3U) << "no boot-up, no heartbeat before it asks";
  ASSERT_TRUE(rig.until("00001019#"));
  rig.ask("00001018#", milliseconds(60));
  rig.ask("00000220#", milliseconds(80));  // the other has won, and announces the same node-ID
  ASSERT_TRUE(world_has(rig, "00000100#", 2));
  rig.ask("00000220#");  // asked, it answers
  ASSERT_TRUE(rig.until("00000221#"));
  rig.run(milliseconds(5));
  EXPECT_EQ(node.device.node_id(), NodeId(0x21));
  EXPECT_EQ(rig.record.text.back(), "721#00");
}

// S2.17, Berth's own rule: the one that is established repeats the announcement and goes on as if nothing had been.
TEST(NegotiationDevice, S2_17_TheEstablishedOneGoesOn) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20));
  node.on();
  rig.run(seconds(3));
  rig.ask("000#0120");
  rig.record.clear();
  rig.ask("00000220#", milliseconds(30));
  std::erase(rig.record.text, "720#05");
  EXPECT_EQ(rig.record.text, (std::vector<std::string>{"00000220#", "00000220#"}));
  rig.run(seconds(2));
  EXPECT_EQ(node.device.state(), NmtState::operational);
  EXPECT_EQ(rig.record.count("720#00"), 0U);
  EXPECT_GE(rig.record.count("720#05"), 19U) << "every 100 ms";
}

// The holder defends, and keeps its node-ID; both as published.
TEST(NegotiationDevice, HolderDefends) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20));
  node.on();
  rig.run(seconds(3));
  rig.record.clear();
  rig.ask("00000220#", milliseconds(50));
  EXPECT_EQ(rig.record.count("00000220#"), 2U);
  EXPECT_EQ(node.device.node_id(), NodeId(0x20));
  EXPECT_NE(node.device.state(), NmtState::initialising);
}
TEST(NegotiationDevice, BothLoseItAsPublished) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20, NegotiationMode::literal));
  node.on();
  rig.run(seconds(3));
  rig.record.clear();
  rig.ask("00000220#", milliseconds(50));
  EXPECT_EQ(rig.record.count("00000220#"), 2U) << "the same ActUsedNodeId";
  EXPECT_EQ(node.device.node_id(), NodeId());
  EXPECT_EQ(node.device.state(), NmtState::initialising);
  rig.run(seconds(1));
  EXPECT_EQ(node.device.node_id(), NodeId(0x20)) << "nobody else has it: again";
}

// The newcomer yields to who defends, says why, and takes another.
TEST(NegotiationDevice, NewcomerYields) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20));
  node.on();
  ASSERT_TRUE(rig.until("720#00"));
  rig.run(milliseconds(20));
  rig.record.clear();
  rig.ask("00000220#", milliseconds(10));
  EXPECT_EQ(rig.record.count("0A0#5081112001000000"), 1U) << "EMCY 8150h, register, node-ID, why";
  EXPECT_EQ(node.device.state(), NmtState::initialising);
  rig.run(seconds(1));
  EXPECT_EQ(node.device.node_id(), NodeId(0x21));
  EXPECT_EQ(node.device.schemes().negotiator()->lost(), research::IdLoss::defended);
}

// S2.24: somebody who does not negotiate sends heartbeats under its node-ID and never yields: in the end it does.
TEST(NegotiationDevice, YieldsToWhoeverDoesNotHear) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20));
  node.on();
  rig.run(seconds(3));
  for (unsigned i = 0; i < 20 && node.device.node_id() == NodeId(0x20); ++i) rig.ask("720#05", milliseconds(200));
  rig.run(seconds(1));
  EXPECT_TRUE(node.device.node_id().configured());
  EXPECT_NE(node.device.node_id(), NodeId(0x20));
  EXPECT_EQ(node.device.schemes().negotiator()->lost(), research::IdLoss::contested);
}

// Set by hand: it defends, and keeps what it has.
TEST(NegotiationDevice, FirmNodeIdIsNeverGivenUp) {
  for (const auto mode : {NegotiationMode::on, NegotiationMode::literal}) {
    Frames rig;
    Node node(rig.world, rig.bus, fixed(0x31, mode));
    node.on();
    rig.run(milliseconds(10));
    for (unsigned i = 0; i < 20; ++i) rig.ask("00000231#", milliseconds(100));
    EXPECT_EQ(node.device.node_id(), NodeId(0x31));
    EXPECT_GT(rig.record.count("00000231#"), 20U);
  }
}

// The last node-ID is kept in memory, and preferred.
TEST(NegotiationDevice, LastNodeIdIsPreferred) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20), {}, milliseconds(20));
  node.on();
  ASSERT_TRUE(rig.until("00000100#"));
  rig.ask("00000220#");  // taken now
  rig.run(seconds(1));
  ASSERT_EQ(node.device.node_id(), NodeId(0x21));
  node.off();
  rig.run(milliseconds(50));
  node.on();
  rig.run(seconds(1));
  EXPECT_EQ(node.device.node_id(), NodeId(0x21));
}

// An NMT reset communication keeps the node-ID (S2.12: it has one), reset node negotiates for it again.
TEST(NegotiationDevice, Resets) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20));
  node.on();
  rig.run(seconds(1));
  rig.record.clear();
  rig.ask("000#8220", milliseconds(50));
  EXPECT_EQ(rig.record.count("720#00"), 1U);
  EXPECT_EQ(rig.record.count("00000100#"), 0U);
  rig.ask("000#8120", seconds(1));
  EXPECT_EQ(rig.record.count("00000100#"), 1U);
  EXPECT_EQ(node.device.node_id(), NodeId(0x20));
}

// S2.26: two frame times at least, at a slow bus; twice that while the bus is loaded.
TEST(NegotiationDevice, Pace) {
  for (const auto& [bit_rate, least] : {std::pair(10'000U, 14.0), std::pair(125'000U, 5.0)}) {
    for (const bool loaded : {false, true}) {
      Frames rig(bit_rate);
      Node node(rig.world, rig.bus, negotiating(0x20));
      node.on();
      std::vector<rt::Time> starts;
      for (unsigned i = 0; i < 2000 && starts.size() < 14; ++i) {
        if (loaded && rig.me->status().queued == 0) rig.send("7FF#5555555555555555");
        rig.run(rt::Duration(120'000'000'000 / bit_rate));
        starts.clear();
        for (std::size_t k = 0; k < rig.record.text.size(); ++k) {
          if (rig.record.text[k].starts_with("00001")) starts.push_back(rig.record.times[k]);
        }
      }
      ASSERT_GE(starts.size(), 14U);
      for (std::size_t k = 1; k < starts.size(); ++k) {
        const double gap = std::chrono::duration<double, std::milli>(starts[k] - starts[k - 1]).count();
        EXPECT_GE(gap, 0.98 * least) << bit_rate;
        EXPECT_GE(gap, loaded && k > 2 ? 0.9 * 2 * least : 0.0) << "the pace halves at " << bit_rate;
        EXPECT_LE(gap, loaded ? 1000 : 1.5 * least) << bit_rate;
      }
    }
  }
}

// SX.6: while a master talks LSS to it the negotiation stands still, and begins anew afterwards.
TEST(NegotiationDevice, LssStopsTheNegotiation) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20));
  node.on();
  ASSERT_TRUE(rig.until("00001200#"));
  rig.select(mine);
  rig.run(milliseconds(10));
  EXPECT_EQ(node.device.lss().state(), lss::State::configuration);
  const auto sent = rig.identity();
  rig.run(milliseconds(1500));
  EXPECT_EQ(rig.identity(), sent);
  rig.ask("7E5#0400000000000000");
  rig.run(seconds(3));
  EXPECT_EQ(node.device.node_id(), NodeId(0x20));
}

// SX.6: the same while a master asks by RAND, which it answers: not one frame of the negotiation between, and it begins
// anew when the master has long been silent.
TEST(NegotiationDevice, SX_6_RandStopsTheNegotiation) {
  Frames rig;
  auto options = negotiating(0x20);
  options.rand = RandMode::on;
  Node node(rig.world, rig.bus, options);
  node.on();
  ASSERT_TRUE(rig.until("00001200#"));
  rig.ask("1F940000#80000000");
  rig.record.clear();
  for (int i = 0; i < 20; ++i) rig.ask("1F940000#80000000", milliseconds(90));
  EXPECT_EQ(rig.record.count("1F500000#"), 20U) << "its chunk(0) is 0000";
  EXPECT_EQ(rig.record.text.size(), 40U) << "and nothing else";
  rig.record.clear();
  rig.run(seconds(3));
  EXPECT_EQ(rig.record.count("00000100#"), 1U) << "anew, not where it was";
  EXPECT_EQ(rig.identity(), 16U);
  EXPECT_EQ(node.device.node_id(), NodeId(0x20));
}

// SX.6: one source after the other: a node-ID of switches or plug, then one of LSS in memory, and only who has neither
// negotiates; who claims or negotiates with a node-ID of its own sends nothing of it.
TEST(NegotiationDevice, SX_6_TheOrderOfTheSources) {
  struct Is {
    NodeIdSource source;
    NodeId set;
    unsigned expected;
    bool negotiates;
  };
  for (const Is& is :
       {Is{NodeIdSource::fixed, NodeId(0x31), 0x31, false}, Is{NodeIdSource::nonvolatile, NodeId(0x31), 0x31, false},
        Is{NodeIdSource::nonvolatile, NodeId(), 0x20, true}}) {
    Frames rig;
    auto options = negotiating(0x20);
    options.source = is.source;
    options.node_id = is.set;
    Node node(rig.world, rig.bus, options);
    node.on();
    rig.run(seconds(2));
    EXPECT_EQ(node.device.node_id().value(), is.expected);
    EXPECT_EQ(rig.identity(), is.negotiates ? 16U : 0U);
    EXPECT_EQ(rig.record.count("00000100#"), is.negotiates ? 1U : 0U);
    // LSS may change what is in memory, never switches: 1, out of range.
    rig.record.clear();
    rig.give_id(mine, 0x44);
    EXPECT_EQ(rig.record.count(is.source == NodeIdSource::fixed ? "7E4#1101000000000000" : "7E4#1100000000000000"), 1U);
  }
}

// LSS gave it a node-ID meanwhile: that is its own, and it answers for it.
TEST(NegotiationDevice, LssGivesTheNodeId) {
  Frames rig;
  Node node(rig.world, rig.bus, negotiating(0x20));
  node.on();
  rig.run(milliseconds(50));
  rig.give_id(mine, 0x55);
  rig.ask("7E5#0400000000000000", milliseconds(50));
  EXPECT_EQ(node.device.node_id(), NodeId(0x55));
  rig.record.clear();
  rig.ask("00000100#", milliseconds(100));
  EXPECT_EQ(rig.record.count("00000255#"), 1U);
}

// Two devices alone that begin in one instant: equal frames merge and nobody is left to acknowledge them.
TEST(NegotiationDevice, TwoAloneInOneInstant) {
  for (const auto mode : {NegotiationMode::on, NegotiationMode::literal}) {
    sim::World world(3);
    auto& bus = world.add_bus("bus", 125'000);
    auto a = negotiating(0x20, mode);
    auto b = negotiating(0x21, mode);
    a.negotiator.seed = 1;
    b.negotiator.seed = 2;
    b.address.serial = 0x9ABCDEF0;
    Node one(world, bus, a);
    Node two(world, bus, b);
    one.on();
    two.on();
    world.run_for(seconds(4));
    EXPECT_EQ(one.device.node_id(), NodeId(0x20));
    EXPECT_EQ(two.device.node_id(), NodeId(0x21));
  }
}

}  // namespace
}  // namespace berth::device::test

// Emergencies and heartbeats across buses (paper 3 Figures 3 to 10), against frames written by hand from the figures
// (docs/multilevel.md §EMCY).
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/decode/emcy_words.hpp"
#include "berth/multilevel/emcy_gateway.hpp"
#include "berth/multilevel/event_log.hpp"
#include "tree.hpp"

using namespace berth;
using namespace berth::multilevel;
using namespace berth::multilevel::test;

namespace {

std::vector<NodeId> nodes_of(std::initializer_list<unsigned> ids) {
  std::vector<NodeId> path;
  for (const unsigned id : ids) path.push_back(NodeId(static_cast<std::uint8_t>(id)));
  return path;
}

Log emergencies(const Line& line) {
  Log found;
  for (const auto& frame : line.log) {
    if (frame.starts_with("08") || frame.starts_with("09") || frame.starts_with("0A") || frame.starts_with("0B") ||
        frame.starts_with("0C") || frame.starts_with("0D") || frame.starts_with("0E") || frame.starts_with("0F")) {
      if (!frame.starts_with("080#")) found.push_back(frame);
    }
  }
  return found;
}

// Three gateways, 3, 4 and 5, each on the bus beneath the one before; a device 50 on the lowest; a log on the backbone.
struct Levels : ::testing::Test {
  explicit Levels(EmcyLayout how = EmcyLayout::source_and_exit) : layout(how) {
    for (int i = 0; i < 4; ++i) lines.push_back(std::make_unique<Line>(world, "bus" + std::to_string(i)));
    for (unsigned i = 0; i < 3; ++i) {
      gateways.push_back(std::make_unique<Gateway>(world, *lines[i], 3 + i, *lines[i + 1], 1));
      EmcyGatewayOptions options{.layout = layout};
      options.speaks_layout.set(4 + i);  // the gateway one deeper
      emcy.push_back(std::make_unique<EmcyGateway>(gateways[i]->upper.errors().emcy(), options));
      emcy.back()->hear_all(gateways[i]->down.dispatcher);
    }
    leaf.emplace(world, *lines[3], 50);
    master.emplace(world, *lines[0]);
    log.emplace(master->dispatcher, layout);
    log->hear_all();
    world.run_for(100ms);
    for (auto& line : lines) line->clear();
  }
  ~Levels() override {
    log.reset();
    emcy.clear();
  }
  void run(rt::Duration time = 50ms) { world.run_for(time); }
  sim::World world;
  EmcyLayout layout;
  std::vector<std::unique_ptr<Line>> lines;
  std::vector<std::unique_ptr<Gateway>> gateways;
  std::vector<std::unique_ptr<EmcyGateway>> emcy;
  std::optional<Leaf> leaf;
  std::optional<Station> master;
  std::optional<EventLog> log;
};

struct Figure7 : Levels {
  Figure7() : Levels(EmcyLayout::source) {}
};
struct Figure9 : Levels {
  Figure9() : Levels(EmcyLayout::complete) {}
};

}  // namespace

// S3.16: "maximum 6 hierarchical bus levels and 4195872914689 nodes", "4 hierarchy levels and 260144641", "2 and
// 16129".
TEST(EmcyLayouts, HowManyNodes) {
  EXPECT_EQ(levels(EmcyLayout::source), 6U);
  EXPECT_EQ(nodes(EmcyLayout::source), 4195872914689U);
  EXPECT_EQ(levels(EmcyLayout::source_and_exit), 4U);
  EXPECT_EQ(nodes(EmcyLayout::source_and_exit), 260144641U);
  EXPECT_EQ(levels(EmcyLayout::complete), 2U);
  EXPECT_EQ(nodes(EmcyLayout::complete), 16129U);
}

// S3.13, S3.15, S3.16, S3.17: Figure 5 on the lowest bus, and Figures 6 and 8 on each bus above it.
TEST_F(Levels, TheNodeIdsOnTheWay) {
  leaf->device.errors().raise(0x2310, co::error_register::current);
  run();
  EXPECT_EQ(emergencies(*lines[3]), Log{"0B2#1023030000000000"});
  EXPECT_EQ(emergencies(*lines[2]), Log{"085#1023033200000000"});
  EXPECT_EQ(emergencies(*lines[1]), Log{"084#1023030532000000"});
  EXPECT_EQ(emergencies(*lines[0]), Log{"083#1023030405320000"});
  ASSERT_EQ(log->entries().size(), 1U);
  EXPECT_EQ(log->entries()[0].reading.path, nodes_of({3, 4, 5, 50}));
  EXPECT_EQ(log->pending(nodes_of({3, 4, 5, 50})), std::vector<std::uint16_t>{0x2310});
}

// S3.14: the error exits; what the plain device tells as "no error" is told by name above, as it was its only one.
TEST_F(Levels, TheExitingCode) {
  leaf->device.errors().raise(0x2310, co::error_register::current);
  run();
  leaf->device.errors().clear(0x2310);
  run();
  EXPECT_EQ(emergencies(*lines[3]).back(), "0B2#0000000000000000");
  EXPECT_EQ(emergencies(*lines[0]).back(), "083#0000000405321023");
  EXPECT_EQ(log->entries().back().reading.exiting, 0x2310);
  EXPECT_TRUE(log->pending(nodes_of({3, 4, 5, 50})).empty());
  // Of several that go at once, none is named.
  leaf->device.errors().raise(0x2310, co::error_register::current);
  leaf->device.errors().raise(0x3210, co::error_register::voltage);
  run();
  leaf->device.errors().emcy().reset();
  leaf->send("0B2#0000000000000000");
  run();
  EXPECT_EQ(emergencies(*lines[0]).back(), "083#0000000405320000");
}

// S3.14: a device made for such a machine tells itself which of several errors is gone (Figure 8).
TEST_F(Levels, OneOfSeveralExits) {
  Leaf aware(world, *lines[1], 60);
  aware.device.errors().emcy().tell_exits(true);
  EmcyGatewayOptions options{.layout = layout};
  options.speaks_layout.set(4).set(60);
  emcy[0].reset();
  emcy[0] = std::make_unique<EmcyGateway>(gateways[0]->upper.errors().emcy(), options);
  emcy[0]->hear_all(gateways[0]->down.dispatcher);
  run();
  lines[0]->clear();
  aware.device.errors().raise(0x2310, co::error_register::current);
  aware.device.errors().raise(0x3210, co::error_register::voltage);
  aware.device.errors().clear(0x2310);
  aware.device.errors().clear(0x3210);
  run();
  EXPECT_EQ(emergencies(*lines[0]),
            (Log{"083#1023033C00000000", "083#1032073C00000000", "083#1032053C00001023", "083#0000003C00001032"}));
  EXPECT_TRUE(log->pending(nodes_of({3, 60})).empty());
}

// S3.16: Figure 7 has five sub-nets and no exiting code.
TEST_F(Figure7, FiveSubNets) {
  leaf->device.errors().raise(0x2310, co::error_register::current);
  run();
  leaf->device.errors().clear(0x2310);
  run();
  EXPECT_EQ(emergencies(*lines[0]), (Log{"083#1023030405320000", "083#0000000405320000"}));
  EXPECT_TRUE(log->pending(nodes_of({3, 4, 5, 50})).empty());
}

// S3.16, S3.17: Figure 9 has one sub-net, port and signal: what comes from deeper loses its deepest node-ID, and the
// gateway says so, once.
TEST_F(Figure9, OneSubNetAndWhatIsDeeper) {
  std::vector<EmcyTrouble> troubles;
  for (auto& each : emcy) each->on_trouble([&](const EmcyTrouble& trouble) { troubles.push_back(trouble); });
  leaf->device.errors().raise(0x2310, co::error_register::current);
  run();
  EXPECT_EQ(emergencies(*lines[2]), Log{"085#1023033200000000"});
  EXPECT_EQ(emergencies(*lines[1]), (Log{"084#04FF810500000000", "084#1023030500000000"}));
  EXPECT_EQ(emergencies(*lines[0]).back(), "083#1023030400000000");
  leaf->device.errors().clear(0x2310);
  run();
  ASSERT_EQ(troubles.size(), 2U);
  EXPECT_EQ(troubles[0].kind, EmcyTrouble::Kind::too_deep);
  EXPECT_EQ(troubles[0].node, NodeId(5));
  EXPECT_EQ(emcy[0]->too_deep(), 3U);  // the other gateway's own word is from too deep, too
  // A device that tells port and signal, on the bus beneath gateway 3.
  Station aware(world, *lines[1]);
  EmcyGatewayOptions options{.layout = layout};
  options.speaks_layout.set(60);
  emcy[0].reset();
  emcy[0] = std::make_unique<EmcyGateway>(gateways[0]->upper.errors().emcy(), options);
  emcy[0]->hear_all(gateways[0]->down.dispatcher);
  aware.send("0BC#1023030007091032");
  run();
  EXPECT_EQ(emergencies(*lines[0]).back(), "083#1023033C07091032");
  const auto& reading = log->entries().back().reading;
  EXPECT_EQ(reading.path, nodes_of({3, 60}));
  EXPECT_EQ(reading.port, 7);
  EXPECT_EQ(reading.signal, 9);
  EXPECT_EQ(reading.exiting, 0x3210);
}

// S3.18: a device that uses bytes 3 to 7 itself: they are left out, or the message goes as CiA 302-7 routes it; a log
// on the gateway has them all. S3.38: F000h, network-ID, node-ID, code, and the router's own error register.
TEST_F(Levels, ManufacturerData) {
  leaf->device.errors().raise(0x2310, co::error_register::current, {0xDE, 0xAD, 0xBE, 0xEF, 0x55});
  run();
  EXPECT_EQ(emergencies(*lines[2]).back(), "085#1023033200000000");
  EmcyGatewayOptions options{.layout = layout, .network = 0x0102};
  options.routed.set(50);
  emcy[2].reset();
  emcy[2] = std::make_unique<EmcyGateway>(gateways[2]->upper.errors().emcy(), options);
  std::vector<co::Emcy> whole;
  emcy[2]->on_heard([&](NodeId, const co::Emcy& message) { whole.push_back(message); });
  emcy[2]->hear_all(gateways[2]->down.dispatcher);
  leaf->send("0B2#102303DEADBEEF55");
  run();
  EXPECT_EQ(emergencies(*lines[2]).back(), "085#00F0000201321023");
  ASSERT_EQ(whole.size(), 1U);
  EXPECT_EQ(whole[0].info, (std::array<std::uint8_t, 5>{0xDE, 0xAD, 0xBE, 0xEF, 0x55}));
  const co::Emcy routed_once{.code = 0xF000, .error_register = 0, .info = {2, 1, 0x32, 0x10, 0x23}};
  EXPECT_EQ(read_routed(routed_once), (RoutedOrigin{0x0102, 50, 0x2310}));
  EXPECT_EQ(routed(routed_once, NodeId(5), 7, 0x11).info, routed_once.info);  // the origin stays
  EXPECT_FALSE(read_routed({.code = 0x2310}));
}

// S3.19: what the gateway tells of itself has no sub-net.
TEST_F(Levels, ItsOwn) {
  gateways[1]->upper.errors().raise(0x1000, 0);
  run();
  EXPECT_EQ(emergencies(*lines[1]), Log{"084#0010010000000000"});
  EXPECT_EQ(emergencies(*lines[0]), Log{"083#0010010400000000"});
  EXPECT_EQ(log->entries().back().reading.path, nodes_of({3, 4}));
}

// S3.15: "Otherwise a special conversion table between cob-ids and node-ids is needed."
TEST_F(Levels, AnotherCobId) {
  emcy[2]->hear(gateways[2]->down.dispatcher, NodeId(77), co::CobId(0x1F5));
  leaf->send("1F5#1023030000000000");
  run();
  EXPECT_EQ(emergencies(*lines[0]).back(), "083#10230304054D0000");
}

// S3.21: a storm beneath: every node at once, several times. The inhibit time of the gateway holds, nothing is lost or
// doubled, and the messages of each node keep their order.
TEST_F(Levels, AStormBeneath) {
  constexpr rt::Duration inhibit = 1ms;
  gateways[0]->upper.values().set<std::uint16_t>({0x1015, 0}, 10);
  gateways[0]->upper.errors().emcy().set_inhibit(inhibit);
  Station storm(world, *lines[1]);
  for (unsigned round = 1; round <= 3; ++round) {
    for (unsigned node = 6; node <= 127; ++node) {
      can::Frame frame = can::Frame::base(0x80 + node, {0, 0x10, 1, 0, 0, 0, 0, 0});
      frame.data[0] = static_cast<std::uint8_t>(round);  // codes 1001h to 1003h
      while (storm.controller->send(frame, 0) == can::Queued::full) run(1ms);
    }
    run(1ms);
  }
  run(1s);
  EXPECT_EQ(log->count(), 3U * 122);
  EXPECT_EQ(emcy[0]->lost(), 0U);
  EXPECT_EQ(emcy[0]->forwarded(), 3U * 122);
  std::map<std::vector<NodeId>, std::vector<unsigned>> by_path;
  for (const auto& entry : log->entries()) by_path[entry.reading.path].push_back(entry.reading.code);
  EXPECT_EQ(by_path.size(), 122U);
  for (const auto& [path, codes] : by_path) EXPECT_EQ(codes, (std::vector<unsigned>{0x1001, 0x1002, 0x1003}));
  rt::Time before = lines[0]->times.front() - 1s;
  for (std::size_t i = 0; i < lines[0]->log.size(); ++i) {
    if (!lines[0]->log[i].starts_with("083#")) continue;
    // From the begin of one frame to the begin of the next: their lengths differ by a few stuff bits.
    EXPECT_GE(lines[0]->times[i] - before, inhibit - 60us);
    before = lines[0]->times[i];
  }
}

// S3.21: one node that sends without end loses its own oldest messages, and no other's.
TEST_F(Levels, ANodeThatBabbles) {
  std::vector<EmcyTrouble> troubles;
  emcy[0]->on_trouble([&](const EmcyTrouble& trouble) { troubles.push_back(trouble); });
  gateways[0]->upper.errors().emcy().set_inhibit(100ms);
  Station storm(world, *lines[1]);
  storm.send("086#0110010000000000");
  for (unsigned i = 0; i < 100; ++i) {
    can::Frame frame = can::Frame::base(0x87, {0, 0x20, 1, 0, 0, 0, 0, 0});
    frame.data[0] = static_cast<std::uint8_t>(i);
    while (storm.controller->send(frame, 0) == can::Queued::full) run(1ms);
  }
  storm.send("086#0210010000000000");
  run(10s);
  std::vector<unsigned> of_6, of_7;
  for (const auto& entry : log->entries()) {
    (entry.reading.path == nodes_of({3, 6}) ? of_6 : of_7).push_back(entry.reading.code);
  }
  EXPECT_EQ(of_6, (std::vector<unsigned>{0x1001, 0x1002}));
  EXPECT_EQ(std::erase(of_7, 0xFF03U), 1U);
  ASSERT_GE(of_7.size(), 15U);
  EXPECT_EQ(of_7.back(), 0x2063U);
  EXPECT_TRUE(std::ranges::is_sorted(of_7));
  EXPECT_EQ(emcy[0]->lost() + of_7.size(), 100U);
  ASSERT_EQ(troubles.size(), 1U);
  EXPECT_EQ(troubles[0].node, NodeId(7));
}

// In stopped there is no EMCY: what comes from beneath waits for another state.
TEST_F(Levels, AStoppedGateway) {
  master->send("000#0203");
  run();
  leaf->device.errors().raise(0x2310, co::error_register::current);
  run(1s);
  EXPECT_TRUE(emergencies(*lines[0]).empty());
  master->send("000#8003");
  run();
  EXPECT_EQ(emergencies(*lines[0]), Log{"083#1023030405320000"});
}

// A gateway restarts: what it knew of the nodes beneath it has passed on, or waits still.
TEST_F(Levels, ARestartKeepsWhatWaits) {
  gateways[0]->upper.errors().emcy().set_inhibit(200ms);
  leaf->device.errors().raise(0x2310, co::error_register::current);
  leaf->device.errors().raise(0x3210, co::error_register::voltage);
  run();
  master->send("000#8203");
  run(1s);
  EXPECT_EQ(log->count(), 2U);
}

// S3.11, S3.12: Figures 3 and 4. Heartbeats stay on their bus; the loss of one is an emergency above, its return the
// exit.
TEST_F(Levels, HeartbeatsBecomeEmergencies) {
  struct Ears final : co::HeartbeatConsumer::Observer {
    explicit Ears(EmcyGateway& to) : gateway(&to) {}
    void heartbeat(const co::HeartbeatEvent& event, rt::Time) noexcept override { gateway->heartbeat(event); }
    EmcyGateway* gateway;
  } ears(*emcy[2]);
  co::HeartbeatConsumer consumer(gateways[2]->down.dispatcher, ears);
  consumer.supervise(NodeId(50), 300ms);
  Station peer(world, *lines[3]);
  peer.send("632#2B17100064000000");  // 1017h of node 50: 100 ms
  run(1s);
  EXPECT_GE(std::ranges::count(lines[3]->log, "732#7F"), 8);
  for (int level = 0; level < 3; ++level) {
    EXPECT_TRUE(std::ranges::none_of(lines[level]->log, [](const auto& frame) { return frame.starts_with("7"); }));
  }
  leaf->device.power_off();
  run(1s);
  EXPECT_EQ(emergencies(*lines[2]), Log{"085#3081113200000000"});
  EXPECT_EQ(emergencies(*lines[0]), Log{"083#3081110405320000"});
  leaf->device.power_on();
  run();
  peer.send("632#2B17100064000000");
  run(1s);
  EXPECT_EQ(emergencies(*lines[0]), (Log{"083#3081110405320000", "083#0000000405323081"}));
  EXPECT_TRUE(log->pending(nodes_of({3, 4, 5, 50})).empty());
}

// S3.20, Figure 10: one code, two meanings: the producer's path leads to its profile, and that to the words.
TEST_F(Levels, WordsByPathAndProfile) {
  log->set_profile(nodes_of({3, 4, 5, 50}), 402);
  log->set_profile(nodes_of({3, 4}), 401);
  leaf->send("0B2#1032050000000000");
  run();
  gateways[1]->upper.errors().raise(0x3210, co::error_register::voltage);
  run();
  ASSERT_EQ(log->entries().size(), 2U);
  EXPECT_EQ(text(log->entries()[0], decode::emcy_words),
            std::string("3/4/5/50: 3210h ") + decode::emcy_words(0x3210, 402));
  EXPECT_EQ(text(log->entries()[1], decode::emcy_words), "3/4: 3210h internal voltage too high");
  EXPECT_STRNE(decode::emcy_words(0x3210, 402), decode::emcy_words(0x3210, 401));
  gateways[1]->upper.errors().emcy().tell_exits(true);
  gateways[1]->upper.errors().clear(0x3210);
  run();
  EXPECT_EQ(text(log->entries()[2], decode::emcy_words), "3/4: error 3210h gone: internal voltage too high");
}

TEST(EventLogText, OfEveryField) {
  LoggedEmcy entry{.reading = read_emcy(EmcyLayout::complete, NodeId(3),
                                        {.code = 0x2310, .error_register = 3, .info = {5, 7, 9, 0x10, 0x32}})};
  EXPECT_EQ(
      text(entry, decode::emcy_words),
      "3/5: error 3210h gone: internal voltage too high; pending: 2310h output current too high (overload), port 7, "
      "signal 9");
  entry.reading = read_emcy(EmcyLayout::source, NodeId(3), {.code = 0xFF01, .info = {5}});
  EXPECT_EQ(text(entry, decode::emcy_words), "3/5: FF01h a mandatory bus beneath has not booted");
  for (const auto code : {gateway_code::optional_bus_failed, gateway_code::emcy_lost, gateway_code::too_deep,
                          gateway_code::signal_late}) {
    EXPECT_NE(gateway_code_text(code), nullptr);
  }
  entry.reading = read_emcy(EmcyLayout::source, NodeId(3), {.code = 0x1000, .info = {5, 0, 6}});
  EXPECT_TRUE(entry.reading.garbled);
  EXPECT_EQ(text(entry, decode::emcy_words), "3/5: 1000h generic error (its sub-net bytes are none)");
  entry.reading = read_emcy(EmcyLayout::source, NodeId(3), {.code = 0x1000, .info = {200}});
  EXPECT_TRUE(entry.reading.garbled);
}

// The log keeps its newest entries; what is pending it knows all the same.
TEST_F(Levels, TheLogHasABound) {
  log.reset();
  log.emplace(master->dispatcher, layout, 3);
  log->hear_all();
  unsigned told = 0;
  log->on_event([&](const LoggedEmcy&) { ++told; });
  for (unsigned i = 0; i < 5; ++i) {
    leaf->device.errors().raise(static_cast<std::uint16_t>(0x1001 + i), 0);
    run();
  }
  EXPECT_EQ(log->entries().size(), 3U);
  EXPECT_EQ(log->count(), 5U);
  EXPECT_EQ(told, 5U);
  EXPECT_EQ(log->pending(nodes_of({3, 4, 5, 50})).size(), 5U);
}

// What the gateways on the way write, the log reads, whatever the path and the layout; deeper ones lose their end.
RC_GTEST_PROP(EmcyLayoutLaws, WhatIsWrittenOnTheWayIsRead, ()) {
  const auto layout = *rc::gen::element(EmcyLayout::source, EmcyLayout::source_and_exit, EmcyLayout::complete);
  const auto depth = *rc::gen::inRange(0, 8);
  std::vector<NodeId> path;
  for (int i = 0; i <= depth; ++i) path.push_back(NodeId(static_cast<std::uint8_t>(*rc::gen::inRange(1, 128))));
  const EmcyDetails details{.exiting = *rc::gen::arbitrary<std::uint16_t>(),
                            .port = *rc::gen::arbitrary<std::uint8_t>(),
                            .signal = *rc::gen::arbitrary<std::uint8_t>()};
  co::Emcy message{.code = *rc::gen::arbitrary<std::uint16_t>(), .info = emcy_info(layout, details)};
  bool fits = true;
  for (auto at = path.size(); at-- > 1;) fits = insert_sub_net(layout, message, path[at]) && fits;
  const auto reading = read_emcy(layout, path.front(), message);
  RC_ASSERT(fits == (path.size() <= levels(layout)));
  path.resize(std::min(path.size(), levels(layout)));
  RC_ASSERT(reading.path == path);
  RC_ASSERT(!reading.garbled);
  RC_ASSERT(reading.code == message.code);
  RC_ASSERT(reading.exiting == (has_exit(layout) ? details.exiting : 0));
  RC_ASSERT(reading.port == (layout == EmcyLayout::complete ? details.port : 0));
  RC_ASSERT(reading.signal == (layout == EmcyLayout::complete ? details.signal : 0));
}

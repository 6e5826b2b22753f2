// Signals across a gateway (paper 3 Figure 14; docs/multilevel.md §Signals): from PDOs on one bus into PDOs on another.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "berth/multilevel/signal_gateway.hpp"
#include "tree.hpp"

using namespace berth;
using namespace berth::multilevel;
using namespace berth::multilevel::test;

namespace {

// Above: RPDO 1 (203h) brings 2100h:01 and :02, TPDO 1 (183h) carries 2102h. Beneath: TPDO 1 (181h) carries 2200h:01,
// TPDO 2 (281h) 2200h:02, RPDO 1 (201h) brings 2202h.
std::shared_ptr<const od::Description> upper_description() {
  od::DescriptionBuilder b;
  device::add_device(b, {.name = "Upper"});
  b.object(0x2100, od::ObjectCode::array, "Commands");
  for (const std::uint8_t sub : {std::uint8_t{1}, std::uint8_t{2}}) {
    b.sub(
        0x2100,
        {.sub = sub, .name = "Command", .type = od::DataType::unsigned16, .access = od::Access::rww, .mappable = true});
  }
  b.variable(0x2102, {.name = "Answer", .type = od::DataType::unsigned16, .mappable = true});
  device::add_rpdo(b, 1, {.map = {{{0x2100, 1}, 16}, {{0x2100, 2}, 16}}});
  device::add_tpdo(b, 1, {.map = {{{0x2102, 0}, 16}}});
  return b.build();
}

std::shared_ptr<const od::Description> lower_description(std::uint8_t type, std::uint16_t event_timer_ms,
                                                         std::uint16_t inhibit_100us) {
  od::DescriptionBuilder b;
  device::add_device(b, {.name = "Lower"});
  device::add_sync(b);
  b.object(0x2200, od::ObjectCode::array, "Commands");
  for (const std::uint8_t sub : {std::uint8_t{1}, std::uint8_t{2}}) {
    b.sub(0x2200, {.sub = sub, .name = "Command", .type = od::DataType::unsigned16, .mappable = true});
  }
  b.variable(0x2202, {.name = "Answer", .type = od::DataType::unsigned16, .access = od::Access::rww, .mappable = true});
  b.variable(0x2203, {.name = "Wide", .type = od::DataType::unsigned32, .mappable = true});
  b.variable(0x2204, {.name = "Text", .type = od::DataType::visible_string, .capacity = 8});
  b.object(0x1381, od::ObjectCode::array, "SRDO mapping", od::DataType::unsigned32);
  b.sub(0x1381, {.sub = 1, .name = "SRDO mapping", .initial = od::Literal::number(0x2205'0010)});
  b.variable(0x2205, {.name = "Emergency stop", .type = od::DataType::unsigned16, .mappable = true});
  device::add_tpdo(
      b, 1,
      {.map = {{{0x2200, 1}, 16}}, .type = type, .inhibit_100us = inhibit_100us, .event_timer_ms = event_timer_ms});
  device::add_tpdo(b, 2, {.map = {{{0x2200, 2}, 16}}, .type = type});
  device::add_rpdo(b, 1, {.map = {{{0x2202, 0}, 16}}});
  return b.build();
}

struct Options {
  std::uint8_t type = 0xFF;
  std::uint16_t event_timer_ms = 0;
  std::uint16_t inhibit_100us = 0;
};

struct Signals : ::testing::Test {
  void build(std::vector<Signal> table, const Options& options = {}) {
    up.emplace(world, above);
    controller = beneath.bus.attach({.queue_depth = 64, .rx_depth = 64});
    port.emplace(world.executor(), *controller);
    down.emplace(world.executor(), *port);
    upper.emplace(up->dispatcher, upper_description(), nullptr,
                  device::Options{.address = {1, 1, 1, 3}, .node_id = NodeId(3), .send_tpdos_at_start = false});
    lower.emplace(*down, lower_description(options.type, options.event_timer_ms, options.inhibit_100us), nullptr,
                  device::Options{.address = {1, 1, 2, 3}, .node_id = NodeId(1), .send_tpdos_at_start = false});
    std::vector<SignalSide> sides(2);
    sides[0].values = &upper->values();
    sides[0].changed = [this](ObjectRef ref) { upper->services().changed(ref); };
    sides[1].values = &lower->values();
    sides[1].changed = [this](ObjectRef ref) { lower->services().changed(ref); };
    sides[1].port = &*port;
    sides[1].silence = [this](ObjectRef, bool on) {
      const auto id = lower->values().get_or<std::uint32_t>({0x1800, 1}, 0U);
      lower->values().set<std::uint32_t>({0x1800, 1}, on ? id | 0x8000'0000U : id & 0x7FFF'FFFFU);
      lower->services().pdos()->refresh();
    };
    gateway.emplace(world.executor(), sides, std::move(table));
    for (std::size_t i = 0; i < gateway->table().size(); ++i) {
      const auto& signal = gateway->table()[i];
      (signal.from == 0 ? *upper : *lower).on_write(signal.source, [this, i] { gateway->received(i); });
    }
    upper->power_on();
    lower->power_on();
    world.run_for(50ms);
    master.send("000#0100");
    worker.send("000#0100");
    world.run_for(50ms);
    clear();
  }
  void open() {
    gateway->set_complete(true);
    gateway->set_safe(true);
  }
  void clear() {
    above.clear();
    beneath.clear();
  }
  void above_sends(const std::string& frame, rt::Duration time = 10ms) {
    master.send(frame);
    world.run_for(time);
  }
  ~Signals() override { gateway.reset(); }
  sim::World world;
  Line above{world, "above"};
  Line beneath{world, "beneath"};
  Station master{world, above};
  Station worker{world, beneath};
  std::optional<Station> up;
  std::unique_ptr<sim::Controller> controller;
  std::optional<MeteredPort> port;
  std::optional<can::Dispatcher> down;
  std::optional<device::Device> upper;
  std::optional<device::Device> lower;
  std::optional<SignalGateway> gateway;
};

Signal first() { return {.name = "drive", .from = 0, .to = 1, .source = {0x2100, 1}, .target = {0x2200, 1}}; }
Signal second() { return {.name = "boom", .from = 0, .to = 1, .source = {0x2100, 2}, .target = {0x2200, 2}}; }
Signal answer() { return {.name = "speed", .from = 1, .to = 0, .source = {0x2202, 0}, .target = {0x2102, 0}}; }

}  // namespace

// S3.31: Figure 14. The PDO above is taken apart; only the wanted signals go on, in PDOs of the bus beneath.
TEST_F(Signals, TakenApartAndSentOn) {
  build({second(), answer()});
  open();
  above_sends("203#34127856");
  EXPECT_EQ(beneath.log, Log{"281#7856"});
  worker.send("201#2211");
  world.run_for(10ms);
  EXPECT_EQ(above.log, (Log{"203#34127856", "183#2211"}));
  // The same value again is no event.
  above_sends("203#99997856");
  EXPECT_EQ(std::ranges::count(beneath.log, "281#7856"), 1);
  EXPECT_EQ(gateway->figures(0).forwarded, 2U);
}

// S3.31: "transmitted according to the pending transmission types": here with the next SYNC of the bus beneath.
TEST_F(Signals, BySync) {
  build({first()}, {.type = 1});
  open();
  above_sends("203#34127856");
  EXPECT_TRUE(beneath.log.empty());
  worker.send("080#");
  world.run_for(10ms);
  EXPECT_EQ(beneath.log, (Log{"080#", "181#3412", "281#0000"}));
}

// S3.32: modes, switched while it runs; and one target with another source in each mode.
TEST_F(Signals, Modes) {
  Signal by_hand = first(), automatic = second();
  by_hand.modes = 0b01;
  automatic.modes = 0b10;
  automatic.target = by_hand.target;
  build({by_hand, automatic});
  open();
  above_sends("203#34127856");
  EXPECT_EQ(beneath.log, Log{"181#3412"});
  gateway->set_mode(1);
  EXPECT_FALSE(gateway->forwards(0));
  above_sends("203#35127956");
  EXPECT_EQ(beneath.log, (Log{"181#3412", "181#7956"}));
  EXPECT_EQ(gateway->figures(0).refused, 1U);
}

// S3.33: nothing before the start-up is complete and the application says that it is safe; nothing that was received
// before.
TEST_F(Signals, OnlyWhenCompleteAndSafe) {
  build({first()});
  above_sends("203#01000000");
  gateway->set_complete(true);
  above_sends("203#02000000");
  gateway->set_complete(false);
  gateway->set_safe(true);
  above_sends("203#03000000");
  gateway->set_complete(true);
  world.run_for(100ms);
  EXPECT_TRUE(beneath.log.empty());
  EXPECT_EQ(gateway->figures(0).refused, 3U);
  above_sends("203#04000000");
  EXPECT_EQ(beneath.log, Log{"181#0400"});
  gateway->set_safe(false);
  above_sends("203#05000000");
  EXPECT_EQ(beneath.log, Log{"181#0400"});
}

// S3.33: what consumers see when it stops. Hold: the last value, as often as before.
TEST_F(Signals, StoppedHolds) {
  build({first()}, {.event_timer_ms = 100});
  open();
  above_sends("203#34120000");
  gateway->set_safe(false);
  clear();
  world.run_for(1s);
  EXPECT_GE(std::ranges::count(beneath.log, "181#3412"), 9);
}

// S3.33: a substitute: at once, and until it is safe again.
TEST_F(Signals, StoppedSubstitutes) {
  Signal signal = first();
  signal.stopped = Signal::Stopped::substitute;
  signal.substitute = {0xEE, 0xFF};
  build({signal});
  open();
  above_sends("203#34120000");
  gateway->set_safe(false);
  world.run_for(10ms);
  EXPECT_EQ(beneath.log, (Log{"181#3412", "181#EEFF"}));
  gateway->set_safe(true);
  world.run_for(10ms);
  EXPECT_EQ(beneath.log.size(), 2U);
  above_sends("203#35120000");
  EXPECT_EQ(beneath.log.back(), "181#3512");
}

// S3.33: silent: the consumer's RPDO deadline runs out, EMCY 8250h on its bus.
TEST_F(Signals, StoppedIsSilent) {
  Signal signal = first();
  signal.stopped = Signal::Stopped::silent;
  build({signal}, {.event_timer_ms = 50});
  Station station(world, beneath);
  od::DescriptionBuilder b;
  device::add_device(b, {.name = "Consumer"});
  b.variable(0x2300,
             {.name = "Command", .type = od::DataType::unsigned16, .access = od::Access::rww, .mappable = true});
  device::add_rpdo(b, 1, {.map = {{{0x2300, 0}, 16}}, .event_timer_ms = 200});
  device::Device consumer(station.dispatcher, b.build(), nullptr,
                          {.address = {1, 1, 3, 1}, .node_id = NodeId(9), .presets = {{{0x1400, 1}, 0x181}}});
  consumer.power_on();
  world.run_for(50ms);
  worker.send("000#0109");
  open();
  above_sends("203#34120000", 1s);
  EXPECT_TRUE(std::ranges::none_of(beneath.log, [](const auto& frame) { return frame.starts_with("089#"); }));
  EXPECT_EQ(consumer.values().get<std::uint16_t>({0x2300, 0}), 0x1234);
  gateway->set_safe(false);
  clear();
  world.run_for(1s);
  EXPECT_TRUE(std::ranges::none_of(beneath.log, [](const auto& frame) { return frame.starts_with("181#"); }));
  EXPECT_TRUE(std::ranges::any_of(beneath.log, [](const auto& frame) { return frame.starts_with("089#5082"); }));
  gateway->set_safe(true);
  above_sends("203#36120000", 1s);
  EXPECT_EQ(consumer.values().get<std::uint16_t>({0x2300, 0}), 0x1236);
}

// S3.33: the source falls silent: an old value is not forwarded for ever.
TEST_F(Signals, AStaleSource) {
  Signal signal = first();
  signal.freshness = 200ms;
  signal.stopped = Signal::Stopped::substitute;
  signal.substitute = {0, 0};
  build({signal}, {.event_timer_ms = 50});
  open();
  above_sends("203#34120000");
  EXPECT_TRUE(gateway->forwards(0));
  world.run_for(150ms);
  EXPECT_EQ(beneath.log.back(), "181#3412");
  world.run_for(150ms);
  EXPECT_FALSE(gateway->forwards(0));
  EXPECT_EQ(beneath.log.back(), "181#0000");
  above_sends("203#35120000");
  EXPECT_EQ(beneath.log.back(), "181#3512");
}

// S3.34: the delay, from the end of the frame above to the end of the frame beneath, is what the bus takes for that one
// frame.
TEST_F(Signals, DelayIsMeasured) {
  Signal signal = first();
  signal.budget = 1ms;
  build({signal});
  open();
  above_sends("203#34120000");
  EXPECT_EQ(gateway->figures(0).measured, 1U);
  EXPECT_EQ(gateway->figures(0).late, 0U);
  const auto seen = beneath.when("181#3412") - above.when("203#34120000");
  EXPECT_EQ(gateway->figures(0).longest, seen);
  EXPECT_GE(seen, 60 * 2us);  // two bytes of data: more than 60 bits of 2 us
  EXPECT_LE(seen, 80 * 2us);
}

// S3.34: later than its budget: told when the budget is over, not when the frame goes at last; and when it is in time
// again.
TEST_F(Signals, LateSignals) {
  Signal signal = first();
  signal.budget = 3ms;
  build({signal}, {.inhibit_100us = 100});  // 10 ms
  open();
  std::vector<std::pair<rt::Time, bool>> told;
  gateway->on_late([&](std::size_t, bool late) { told.push_back({world.now(), late}); });
  above_sends("203#01000000", 1ms);
  const auto at = world.now();
  above_sends("203#02000000", 2ms);
  EXPECT_TRUE(told.empty());
  world.run_for(20ms);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_LT(told[0].first - at, 4ms);
  EXPECT_TRUE(told[0].second);
  EXPECT_EQ(gateway->figures(0).late, 1U);
  above_sends("203#03000000");
  ASSERT_EQ(told.size(), 2U);
  EXPECT_FALSE(told[1].second);
  EXPECT_GT(gateway->figures(0).longest, 3ms);
}

// The bus beneath is cut: late, and nothing is stuck when it is whole again.
TEST_F(Signals, ACutBus) {
  Signal signal = first();
  signal.budget = 3ms;
  build({signal});
  open();
  controller->cable(false);
  above_sends("203#01000000", 100ms);
  EXPECT_EQ(gateway->figures(0).late, 1U);
  controller->cable(true);
  world.run_for(2s);
  above_sends("203#02000000", 100ms);
  EXPECT_EQ(beneath.log.back(), "181#0200");
}

// S3.35: both signals of every frame, at the highest rate that the bus above has: none is left behind, none later than
// two frames of the bus beneath.
TEST_F(Signals, EverySignalInTime) {
  Signal one = first(), two = second();
  one.budget = two.budget = 1ms;
  build({one, two});
  open();
  for (unsigned i = 1; i <= 500; ++i) {
    can::Frame frame = can::Frame::base(0x203, {0, 0, 0, 0});
    frame.data[0] = frame.data[2] = static_cast<std::uint8_t>(i);
    frame.data[1] = frame.data[3] = static_cast<std::uint8_t>(i >> 8U);
    while (master.controller->send(frame, 0) == can::Queued::full) world.run_for(1ms);
    world.run_for(300us);
  }
  world.run_for(10ms);
  for (const std::size_t signal : {0U, 1U}) {
    EXPECT_EQ(gateway->figures(signal).forwarded, 500U);
    EXPECT_EQ(gateway->figures(signal).measured, 500U);
    EXPECT_EQ(gateway->figures(signal).late, 0U);
  }
  EXPECT_EQ(std::ranges::count_if(beneath.log, [](const auto& frame) { return frame.starts_with("181#"); }), 500);
}

// S3.35, S3.34: the same while others take two thirds of the bus beneath, all of them with the higher priority: each
// signal still goes on, each within what one frame of theirs on the wire and those that are waiting take.
TEST_F(Signals, EverySignalInTimeUnderLoad) {
  Signal one = first(), two = second();
  one.budget = two.budget = 2ms;
  build({one, two});
  open();
  Station other(world, beneath);
  const auto before = beneath.bus.load();
  for (unsigned i = 1; i <= 500; ++i) {
    for (int k = 0; k < 5; ++k) other.send("0A" + std::to_string(k) + "#1122334455667788");
    can::Frame frame = can::Frame::base(0x203, {0, 0, 0, 0});
    frame.data[0] = frame.data[2] = static_cast<std::uint8_t>(i);
    frame.data[1] = frame.data[3] = static_cast<std::uint8_t>(i >> 8U);
    ASSERT_NE(master.controller->send(frame, 0), can::Queued::full);
    world.run_for(2ms);
  }
  EXPECT_GT(beneath.bus.load(), before);
  EXPECT_GT(beneath.bus.load(), 0.6);
  for (const std::size_t signal : {0U, 1U}) {
    EXPECT_EQ(gateway->figures(signal).forwarded, 500U);
    EXPECT_EQ(gateway->figures(signal).measured, 500U);
    EXPECT_EQ(gateway->figures(signal).late, 0U);
  }
  // And when the bus has no room left, that is told, not hidden.
  for (unsigned i = 0; i < 200; ++i) {
    for (int k = 0; k < 9; ++k) other.send("0A" + std::to_string(k) + "#1122334455667788");
    if (i % 4 == 0) master.send("203#" + std::string(i % 8 == 0 ? "AAAAAAAA" : "BBBBBBBB"));
    world.run_for(1ms);
  }
  EXPECT_GT(gateway->figures(0).late, 0U);
}

// S3.31: an MPDO is taken apart as a PDO is: what it writes is received.
TEST_F(Signals, AnMpdoBringsASignalToo) {
  build({first()});
  auto& values = upper->values();
  const auto id = values.get_or<std::uint32_t>({0x1400, 1}, 0U);
  values.set<std::uint32_t>({0x1400, 1}, id | 0x8000'0000U);
  values.set<std::uint8_t>({0x1600, 0}, 0xFF);  // destination address mode
  values.set<std::uint32_t>({0x1400, 1}, id);
  upper->services().pdos()->refresh();
  open();
  above_sends("203#8300210131020000");
  EXPECT_EQ(values.get<std::uint16_t>({0x2100, 1}), 0x0231);
  ASSERT_EQ(beneath.log, Log{"181#3102"});
  above_sends("203#8400210132020000");
  EXPECT_EQ(beneath.log.size(), 1U) << "it is for node 4";
}

// S3.36, and a table that is wrong in every way: each is told in words, the rest is forwarded.
TEST_F(Signals, ATableThatIsWrong) {
  Signal no_side = first(), no_object = first(), wide = first(), text = first(), same = first(), twice = first(),
         loop = answer(), back = answer(), safety = first(), substitute = first();
  no_side.to = 7;
  no_object.source = {0x5000, 1};
  wide.target = {0x2203, 0};
  text.target = {0x2204, 0};
  same.to = 0;
  twice.name = "twice";
  loop.source = {0x2200, 2};
  loop.target = {0x2100, 2};
  back = second();
  safety.target = {0x2205, 0};
  substitute.target = {0x2202, 0};
  substitute.stopped = Signal::Stopped::substitute;
  const std::vector<Signal> table{first(), no_side, no_object, wide, text, same, twice, loop, back, safety, substitute};
  const auto upper_words = upper_description();
  const auto lower_words = lower_description(0xFF, 0, 0);
  std::vector<std::string> texts;
  for (const auto& problem : problems(table, {upper_words.get(), lower_words.get()})) {
    texts.push_back(std::to_string(problem.signal) + " " + problem.text);
  }
  EXPECT_EQ(texts,
            (std::vector<std::string>{
                "1 drive: there is no side 7",
                "2 drive: 5000h:01 is not there on side 0",
                "3 drive: 2100h:01 has 2 bytes, 2203h:00 has 4",
                "4 drive: 2204h:00 on side 1 has no fixed size: no PDO carries it",
                "5 drive: it begins and ends on side 0",
                "9 drive: 2205h:00 on side 1 is safety-relevant (SRDO): it is never forwarded, as the gateway would"
                " have to be part of the safety function",
                "10 drive: its substitute has 0 bytes, 2202h:00 has 2",
                "6 twice: 2200h:01 on side 1 is the target of drive in the same mode",
                "7 speed: it forms a loop",
            }));
  build(table);
  open();
  above_sends("203#34120000");
  EXPECT_EQ(beneath.log, Log{"181#3412"});
}

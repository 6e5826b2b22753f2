// PDO, SYNC, TIME, error behaviour, supervision and the watch over its own identifiers in a whole device.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include "../pch.hpp"
#include "berth/co/sdo_client.hpp"
#include "rig.hpp"

namespace berth::device::test::services_tests {
namespace {

using od::AbortCode;
using od::Access;
using od::DataType;
using od::Literal;

Options node9() { return {.address = address_of(5), .node_id = NodeId(9), .bit_rate = 500'000}; }

std::shared_ptr<const od::Description> description() {
  od::DescriptionBuilder b;
  add_device(b);
  add_sync(b);
  b.variable(0x1012, {.name = "COB-ID TIME", .initial = Literal::number(0x8000'0100)});
  b.object(0x1029, od::ObjectCode::array, "Error behaviour");
  for (std::uint8_t i = 1; i <= 3; ++i)
    b.sub(0x1029, {.sub = i, .type = DataType::unsigned8, .initial = Literal::number(0)});
  b.variable(0x2000, {.type = DataType::unsigned16, .access = Access::ro, .mappable = true});
  b.variable(0x2001, {.type = DataType::unsigned16, .access = Access::rww, .mappable = true});
  add_tpdo(b, 1, {.map = {{{0x2000, 0}, 16}}});
  add_tpdo(b, 2, {.map = {{{0x2000, 0}, 16}}, .type = 1});
  add_rpdo(b, 1, {.map = {{{0x2001, 0}, 16}}, .event_timer_ms = 0});
  add_rpdo(b, 2, {.map = {{{0x2001, 0}, 16}}, .type = 1});
  b.object(0x1201, od::ObjectCode::record, "SDO server 2", DataType::sdo_parameter);
  b.sub(0x1201, {.sub = 1, .initial = Literal::number(0x641)});
  b.sub(0x1201, {.sub = 2, .initial = Literal::number(0x5C1)});
  b.sub(0x1201, {.sub = 3, .type = DataType::unsigned8, .initial = Literal::number(0)});
  return b.build();
}

struct Site {
  explicit Site(Options options = node9(), const Timing& timing = {})
      : node(rig.world, rig.bus, std::move(options), timing, {}, description()) {
    node.on();
    rig.run(milliseconds(2));
  }
  Rig rig;
  Node node;
};

// docs/protocols/cia301.md §NMT: PDOs in operational only, SYNC and TIME in pre-operational too, EMCY not in stopped.
TEST(Services, A3_3_EachRunsInItsStates) {
  Site s;
  auto& device = s.node.device;
  auto value = device.variable<std::uint16_t>({0x2000, 0});
  int syncs = 0;
  int times = 0;
  device.on().sync = [&](std::uint8_t) { ++syncs; };
  device.on().time = [&](const co::TimeOfDay& time) {
    ++times;
    EXPECT_EQ(time.days, 0x3A98);
    EXPECT_EQ(time.milliseconds, 0x01020304U);
  };
  const auto everything = [&](std::uint16_t to_rpdo) {
    s.rig.record.clear();
    value.set(static_cast<std::uint16_t>(value.get() + 1));
    s.rig.ask("209#" + Rig::hex8(to_rpdo & 255) + Rig::hex8(to_rpdo >> 8));
    s.rig.ask("080#");
    s.rig.ask("100#04030201983A");
    device.errors().raise(0xFF01, 0x80);
    s.rig.run(milliseconds(2));
  };
  const auto seen = [&](std::string_view start) {
    return std::ranges::count_if(s.rig.record.text, [&](const auto& line) { return line.starts_with(start); });
  };
  const auto rpdo = [&] { return device.values().get_or<std::uint16_t>({0x2001, 0}, 0); };

  everything(0x1111);  // pre-operational
  EXPECT_EQ(seen("189#") + seen("289#"), 0);
  EXPECT_EQ(rpdo(), 0);
  EXPECT_EQ(syncs, 1);
  EXPECT_EQ(times, 1);
  EXPECT_EQ(seen("089#"), 1);
  device.errors().clear(0xFF01);

  s.rig.ask("000#0109");
  everything(0x2222);  // operational
  EXPECT_EQ(seen("189#"), 1);
  EXPECT_EQ(seen("289#"), 1) << "at the SYNC";
  EXPECT_EQ(rpdo(), 0x2222);
  EXPECT_EQ(syncs, 2);
  EXPECT_EQ(times, 2);
  device.errors().clear(0xFF01);

  s.rig.ask("000#0209");
  everything(0x3333);  // stopped
  EXPECT_EQ(seen("189#") + seen("289#") + seen("089#"), 0);
  EXPECT_EQ(rpdo(), 0x2222);
  EXPECT_EQ(syncs, 2);
  EXPECT_EQ(times, 2);
  EXPECT_EQ(s.rig.read(0x1000, 0), "") << "no SDO";
  s.rig.record.clear();
  s.rig.ask("000#8009");
  EXPECT_EQ(seen("089#"), 1) << "what waited comes now";
}

// The application learns of what came by PDO, and sends by changing its objects.
TEST(Services, ApplicationAndPdos) {
  Site s;
  auto& device = s.node.device;
  std::vector<unsigned> rpdos;
  std::vector<unsigned> written;
  std::vector<NmtState> states;
  auto set_point = device.variable<std::uint16_t>({0x2001, 0});
  device.on().rpdo = [&](unsigned number) { rpdos.push_back(number); };
  device.on().state = [&](NmtState state) { states.push_back(state); };
  device.on_write({0x2001, 0}, [&] { written.push_back(set_point.get()); });
  s.rig.ask("000#0109");
  EXPECT_EQ(states, std::vector<NmtState>{NmtState::operational});
  s.rig.ask("209#0A00");
  s.rig.ask("309#0B00");
  EXPECT_EQ(rpdos, std::vector<unsigned>{1}) << "the second waits for the SYNC";
  s.rig.ask("080#");
  EXPECT_EQ(rpdos, (std::vector<unsigned>{1, 2}));
  EXPECT_EQ(s.rig.write(0x2001, 0, 2, 12), Rig::done(0x2001, 0));
  EXPECT_EQ(written, (std::vector<unsigned>{10, 11, 12}));
  s.rig.record.clear();
  auto measured = device.variable<std::uint16_t>({0x2000, 0});
  measured.set(0x0102);
  s.rig.run(milliseconds(1));
  EXPECT_EQ(s.rig.record.text, std::vector<std::string>{"189#0201"});
  measured.set(0x0102);  // the same
  measured.store(0x0103);
  s.rig.run(milliseconds(1));
  EXPECT_EQ(s.rig.record.text.size(), 1U);
  EXPECT_TRUE(device.services().event(1));
  s.rig.run(milliseconds(1));
  EXPECT_EQ(s.rig.record.text.back(), "189#0301");
  EXPECT_FALSE(device.services().event(3)) << "there is none";
}

// The errors that a PDO, a SYNC and a lost frame are reported by appear in 1001h and 1003h as the device's own do.
TEST(Services, ErrorsOfServicesAreTheDevices) {
  Site s;
  s.rig.ask("000#0109");
  s.rig.ask("209#01");  // shorter than mapped
  EXPECT_EQ(s.rig.read(0x1003, 1).substr(0, 16), "589#430310011082") << "8210h";
  EXPECT_EQ(s.rig.read(0x1001, 0), Rig::value(0x1001, 0, 1, 0x11));
  s.rig.ask("209#0100");
  EXPECT_EQ(s.rig.read(0x1001, 0), Rig::value(0x1001, 0, 1, 0));
  s.rig.ask("080#01");
  EXPECT_TRUE(s.node.device.errors().active(co::emcy_code::sync_length));
}

// OD.1200, A7.8: additional SDO servers of a device serve beside the default one, and "save" is answered where it was
// asked.
TEST(Services, OD_1200_AdditionalSdoServer) {
  Rig rig;
  od::DescriptionBuilder b;
  add_device(b);
  add_storage(b);
  b.object(0x1201, od::ObjectCode::record, "SDO server 2", DataType::sdo_parameter);
  b.sub(0x1201, {.sub = 1, .initial = Literal::number(0x8000'0000)});
  b.sub(0x1201, {.sub = 2, .initial = Literal::number(0x8000'0000)});
  Node node(rig.world, rig.bus, node9(), {}, milliseconds(10), b.build());
  node.on();
  rig.run(milliseconds(2));
  EXPECT_EQ(rig.read(0x1200, 1), Rig::value(0x1200, 1, 4, 0x609));
  EXPECT_EQ(rig.write(0x1200, 1, 4, 0x60A), Rig::refused(0x1200, 1, AbortCode::read_only));
  EXPECT_EQ(rig.write(0x1201, 1, 4, 0x601), Rig::refused(0x1201, 1, AbortCode::invalid_value)) << "restricted";
  EXPECT_EQ(rig.write(0x1201, 1, 4, 0x3A0), Rig::done(0x1201, 1));
  EXPECT_EQ(rig.write(0x1201, 2, 4, 0x3A1), Rig::done(0x1201, 2));
  rig.ask("3A0#4000100000000000");
  EXPECT_EQ(rig.record.text.back(), "3A1#4300100000000000");
  rig.ask("3A0#2310100173617665", milliseconds(1));
  rig.ask("609#4017100000000000", milliseconds(2));
  EXPECT_EQ(rig.record.text.back(), "589#4B17100000000000") << "the default channel goes on meanwhile";
  EXPECT_EQ(rig.write(0x1010, 1, 4, 0x65766173, milliseconds(2)), Rig::refused(0x1010, 1, AbortCode::device_state));
  rig.run(milliseconds(40));
  EXPECT_EQ(rig.record.text.back(), "3A1#6010100100000000");
  rig.ask("3A1#6000200000000000");
  EXPECT_TRUE(node.device.errors().active(co::emcy_code::id_collision)) << "SX.7: its answers are its own too";
  node.off();
  node.on();
  rig.run(milliseconds(5));
  rig.ask("3A0#4000100000000000");
  EXPECT_EQ(rig.record.text.back(), "3A1#4300100000000000") << "the stored channel serves after power-on";
}

// HC1.S17: what the dictionary says can be written, can be: the server's buffer is as long as the longest object.
TEST(Services, LongObjectsAreWrittenWhole) {
  struct Ended final : rt::Job {
    void run() noexcept override {}
  };
  Rig rig;
  od::DescriptionBuilder b;
  add_device(b);
  b.variable(0x3000, {.name = "Table", .type = DataType::domain, .capacity = 4000});
  Node node(rig.world, rig.bus, node9(), {}, {}, b.build());
  node.on();
  const auto port = rig.bus.attach({.queue_depth = 16});
  can::Dispatcher dispatcher(rig.world.executor(), *port);
  co::SdoClient client(dispatcher);
  std::vector<std::uint8_t> table(4000);
  for (std::size_t i = 0; i < table.size(); ++i) table[i] = static_cast<std::uint8_t>(i * 31);
  for (const auto mode : {co::SdoMode::segmented, co::SdoMode::block}) {
    co::SdoOptions options;
    options.mode = mode;
    std::ranges::reverse(table);
    auto transfer = client.download(NodeId(9), 0x3000, 0, table, options);
    Ended ended;
    transfer.begin(rig.world.executor(), ended);
    rig.run(seconds(2));
    EXPECT_TRUE(transfer.await_resume().has_value());
    EXPECT_TRUE(std::ranges::equal(node.device.values().bytes({0x3000, 0}), table));
  }
}

// HC5.2 of the passive side: a device that is destroyed in the middle of anything leaves nothing behind that calls it,
// and sends nothing.
TEST(Services, DestroyedInTheMiddleOfAnything) {
  for (const std::string_view when : {"save", "lss store", "rpdo fault", "upload", "booting", "bus-off"}) {
    Rig rig;
    auto controller = rig.bus.attach();
    const Timing timing{.boot = milliseconds(2)};
    TimedPort port(rig.world.executor(), *controller, timing, Random(1));
    can::Dispatcher dispatcher(rig.world.executor(), port);
    od::DescriptionBuilder b;
    add_device(b);
    add_storage(b);
    b.variable(0x2001, {.type = DataType::unsigned16, .access = Access::rww, .mappable = true});
    add_rpdo(b, 1, {.map = {{{0x2001, 0}, 16}}, .event_timer_ms = 20});
    const auto d = b.build();
    SimFlash flash(rig.world.executor(), memory_size(*d), milliseconds(20));
    auto options = node9();
    options.bus_off_recovery = milliseconds(10);
    auto device = std::make_unique<Device>(dispatcher, d, &flash, options, &port, timing);
    device->on().state = [](NmtState) {};
    device->power_on();
    if (when != "booting") rig.run(milliseconds(5));
    if (when == "save") rig.ask("609#2310100173617665");
    if (when == "lss store") {
      rig.give_id(address_of(5), 9);
      rig.ask("7E5#1700000000000000");
      EXPECT_TRUE(device->stored().storing());
    }
    if (when == "rpdo fault") {
      rig.ask("000#0109");
      rig.ask("209#01");
      EXPECT_TRUE(device->errors().active(co::emcy_code::pdo_length));
    }
    if (when == "upload") rig.ask("609#4008100000000000");
    if (when == "bus-off") {
      controller->preset_counters(255, 0);
      sim::Fault fault;
      fault.where = sim::from_start(20);
      fault.trigger.when = [](const sim::FrameStart& start) { return start.frame.id == 0x589; };
      rig.bus.inject(fault);
      rig.ask("609#4000100000000000");
      EXPECT_TRUE(controller->status().bus_off);
    }
    const auto frames = rig.record.text.size();
    device.reset();
    rig.run(milliseconds(200));
    EXPECT_EQ(rig.record.text.size(), frames) << when;
    EXPECT_FALSE(flash.writing()) << when;
  }
}

// A consumer that misses SYNC says so, and shows it.
TEST(Services, SyncMissingIsTold) {
  Site s;
  std::vector<bool> told;
  s.node.device.on().sync_missing = [&](bool missing) { told.push_back(missing); };
  EXPECT_EQ(s.rig.write(0x1006, 0, 4, 10'000), Rig::done(0x1006, 0));
  s.rig.ask("000#0109");
  s.rig.ask("080#", milliseconds(14));
  EXPECT_TRUE(told.empty());
  s.rig.run(milliseconds(3));
  EXPECT_EQ(told, std::vector<bool>{true});
  EXPECT_EQ(leds(s.node.device.led_inputs()), (Leds{Light::on, Light::triple_flash}));
  s.rig.ask("080#");
  EXPECT_EQ(told, (std::vector<bool>{true, false}));
}

// The device's clock is 10 % slow: event timers and SYNC run by it.
TEST(Services, TimersRunByTheDevicesClock) {
  Site s(node9(), {.drift_ppm = -100'000});
  EXPECT_EQ(s.rig.write(0x1800, 5, 2, 100), Rig::done(0x1800, 5));
  s.rig.ask("000#0109", milliseconds(1));
  s.rig.record.clear();
  s.rig.run(milliseconds(1200));
  const auto sent = std::ranges::count_if(s.rig.record.text, [](const auto& f) { return f.starts_with("189#"); });
  EXPECT_EQ(sent, 10) << "every 111 ms";
}

// SX.7: every identifier that only this node may send with: EMCY by 1014h, SDO servers, error control, valid TPDOs,
// SYNC and TIME while it produces them.
TEST(Services, SX_7_ItsOwnIdentifiersFromAnotherNode) {
  const std::vector<std::string> own{"089#0000000000000000", "589#6000200000000000", "709#05", "189#0000", "289#0000",
                                     "5C1#6000200000000000"};
  for (const auto& frame : own) {
    Site s;
    s.rig.ask("000#0109");
    EXPECT_FALSE(s.node.device.errors().active(co::emcy_code::id_collision));
    s.rig.ask(frame);
    EXPECT_TRUE(s.node.device.errors().active(co::emcy_code::id_collision)) << frame;
    EXPECT_EQ(s.rig.record.count("089#5081110000000000"), 1U) << frame;
  }
  for (const auto* frame : {"08A#0000000000000000", "609#4000100000000000", "709#R1", "189#R2", "080#",
                            "100#000000000000", "389#0000", "209#0000", "309#0000", "000#0109"}) {
    Site s;
    s.rig.ask("000#0109");
    s.rig.ask(frame);
    EXPECT_FALSE(s.node.device.errors().active(co::emcy_code::id_collision)) << frame;
  }
  Site moved;  // the identifier in use counts, not the predefined one
  EXPECT_EQ(moved.rig.write(0x1014, 0, 4, 0x80000089), Rig::done(0x1014, 0));
  EXPECT_EQ(moved.rig.write(0x1014, 0, 4, 0x0FE), Rig::done(0x1014, 0));
  moved.rig.ask("089#0000000000000000");
  EXPECT_FALSE(moved.node.device.errors().active(co::emcy_code::id_collision));
  moved.rig.ask("0FE#0000000000000000");
  EXPECT_TRUE(moved.node.device.errors().active(co::emcy_code::id_collision));
  Site producer;
  EXPECT_EQ(producer.rig.write(0x1005, 0, 4, 0x40000080), Rig::done(0x1005, 0));
  producer.rig.ask("080#");
  EXPECT_TRUE(producer.node.device.errors().active(co::emcy_code::id_collision)) << "two SYNC producers";
  Site clock;
  EXPECT_EQ(clock.rig.write(0x1012, 0, 4, 0x00000100), Rig::done(0x1012, 0));
  EXPECT_EQ(clock.rig.write(0x1012, 0, 4, 0x40000100), Rig::done(0x1012, 0));
  clock.rig.ask("100#000000000000");
  EXPECT_TRUE(clock.node.device.errors().active(co::emcy_code::id_collision)) << "two TIME producers";
  EXPECT_EQ(clock.node.device.services().send_time({.milliseconds = 1, .days = 2}), can::Queued::yes);
  clock.rig.run(milliseconds(1));
  EXPECT_EQ(clock.rig.record.text.back(), "100#010000000200");
  auto deaf = node9();
  deaf.detect_collision = false;
  Site quiet(deaf);
  quiet.rig.ask("000#0109");
  for (const auto& frame : own) quiet.rig.ask(frame);
  EXPECT_FALSE(quiet.node.device.errors().active(co::emcy_code::id_collision));
}

// A4.8, OD.1029: 0 = pre-operational, only if operational; 1 = nothing; 2 = stopped, also from pre-operational. For a
// lost heartbeat, life guarding, bus-off, and classes of the device's own.
TEST(Services, A4_8_OD_1029_EveryValueInEveryState) {
  const auto after = [](NmtState from, unsigned value) {
    if (value == 2) return NmtState::stopped;
    return value == 0 && from == NmtState::operational ? NmtState::pre_operational : from;
  };
  for (const unsigned value : {0U, 1U, 2U}) {
    for (const auto& [command, from] :
         {std::pair{"000#0109", NmtState::operational}, std::pair{"000#8009", NmtState::pre_operational},
          std::pair{"000#0209", NmtState::stopped}}) {
      for (const std::string_view cause : {"heartbeat", "life guarding", "bus-off", "own class"}) {
        Site s;
        auto& device = s.node.device;
        const std::uint8_t sub = cause == "own class" ? 3 : 1;
        EXPECT_EQ(s.rig.write(0x1029, sub, 1, value), Rig::done(0x1029, sub));
        if (cause == "heartbeat") s.rig.write(0x1016, 1, 4, 0x00010064);
        if (cause == "life guarding") {
          s.rig.write(0x100C, 0, 2, 50);
          s.rig.write(0x100D, 0, 1, 2);
        }
        s.rig.ask(command);
        ASSERT_EQ(device.state(), from);
        if (cause == "heartbeat") s.rig.ask("701#05", milliseconds(120));
        if (cause == "life guarding") s.rig.ask("709#R1", milliseconds(120));
        if (cause == "bus-off") {
          s.node.controller->preset_counters(255, 0);
          sim::Fault fault;
          fault.where = sim::from_start(20);
          fault.trigger.when = [](const sim::FrameStart& start) {
            return start.frame.id == 0x709 && !start.frame.remote;
          };
          s.rig.bus.inject(fault);
          s.rig.ask("709#R1", milliseconds(50));
          ASSERT_TRUE(s.node.controller->status().bus_off);
        }
        if (cause == "own class") device.errors().behave(3);
        EXPECT_EQ(device.state(), after(from, value)) << cause << ", 1029h = " << value;
      }
    }
  }
}

// HU.23: each node's heartbeat error is its own: it is told when a node is back, though another is still away. A4.6
TEST(Services, A4_6_HU_23_HeartbeatErrorsNodeByNode) {
  Site s;
  EXPECT_EQ(s.rig.write(0x1016, 1, 4, 0x00010064), Rig::done(0x1016, 1));
  EXPECT_EQ(s.rig.write(0x1016, 2, 4, 0x00020064), Rig::done(0x1016, 2));
  EXPECT_EQ(s.rig.write(0x1016, 3, 4, 0x00030064), Rig::done(0x1016, 3));  // never seen: no reason to complain
  s.rig.ask("000#0109");
  s.rig.ask("701#05", milliseconds(1));
  s.rig.ask("702#05", milliseconds(50));
  s.rig.ask("702#05", milliseconds(70));
  EXPECT_EQ(s.rig.record.count("089#3081110100000000"), 1U) << "node 1";
  EXPECT_EQ(s.rig.record.count("089#3081110200000000"), 0U);
  EXPECT_EQ(s.node.device.state(), NmtState::pre_operational);
  s.rig.ask("000#0109");
  s.rig.run(milliseconds(100));
  EXPECT_EQ(s.rig.record.count("089#3081110200000000"), 1U) << "node 2, while node 1 is away";
  EXPECT_EQ(s.node.device.state(), NmtState::pre_operational) << "an event of its own";
  EXPECT_EQ(s.rig.read(0x1003, 1), Rig::value(0x1003, 1, 4, 0x00028130));
  EXPECT_EQ(s.rig.read(0x1003, 2), Rig::value(0x1003, 2, 4, 0x00018130));
  s.rig.ask("701#05");
  EXPECT_EQ(s.rig.record.count("089#3081110200000000"), 2U) << "node 1 is back, and node 2's error remains";
  EXPECT_EQ(s.rig.read(0x1001, 0), Rig::value(0x1001, 0, 1, 0x11));
  EXPECT_EQ(s.rig.write(0x1016, 2, 4, 0), Rig::done(0x1016, 2)) << "node 2 is not supervised any more";
  EXPECT_EQ(s.rig.record.count("089#0000000200000000"), 1U);
  EXPECT_EQ(s.rig.read(0x1001, 0), Rig::value(0x1001, 0, 1, 0));
}

// HU.24: a node of 1016h that was never seen is told to the application, once; it is no heartbeat event of CiA 301.
TEST(Services, HU_24_NeverSeenNodesAreTold) {
  auto options = node9();
  options.never_seen = milliseconds(300);
  Site s(options);
  std::vector<co::HeartbeatEvent> events;
  s.node.device.on().heartbeat = [&](const co::HeartbeatEvent& event) { events.push_back(event); };
  EXPECT_EQ(s.rig.write(0x1016, 1, 4, 0x00010064), Rig::done(0x1016, 1));
  EXPECT_EQ(s.rig.write(0x1016, 2, 4, 0x00020064), Rig::done(0x1016, 2));
  s.rig.ask("701#7F");
  s.rig.run(seconds(1));
  std::vector<co::HeartbeatEvent::Kind> of_two;
  for (const auto& event : events) {
    if (event.node == NodeId(2)) of_two.push_back(event.kind);
  }
  EXPECT_EQ(of_two, std::vector<co::HeartbeatEvent::Kind>{co::HeartbeatEvent::Kind::never_seen});
  EXPECT_EQ(s.rig.record.count("089#3081110200000000"), 0U);
  EXPECT_EQ(s.rig.record.count("089#3081110100000000"), 1U) << "node 1 was seen and is lost";
}

// A4.1, A3.6: the boot-up message once, on the way into pre-operational, and never without a node-ID.
TEST(Services, A4_1_A3_6_BootUpOnceAndNotWithoutANodeId) {
  Site s;
  EXPECT_EQ(s.rig.record.text, std::vector<std::string>{"709#00"});
  s.rig.ask("000#0109");
  s.rig.ask("000#8009");
  s.rig.ask("000#0209");
  s.rig.ask("000#8009");
  EXPECT_EQ(s.rig.record.count("709#00"), 1U) << "only out of initialising";
  s.rig.ask("000#8100");
  s.rig.ask("000#8200");
  EXPECT_EQ(s.rig.record.count("709#00"), 3U);
  Rig rig;
  Node node(rig.world, rig.bus, {.address = address_of(6), .bit_rate = 500'000}, {}, {}, description());
  node.on();
  rig.run(seconds(1));
  rig.ask("000#8200");
  rig.ask("000#8100");
  EXPECT_EQ(rig.record.text.size(), 2U) << "what the master sent";
}

// HC5.4, HU.27: nothing is global: two networks with devices of one node-ID each, in one process, one after the other
// and interleaved in time.
TEST(Services, HC5_4_HU_27_TwoNetworksInOneProcess) {
  Rig left;
  Rig right(250'000);
  Node a(left.world, left.bus, node9(), {}, {}, description());
  Node b(left.world, left.bus, {.address = address_of(6), .node_id = NodeId(10), .bit_rate = 500'000}, {}, {},
         description());
  auto other = node9();
  other.bit_rate = 250'000;
  Node c(right.world, right.bus, other, {}, {}, description());
  for (auto* node : {&a, &b, &c}) node->on();
  for (int i = 0; i < 5; ++i) {
    left.run(milliseconds(1));
    right.run(milliseconds(3));
  }
  EXPECT_EQ(left.record.text.size(), 2U);
  EXPECT_EQ(right.record.text, std::vector<std::string>{"709#00"});
  left.ask("000#0100");
  EXPECT_EQ(a.device.state(), NmtState::operational);
  EXPECT_EQ(b.device.state(), NmtState::operational);
  EXPECT_EQ(c.device.state(), NmtState::pre_operational);
  c.device.errors().raise(0xFF01, 0x80);
  right.run(milliseconds(2));
  EXPECT_EQ(right.record.count("089#01FF810000000000"), 1U);
  EXPECT_EQ(left.record.count("089#01FF810000000000"), 0U);
  EXPECT_FALSE(a.device.errors().active(0xFF01));
  EXPECT_EQ(right.write(0x1017, 0, 2, 77), Rig::done(0x1017, 0));
  EXPECT_EQ(a.device.values().get_or<std::uint16_t>({0x1017, 0}, 9), 0) << "one description, values of their own";
}

// A day of a network: two devices boot, start, beat, are read and written, raise an error and reset. `slice` is called
// with each part of it.
std::vector<std::string> day(const std::function<void(const std::function<void()>&)>& slice) {
  std::unique_ptr<Rig> rig;
  std::unique_ptr<Node> a;
  std::unique_ptr<Node> b;
  std::vector<std::string> found;
  slice([&] {
    rig = std::make_unique<Rig>();
    a = std::make_unique<Node>(rig->world, rig->bus, node9(), Timing{}, rt::Duration{0}, description());
    b = std::make_unique<Node>(rig->world, rig->bus, Options{.address = address_of(6), .node_id = NodeId(10)});
    a->on();
    b->on();
  });
  for (unsigned i = 0; i < 20; ++i) {
    slice([&] {
      rig->run(milliseconds(3));
      if (i == 2) rig->write(0x1017, 0, 2, 7);
      if (i == 5) rig->ask("000#0100");
      if (i == 8) a->device.errors().raise(0xFF01, 0x80);
      if (i == 10) found.push_back(rig->read(0x1018, 4));
      if (i == 12) rig->ask("000#8109");
      if (i == 14) b->off();
    });
  }
  slice([&] {
    found.insert(found.end(), rig->record.text.begin(), rig->record.text.end());
    b.reset();
    a.reset();
    rig.reset();
  });
  return found;
}

// HC5.4: nothing belongs to the thread that made it, but to the executor: each part of a day may run in another thread,
// and two days at once, each in its own thread, are the same as each alone.
TEST(Services, HC5_4_NoThreadIsAnyonesOwn) {
  const auto here = [](const std::function<void()>& part) { part(); };
  const auto elsewhere = [](const std::function<void()>& part) { std::thread(part).join(); };
  const auto alone = day(here);
  ASSERT_GT(alone.size(), 15U);
  EXPECT_EQ(std::ranges::count(alone, "709#00"), 2) << "power-on and reset";
  EXPECT_EQ(std::ranges::count(alone, "089#01FF810000000000"), 1);
  EXPECT_EQ(day(elsewhere), alone);
  std::array<std::vector<std::string>, 4> several;
  std::vector<std::thread> threads;
  for (auto& one : several) {
    threads.emplace_back([&] { one = day(here); });
  }
  for (auto& thread : threads) thread.join();
  for (const auto& one : several) EXPECT_EQ(one, alone);
}

// A9.4: the patterns of CiA 303-3, instant by instant.
TEST(Leds, A9_4_Patterns) {
  const auto pattern = [](Light light, int step_ms, int steps) {
    std::string text;
    for (int i = 0; i < steps; ++i) {
      // In the middle of each step, and the same one period of hours later.
      text += lit({light, Light::off}, milliseconds(i * step_ms) + milliseconds(step_ms / 2)).green ? '#' : '.';
    }
    return text;
  };
  EXPECT_EQ(pattern(Light::on, 200, 8), "########");
  EXPECT_EQ(pattern(Light::off, 200, 8), "........");
  EXPECT_EQ(pattern(Light::flickering, 50, 8), "#.#.#.#.") << "10 Hz";
  EXPECT_EQ(pattern(Light::blinking, 200, 8), "#.#.#.#.");
  EXPECT_EQ(pattern(Light::single_flash, 200, 14), "#.....#.....#.") << "200 ms, then a second dark";
  EXPECT_EQ(pattern(Light::double_flash, 200, 16), "#.#.....#.#.....");
  EXPECT_EQ(pattern(Light::triple_flash, 200, 20), "#.#.#.....#.#.#.....");
  EXPECT_EQ(pattern(Light::quadruple_flash, 200, 24), "#.#.#.#.....#.#.#.#.....");
  for (int ms = 0; ms < 1000; ms += 7) {
    const auto both = lit({Light::flickering, Light::flickering}, milliseconds(ms));
    EXPECT_NE(both.green, both.red) << "in turn";
  }
}

TEST(Leds, A9_4_WhatTheyShow) {
  using S = NmtState;
  EXPECT_EQ(leds({.state = S::pre_operational}), (Leds{Light::blinking, Light::off}));
  EXPECT_EQ(leds({.state = S::operational}), (Leds{Light::on, Light::off}));
  EXPECT_EQ(leds({.state = S::stopped}), (Leds{Light::single_flash, Light::off}));
  EXPECT_EQ(leds({.state = S::operational, .program_download = true}).green, Light::triple_flash);
  EXPECT_EQ(leds({.lss = true}), (Leds{Light::flickering, Light::flickering}));
  EXPECT_EQ(leds({.warning_limit = true}).red, Light::single_flash);
  EXPECT_EQ(leds({.error_control_event = true}).red, Light::double_flash);
  EXPECT_EQ(leds({.sync_missing = true}).red, Light::triple_flash);
  EXPECT_EQ(leds({.event_timer_missed = true}).red, Light::quadruple_flash);
  EXPECT_EQ(leds({.invalid_configuration = true}).red, Light::blinking);
  EXPECT_EQ(leds({.bus_off = true, .warning_limit = true, .invalid_configuration = true}).red, Light::on);
  EXPECT_EQ(leds({.warning_limit = true, .error_control_event = true, .event_timer_missed = true}).red,
            Light::quadruple_flash);
}

TEST(Leds, A9_4_OfARunningDevice) {
  Site s;
  auto& device = s.node.device;
  const auto shown = [&] { return leds(device.led_inputs()); };
  EXPECT_EQ(shown(), (Leds{Light::blinking, Light::off}));
  s.rig.ask("7E5#0401000000000000");
  EXPECT_EQ(shown(), (Leds{Light::flickering, Light::flickering})) << "LSS configuration";
  s.rig.ask("7E5#0400000000000000");
  s.rig.ask("000#0109");
  EXPECT_EQ(shown(), (Leds{Light::on, Light::off}));
  s.rig.write(0x1016, 1, 4, 0x00010064);
  s.rig.ask("701#05", milliseconds(150));
  EXPECT_EQ(shown(), (Leds{Light::blinking, Light::double_flash}));
  s.rig.ask("701#05");
  EXPECT_EQ(shown(), (Leds{Light::blinking, Light::off}));
  s.rig.write(0x1016, 1, 4, 0);
  s.rig.write(0x1400, 5, 2, 50);
  s.rig.ask("000#0109");
  s.rig.ask("209#0100", milliseconds(100));
  EXPECT_EQ(shown(), (Leds{Light::on, Light::quadruple_flash})) << "an RPDO is overdue";
  s.node.controller->preset_counters(100, 0);
  s.rig.ask("000#8209");
  EXPECT_EQ(shown().red, Light::single_flash);
}

}  // namespace
}  // namespace berth::device::test::services_tests

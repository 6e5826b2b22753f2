// A whole gateway (docs/multilevel.md): the example of examples/gateway as a program, and machines of several of them.
#include <gtest/gtest.h>
#include <algorithm>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "../paths.hpp"
#include "../shell.hpp"
#include "berth/multilevel/event_log.hpp"
#include "berth/multilevel/gateway_access.hpp"
#include "berth/multilevel/gateway_device.hpp"
#include "berth/network/dictionary_manager.hpp"
#include "tree.hpp"

using namespace berth;
using namespace berth::multilevel;
using namespace berth::multilevel::test;

namespace {

Log run_example() {
  const auto ran = berth::test::shell(berth::test::example_program("gateway"));
  EXPECT_EQ(ran.status, 0);
  Log lines;
  std::istringstream text(ran.out);
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  return lines;
}

}  // namespace

TEST(ExampleGateway, BootsCarriesAndHandsOn) {
  const auto lines = run_example();
  const auto at = [&](const std::string& line) {
    const auto found = std::ranges::find(lines, line);
    EXPECT_NE(found, lines.end()) << line;
    return found - lines.begin();
  };
  // The bus beneath first.
  EXPECT_LT(at("  boom     000#0105"), at("backbone   703#00"));
  // 1000h of 3/5.
  const auto last = std::find(lines.rbegin(), lines.rend(), "  boom     605#4000100000000000");
  EXPECT_LT(at("backbone   703#00"), lines.rend() - last - 1);
  at("the valve beneath the gateway is of type 00000000");
  // The lever, and the valve's emergency.
  EXPECT_LT(at("backbone   203#7B01"), at("  boom     181#7B01"));
  EXPECT_LT(at("  boom     085#1023030000000000"), at("backbone   083#1023030500000000"));
  EXPECT_TRUE(lines.back().starts_with("the lever's position took ")) << lines.back();
}

namespace {

// Backbone with two gateways, 3 and 4; beneath each a master 1 and devices 5 and 6: equal subsystems with equal
// node-IDs.
struct Machine : ::testing::Test {
  struct Sub {
    Sub(Machine& machine, unsigned id)
        : line(machine.world, "sub" + std::to_string(id)),
          up(machine.backbone.bus.attach({.queue_depth = 64, .rx_depth = 64})),
          down(line.bus.attach({.queue_depth = 64, .rx_depth = 64})),
          gateway(machine.world.executor(), *up,
                  {.upper = {.address = {1, 1, 1, id}, .node_id = NodeId(static_cast<std::uint8_t>(id))}}),
          bus(gateway.add_bus(*down, bus_options())),
          master(bus.dispatcher(), bus.device().values(),
                 [this](co::NmtCommand command) { bus.device().apply(command); }) {
      bus.use(master.bus().sdo());
      bus.device().on().state = [this](NmtState state) { master.own_state(state, NodeId(1)); };
      master.network().observe([this](const network::NetworkEvent& event) {
        using Kind = network::NetworkEvent::Kind;
        if (event.kind == Kind::operational) bus.sub_bus().booted();
        if (event.kind == Kind::halted) bus.sub_bus().failed(event.node);
      });
      for (unsigned leaf = 5; leaf <= 6; ++leaf) leaves.push_back(std::make_unique<Leaf>(machine.world, line, leaf));
    }
    static BusOptions bus_options() {
      od::DescriptionBuilder b;
      device::add_device(b, {.name = "Sub-master"});
      network::add_manager_objects(b, {.most = 8});
      BusOptions options;
      options.description = b.build();
      options.device = {.node_id = NodeId(1), .presets = {{{0x1F81, 5}, 0x0D}, {{0x1F81, 6}, 0x0D}}};
      options.boots_first = true;
      return options;
    }
    Line line;
    std::unique_ptr<sim::Controller> up, down;
    GatewayDevice gateway;
    GatewayDevice::Bus& bus;
    network::DictionaryManager master;
    std::vector<std::unique_ptr<Leaf>> leaves;
  };
  Machine()
      : system(world, backbone),
        client(system.dispatcher),
        routes(client),
        log(system.dispatcher, EmcyLayout::source_and_exit) {
    log.hear_all();
    for (unsigned id = 3; id <= 4; ++id) subs.push_back(std::make_unique<Sub>(*this, id));
    for (auto& sub : subs) sub->gateway.power_on();
    world.run_for(2s);
  }
  co::SdoAccess& at(const char* path) { return routes.access(*parse_path(path)); }
  sim::World world;
  Line backbone{world, "backbone"};
  Station system;
  co::SdoClient client;
  Routes routes;
  EventLog log;
  std::vector<std::unique_ptr<Sub>> subs;
};

}  // namespace

// Both buses have booted, and the node-IDs that are there twice are told apart by their paths.
TEST_F(Machine, EqualSubsystems) {
  for (auto& sub : subs) {
    EXPECT_EQ(sub->bus.device().state(), NmtState::operational);
    EXPECT_EQ(sub->gateway.upper().state(), NmtState::pre_operational);
  }
  const std::uint32_t left = 0x11, right = 0x22;
  ASSERT_TRUE(await(world, at("3/5").write_u32(0x2002, 0, left)));
  ASSERT_TRUE(await(world, at("4/5").write_u32(0x2002, 0, right)));
  EXPECT_EQ(*await(world, at("3/5").read_u32(0x2002, 0)), left);
  EXPECT_EQ(*await(world, at("4/5").read_u32(0x2002, 0)), right);
  subs[0]->leaves[0]->device.errors().raise(0x2310, co::error_register::current);
  subs[1]->leaves[0]->device.errors().raise(0x2310, co::error_register::current);
  world.run_for(50ms);
  ASSERT_EQ(log.count(), 2U);
  EXPECT_EQ(path_text(log.entries()[0].reading.path), "3/5");
  EXPECT_EQ(path_text(log.entries()[1].reading.path), "4/5");
}

// S3.1: NMT, boot-up, heartbeats, SYNC and LSS stay on their bus; what crosses is SDO and EMCY, in frames of each bus's
// own.
TEST_F(Machine, EveryBusIsItsOwn) {
  backbone.clear();
  for (auto& sub : subs) sub->line.clear();
  for (const char* frame : {"000#0105", "000#8200", "080#", "7E5#0401000000000000", "705#05", "100#000000000000"}) {
    system.send(frame);
    world.run_for(20ms);
  }
  EXPECT_TRUE(subs[0]->line.log.empty());
  Station other(world, subs[0]->line);
  backbone.clear();
  for (const char* frame : {"000#8005", "080#", "7E5#0401000000000000", "77F#05", "100#000000000000", "205#1122"}) {
    other.send(frame);
    world.run_for(20ms);
  }
  EXPECT_TRUE(backbone.log.empty());
  EXPECT_TRUE(subs[1]->line.log.empty());
}

// S3.5, S3.6: the bus beneath is described by its own master's objects, read from the backbone; NMT beneath is
// requested there (1F82h), and reaches this bus alone.
TEST_F(Machine, NmtBeneathByRequest) {
  EXPECT_EQ(*await(world, at("3/1").read_u32(0x1F81, 5)), 0x0DU);
  EXPECT_EQ(await(world, at("3/1").read(0x1F82, 5))->as<std::uint8_t>(), 5);
  for (auto& sub : subs) sub->line.clear();
  const Bytes pre_operational{127};
  ASSERT_TRUE(await(world, at("3/1").write(0x1F82, 5, pre_operational)));
  world.run_for(20ms);
  EXPECT_EQ(subs[0]->line.log, Log{"000#8005"});
  EXPECT_EQ(subs[0]->leaves[0]->device.state(), NmtState::pre_operational);
  EXPECT_TRUE(subs[1]->line.log.empty());
  // "turn the single bus into pre-operational state before starting the configuring", and reset it afterwards.
  ASSERT_TRUE(await(world, at("4/1").write(0x1F82, 128, pre_operational)));
  world.run_for(20ms);
  EXPECT_EQ(subs[1]->leaves[1]->device.state(), NmtState::pre_operational);
  const Bytes reset{7};  // reset communication
  ASSERT_TRUE(await(world, at("4/1").write(0x1F82, 128, reset)));
  world.run_for(3s);
  EXPECT_EQ(subs[1]->leaves[1]->device.state(), NmtState::operational);
}

namespace {

// A gateway that hands one value of a bus beneath up: RPDO 1 of its node 1 there (201h) into TPDO 1 of its node above.
struct Lifting {
  Lifting(sim::World& world, Line& above, Line& beneath, std::uint8_t node)
      : up(above.bus.attach({.queue_depth = 64, .rx_depth = 64})),
        down(beneath.bus.attach({.queue_depth = 64, .rx_depth = 64})),
        gateway(world.executor(), *up, {.upper = {.node_id = NodeId(node)}, .description = dictionary(true)}) {
    gateway.add_bus(*down, {.device = {.node_id = NodeId(1)}, .description = dictionary(false)});
    EXPECT_TRUE(
        gateway
            .set_signals({Signal{
                .name = "speed", .from = 1, .to = 0, .source = {0x2000, 0}, .target = {0x2000, 0}, .budget = 5ms}})
            .empty());
    gateway.signals().set_safe(true);
    gateway.power_on();
  }
  static std::shared_ptr<const od::Description> dictionary(bool upper) {
    od::DescriptionBuilder b;
    device::add_device(b, {.name = "x"});
    if (upper) add_gateway_objects(b);
    b.variable(0x2000, {.name = "Speed",
                        .type = od::DataType::unsigned16,
                        .access = upper ? od::Access::rw : od::Access::rww,
                        .mappable = true});
    if (upper) device::add_tpdo(b, 1, {.map = {{{0x2000, 0}, 16}}});
    if (!upper) device::add_rpdo(b, 1, {.map = {{{0x2000, 0}, 16}}});
    return b.build();
  }
  std::unique_ptr<sim::Controller> up, down;
  GatewayDevice gateway;
};

}  // namespace

// S3.3: local control loops stay on their buses. Twenty devices send each other a PDO every 10 ms: on one bus, or on
// two beneath a backbone, to which a gateway of each hands up the one signal that both must know.
TEST(Levels2, LoadOfTheBackbone) {
  struct Loads {
    double backbone, beneath;
    std::uint64_t handed_up = 0;
  };
  const auto load = [](bool levels) {
    sim::World world;
    Line backbone(world, "backbone", 250'000), left(world, "left", 250'000), right(world, "right", 250'000);
    std::vector<std::unique_ptr<Station>> stations;
    for (unsigned i = 0; i < 20; ++i) {
      Line& line = !levels ? backbone : i < 10 ? left : right;
      stations.push_back(std::make_unique<Station>(world, line));
    }
    std::vector<std::unique_ptr<Lifting>> gateways;
    if (levels) {
      gateways.push_back(std::make_unique<Lifting>(world, backbone, left, std::uint8_t{3}));
      gateways.push_back(std::make_unique<Lifting>(world, backbone, right, std::uint8_t{4}));
      world.run_for(50ms);
      Station master(world, backbone);
      master.send("000#0100");
      for (unsigned i = 0; i < 20; i += 10) stations[i]->send("000#0100");
      world.run_for(50ms);
    }
    for (int cycle = 0; cycle < 1000; ++cycle) {
      for (unsigned i = 0; i < 20; ++i) {
        const bool is_first = levels && i % 10 == 0;
        const std::string id = is_first ? "201" : (i < 16 ? "18" : "28") + std::string(1, "0123456789ABCDEF"[i % 16]);
        stations[i]->send(id + "#" + std::string(cycle % 2 == 0 ? "11" : "12") + "22334455667788");
      }
      world.run_for(10ms);
    }
    Loads loads{backbone.bus.load(), std::max(left.bus.load(), right.bus.load())};
    for (const auto& each : gateways) loads.handed_up += each->gateway.signals().figures(0).forwarded;
    return loads;
  };
  const Loads flat = load(false), levels = load(true);
  EXPECT_GT(flat.backbone, 0.9);
  EXPECT_EQ(flat.beneath, 0.0);
  EXPECT_LT(levels.backbone, 0.1);
  EXPECT_LT(levels.beneath, 0.55);
  EXPECT_EQ(levels.handed_up, 2'000U) << "and nothing that both must know is left behind";
}

// S3.37: the objects that the paper asks for, all of them, and none of them in the way of CiA's.
TEST_F(Machine, TheObjectsOfAGateway) {
  const auto& upper = subs[0]->gateway.upper().values().description();
  for (const ObjectRef ref : {ObjectRef{0x5F30, 0}, ObjectRef{0x5F31, 0}, ObjectRef{0x5F32, 0}, ObjectRef{0x5F00, 1},
                              ObjectRef{0x1029, 0xF1}}) {
    EXPECT_NE(upper.find(ref), nullptr) << std::hex << ref.index;
  }
  EXPECT_EQ(upper.find(ObjectRef{0x1018, 5}), nullptr);
  EXPECT_EQ(upper.find(std::uint16_t{0x1F90}), nullptr);
}

// A device and its gateway are switched off and on again, in any order; what was lost is told once, and it ends well.
TEST_F(Machine, PowerCycles) {
  for (int round = 0; round < 3; ++round) {
    subs[0]->master.own_state(NmtState::initialising, NodeId(1));
    subs[0]->gateway.power_off();
    world.run_for(500ms);
    EXPECT_EQ(await(world, at("3/5").read_u32(0x1000, 0)).error().code, Errc::timeout);
    EXPECT_TRUE(await(world, at("4/5").read_u32(0x1000, 0)));
    subs[0]->gateway.power_on();
    world.run_for(3s);
    EXPECT_TRUE(await(world, at("3/5").read_u32(0x1000, 0)));
  }
}

// The routing database of a whole gateway: complete when all sides are operational; late signals are told above, and
// exit.
TEST(GatewayDeviceSignals, CompleteAndLate) {
  sim::World world;
  Line above(world, "above"), beneath(world, "beneath");
  Station master(world, above), worker(world, beneath);
  const auto dictionary = [](bool upper) {
    od::DescriptionBuilder b;
    device::add_device(b, {.name = "x"});
    if (upper) add_gateway_objects(b);
    b.variable(0x2000, {.name = "Lever",
                        .type = od::DataType::unsigned16,
                        .access = upper ? od::Access::rww : od::Access::rw,
                        .mappable = true});
    if (upper) device::add_rpdo(b, 1, {.map = {{{0x2000, 0}, 16}}});
    if (!upper) device::add_tpdo(b, 1, {.map = {{{0x2000, 0}, 16}}, .event_timer_ms = 50});
    if (!upper) device::add_storage(b);
    return b.build();
  };
  const auto up = above.bus.attach({.queue_depth = 64, .rx_depth = 64});
  const auto down = beneath.bus.attach({.queue_depth = 64, .rx_depth = 64});
  GatewayDevice gateway(world.executor(), *up, {.upper = {.node_id = NodeId(3)}, .description = dictionary(true)});
  auto& bus = gateway.add_bus(*down, {.device = {.node_id = NodeId(1)}, .description = dictionary(false)});
  Signal signal{.name = "lever", .source = {0x2000, 0}, .target = {0x2000, 0}, .budget = 2ms};
  signal.stopped = Signal::Stopped::silent;
  EXPECT_TRUE(gateway.set_signals({signal}).empty());
  gateway.signals().set_safe(true);
  gateway.power_on();
  world.run_for(50ms);
  bus.device().values().set({0x1020, 1}, 77U);
  master.send("000#0103");
  world.run_for(50ms);
  EXPECT_FALSE(gateway.signals().forwards(0));  // the bus beneath is not operational
  worker.send("000#0101");
  world.run_for(200ms);
  EXPECT_TRUE(gateway.signals().forwards(0));
  master.send("203#3412");
  world.run_for(100ms);
  EXPECT_GE(std::ranges::count(beneath.log, "181#3412"), 2);
  gateway.signals().set_safe(false);
  beneath.clear();
  world.run_for(200ms);
  EXPECT_TRUE(beneath.log.empty());  // silent, timer and all
  EXPECT_EQ(bus.device().values().get<std::uint32_t>({0x1020, 1}), 77U);
  gateway.signals().set_safe(true);
  world.run_for(50ms);
  down->cable(false);
  above.clear();
  master.send("203#3512");
  world.run_for(100ms);
  EXPECT_EQ(std::ranges::count(above.log, "083#05FF810000000000"), 1);
  down->cable(true);
  world.run_for(2s);
  master.send("203#3612");
  world.run_for(100ms);
  EXPECT_EQ(std::ranges::count(above.log, "083#00000000000005FF"), 1);
}

// The boot-up of a machine from the bottom up, and what fails beneath (paper 3 Figures 1 and 2; docs/multilevel.md
// §Boot-up), with whole devices as masters and slaves.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/multilevel/emcy_gateway.hpp"
#include "berth/multilevel/event_log.hpp"
#include "berth/multilevel/sub_bus.hpp"
#include "berth/network/dictionary_manager.hpp"
#include "tree.hpp"

using namespace berth;
using namespace berth::multilevel;
using namespace berth::multilevel::test;
using Kind = network::NetworkEvent::Kind;

namespace {

constexpr std::uint32_t mandatory_slave = 0x0D;

// A device that is the master of its bus.
struct Master : Station {
  Master(sim::World& world, Line& line, unsigned id, std::vector<unsigned> slaves, std::uint32_t boot_time_ms)
      : Station(world, line),
        device(dispatcher, description(), nullptr,
               {.address = {1, 9, 9, id},
                .node_id = NodeId(static_cast<std::uint8_t>(id)),
                .presets = presets(slaves, boot_time_ms)}),
        manager(dispatcher, device.values(), [this](co::NmtCommand command) { device.apply(command); }) {
    device.on().state = [this, id](NmtState state) { manager.own_state(state, NodeId(static_cast<std::uint8_t>(id))); };
  }
  static std::shared_ptr<const od::Description> description() {
    static const auto made = [] {
      od::DescriptionBuilder b;
      device::add_device(b, {.name = "Master"});
      network::add_manager_objects(b, {.most = 8, .startup = 1, .longest_concise = 100});
      return b.build();
    }();
    return made;
  }
  static std::vector<device::Preset> presets(const std::vector<unsigned>& slaves, std::uint32_t boot_time_ms) {
    std::vector<device::Preset> made{{{0x1F89, 0}, boot_time_ms}};
    for (const unsigned slave : slaves) made.push_back({{0x1F81, static_cast<std::uint8_t>(slave)}, mandatory_slave});
    return made;
  }
  device::Device device;
  network::DictionaryManager manager;
};

// Backbone with master 100 and gateway 3; beneath it master 1 with slaves 5 and 6.
struct Boot : ::testing::Test {
  void build(bool mandatory, bool complete) {
    lower.emplace(world, beneath, 1, std::vector<unsigned>{5, 6}, 500U);
    five.emplace(world, beneath, 5);
    if (complete) six.emplace(world, beneath, 6);
    up.emplace(world, above);
    upper.emplace(up->dispatcher, gateway_description(), nullptr,
                  device::Options{.address = {1, 1, 1, 3},
                                  .node_id = NodeId(3),
                                  .presets = {{{0x5F00, 1}, mandatory ? 1U : 0U}, {{0x1017, 0}, 100}}});
    emcy.emplace(upper->errors().emcy(), EmcyGatewayOptions{});
    emcy->hear_all(lower->dispatcher);
    bus.emplace(world.executor(), *emcy, [this](co::NmtCommand command) { upper->apply(command); });
    bus->on_settled([this] {
      settled_at = world.now();
      upper->power_on();
    });
    upper->on().state = [this](NmtState state) {
      bus->set_mandatory(is_mandatory(upper->values(), 1));
      bus->own_state(state);
    };
    lower->manager.network().observe([this](const network::NetworkEvent& event) {
      if (event.kind == Kind::operational) bus->booted();
      if (event.kind == Kind::halted) bus->failed(event.node);
    });
    system.emplace(world, above, 100, std::vector<unsigned>{3}, 0U);
    system->manager.network().observe([this](const network::NetworkEvent& event) { events.push_back(event); });
    log.emplace(system->dispatcher, EmcyLayout::source_and_exit);
    log->hear_all();
    system->device.power_on();
    lower->device.power_on();
  }
  ~Boot() override {
    log.reset();
    bus.reset();
    emcy.reset();
  }
  static std::shared_ptr<const od::Description> gateway_description() {
    od::DescriptionBuilder b;
    device::add_device(b, {.name = "Gateway"});
    add_sub_buses(b);
    return b.build();
  }
  // NMT, EMCY and error control of the gateway, in their order.
  [[nodiscard]] Log story() const {
    Log found;
    for (const auto& frame : above.log) {
      const bool told = frame.starts_with("000#01") || frame.starts_with("083#") || frame.starts_with("703#");
      if (told && (found.empty() || found.back() != frame)) found.push_back(frame);
    }
    return found;
  }
  sim::World world;
  Line above{world, "above"};
  Line beneath{world, "beneath"};
  std::optional<Master> lower;
  std::optional<Leaf> five, six;
  std::optional<Station> up;
  std::optional<device::Device> upper;
  std::optional<EmcyGateway> emcy;
  std::optional<SubBus> bus;
  std::optional<Master> system;
  std::optional<EventLog> log;
  std::vector<network::NetworkEvent> events;
  rt::Time settled_at{};
};

}  // namespace

// S3.4: the bus beneath first, and the backbone behind it; both by the boot-up of CiA 302-2. S3.5: each has its own
// master.
TEST_F(Boot, FromTheBottomUp) {
  build(true, true);
  world.run_for(5s);
  EXPECT_EQ(lower->device.state(), NmtState::operational);
  EXPECT_EQ(system->device.state(), NmtState::operational);
  EXPECT_EQ(upper->state(), NmtState::operational);
  for (const char* answer : {"585#4300100092010200", "586#4300100092010200"}) {
    EXPECT_LT(beneath.when(answer), above.when("703#00"));
  }
  EXPECT_NE(beneath.when("000#0106"), rt::never);
  EXPECT_EQ(story(), (Log{"703#00", "000#0103", "703#05"}));
  EXPECT_TRUE(bus->settled());
  EXPECT_EQ(log->count(), 0U);
}

// S3.7, S3.9, Figure 1: a mandatory slave beneath is missing, and the bus beneath is mandatory: its gateway is
// operational only while its EMCY goes out, then stopped.
TEST_F(Boot, MandatoryBusFails) {
  build(true, false);
  world.run_for(5s);
  EXPECT_GE(settled_at - rt::Time{}, 500ms);  // 1F89h of the bus beneath
  EXPECT_EQ(upper->state(), NmtState::stopped);
  EXPECT_EQ(story(), (Log{"703#00", "000#0103", "083#01FF810600000000", "703#04"}));
  ASSERT_EQ(log->count(), 1U);
  EXPECT_EQ(text(log->entries()[0], [](std::uint16_t, std::uint16_t) { return "?"; }),
            "3/6: FF01h a mandatory bus beneath has not booted");
}

// S3.8, Figure 2: the bus beneath is optional: the gateway becomes operational, and then tells.
TEST_F(Boot, OptionalBusFails) {
  build(false, false);
  world.run_for(5s);
  EXPECT_EQ(upper->state(), NmtState::operational);
  EXPECT_EQ(story(), (Log{"703#00", "000#0103", "083#02FF810600000000", "703#05"}));
  EXPECT_EQ(system->device.state(), NmtState::operational);
}

// The missing slave comes after all: the error exits, and names its code.
TEST_F(Boot, TheBusBootsAfterAll) {
  build(false, false);
  world.run_for(3s);
  six.emplace(world, beneath, 6);
  lower->device.apply(co::NmtCommand::reset_node);
  world.run_for(3s);
  EXPECT_EQ(lower->device.state(), NmtState::operational);
  ASSERT_EQ(log->count(), 2U);
  EXPECT_EQ(log->entries()[1].reading.exiting, gateway_code::optional_bus_failed);
  EXPECT_TRUE(log->pending(log->entries()[0].reading.path).empty());
}

// A mandatory bus that has booted after all: the master above starts the gateway again, and it stays operational.
TEST_F(Boot, TheMandatoryBusBootsAfterAll) {
  build(true, false);
  world.run_for(3s);
  ASSERT_EQ(upper->state(), NmtState::stopped);
  six.emplace(world, beneath, 6);
  lower->device.apply(co::NmtCommand::reset_node);
  world.run_for(3s);
  EXPECT_EQ(upper->state(), NmtState::stopped);
  system->send("000#0103");
  world.run_for(1s);
  EXPECT_EQ(upper->state(), NmtState::operational);
  EXPECT_EQ(log->entries().back().reading.exiting, gateway_code::mandatory_bus_failed);
}

// It fails while the machine runs: told at once, by the object's value of now.
TEST_F(Boot, FailsWhileItRuns) {
  build(false, true);
  world.run_for(3s);
  ASSERT_EQ(upper->state(), NmtState::operational);
  bus->set_mandatory(true);
  bus->failed(NodeId(5));
  world.run_for(100ms);
  EXPECT_EQ(upper->state(), NmtState::stopped);
  EXPECT_EQ(log->entries().back().reading.code, gateway_code::mandatory_bus_failed);
}

// S3.12: the loss of a heartbeat beneath changes the state above by 1029h:F1h, behind its EMCY; 1 = not at all.
TEST_F(Boot, AHeartbeatBeneathAndTheStateAbove) {
  build(false, true);
  bus->on_heartbeat_lost([this] { upper->errors().behave(heartbeat_error_class(1)); });
  world.run_for(3s);
  struct Row {
    std::uint8_t value;
    NmtState state;
  };
  for (const auto& row :
       {Row{1, NmtState::operational}, Row{0, NmtState::pre_operational}, Row{2, NmtState::stopped}}) {
    system->send("000#0103");
    world.run_for(50ms);
    upper->values().set<std::uint8_t>({0x1029, heartbeat_error_class(1)}, row.value);
    const auto before = log->count();
    bus->heartbeat({.kind = co::HeartbeatEvent::Kind::lost, .node = NodeId(5)});
    world.run_for(50ms);
    EXPECT_EQ(upper->state(), row.state) << int{row.value};
    EXPECT_EQ(log->count(), before + 1);
    bus->heartbeat({.kind = co::HeartbeatEvent::Kind::recovered, .node = NodeId(5)});
    world.run_for(50ms);
  }
}

// S3.9, S3.37: the objects.
TEST_F(Boot, TheObjects) {
  build(true, true);
  EXPECT_TRUE(is_mandatory(upper->values(), 1));
  EXPECT_FALSE(is_mandatory(upper->values(), 2));
  upper->values().set<std::uint8_t>({0x5F00, 1}, 0);
  EXPECT_FALSE(is_mandatory(upper->values(), 1));
  const std::uint8_t two = 2;
  EXPECT_EQ(upper->values().write({0x5F00, 1}, {&two, 1}), od::AbortCode::value_too_high);
  EXPECT_EQ(upper->values().get<std::uint8_t>({0x1029, 0xF1}), 1);
}

// S3.4: the boot time of a bus must contain that of the buses beneath, which boot side by side.
TEST(BootTimes, AreLongEnough) {
  const BootNeed lowest{.name = "tool", .own = 800ms, .boot_time = 1s};
  const BootNeed left{.name = "left", .own = 400ms, .boot_time = 1s, .beneath = {lowest}};
  const BootNeed right{.name = "right", .own = 1500ms, .boot_time = 1600ms};
  BootNeed backbone{.name = "backbone", .own = 300ms, .boot_time = 1700ms, .beneath = {left, right}};
  EXPECT_EQ(net_boot_time(lowest), 800ms);
  EXPECT_EQ(net_boot_time(left), 1200ms);
  EXPECT_EQ(net_boot_time(backbone), 1800ms);
  const auto wrong = short_boot_times(backbone);
  ASSERT_EQ(wrong.size(), 2U);
  EXPECT_EQ(wrong[0].name, "backbone");
  EXPECT_EQ(wrong[0].needed, 1800ms);
  EXPECT_EQ(wrong[1].name, "left");
  EXPECT_EQ(wrong[1].needed, 1200ms);
  backbone.boot_time = 0ms;
  EXPECT_EQ(short_boot_times(backbone).size(), 1U);
}

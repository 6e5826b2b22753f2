// The numeric hardware version, checked at boot-up (docs/multilevel.md §Hardware version).
#include <gtest/gtest.h>
#include <memory>
#include <optional>
#include <vector>

#include "berth/multilevel/hardware_version.hpp"
#include "berth/network/managed_bus.hpp"
#include "berth/network/network_boot.hpp"
#include "tree.hpp"

using namespace berth;
using namespace berth::multilevel;
using namespace berth::multilevel::test;

namespace {

// A slave with a hardware version, and where the paper has it, too.
struct Versioned : Station {
  Versioned(sim::World& world, Line& line, std::uint32_t version)
      : Station(world, line), device(dispatcher, description(version), nullptr, {.node_id = NodeId(5)}) {
    device.power_on();
  }
  static std::shared_ptr<const od::Description> description(std::uint32_t version) {
    od::DescriptionBuilder b;
    device::add_device(b, {.name = "Slave"});
    add_hardware_version(b, version);
    b.sub(0x1018, {.sub = 5, .name = "Hardware version", .initial = od::Literal::number(version + 1)});
    return b.build();
  }
  device::Device device;
};

// What a master does before it configures.
struct Checked final : network::BootSource {
  Checked(const od::Values& own, NodeId of) : values(&own), node(of) {}
  rt::Task<Result<void>> configure(network::BootTarget& target, manager::SlaveRules&) override {
    const auto expected = expected_hardware(*values, node);
    const auto done = co_await check_hardware(target.objects(), expected);
    co_return done;
  }
  const od::Values* values;
  NodeId node;
};

}  // namespace

// S3.10: read and compared; anything goes where nothing is expected; the paper's own place on request.
TEST(HardwareVersion, IsCompared) {
  sim::World world;
  Line line(world, "bus");
  Versioned slave(world, line, 0x0102'0003);
  Station master(world, line);
  co::SdoClient client(master.dispatcher);
  co::NodeAccess access(client, NodeId(5));
  world.run_for(50ms);
  EXPECT_TRUE(await(world, check_hardware(access, 0x0102'0003)));
  const auto wrong = await(world, check_hardware(access, 0x0102'0004));
  ASSERT_FALSE(wrong);
  EXPECT_EQ(wrong.error().code, Errc::mismatch);
  EXPECT_EQ(wrong.error().detail, 0x0102'0003U);
  EXPECT_TRUE(await(world, check_hardware(access, 0x0102'0004, true)));
  line.clear();
  EXPECT_TRUE(await(world, check_hardware(access, 0)));
  EXPECT_TRUE(line.log.empty());
  slave.device.power_off();
  EXPECT_EQ(await(world, check_hardware(access, 1)).error().code, Errc::timeout);
}

// S3.10: at boot-up: a slave of the wrong version is not started, one of the right version is.
TEST(HardwareVersion, IsCheckedAtBoot) {
  for (const bool right : {true, false}) {
    sim::World world;
    Line line(world, "bus");
    Versioned slave(world, line, 7);
    Station station(world, line);
    od::DescriptionBuilder b;
    add_expected_hardware(b, 8);
    od::Values own(b.build(), NodeId(100));
    own.set({0x5F02, 5}, right ? 7U : 8U);
    network::ManagedBus bus(station.dispatcher);
    network::NetworkBoot network(world.executor(), bus);
    bus.lead_to(&network.error_control());
    bus.on_apply([&](co::NmtCommand) { network.own_state(NmtState::operational); });
    Checked source(own, NodeId(5));
    network::NetworkPlan plan;
    plan.startup = *manager::startup_of(std::uint32_t{1});
    plan.own = NodeId(100);
    plan.slaves.push_back(
        {NodeId(5), {.assigned = true, .boots = true, .mandatory = true}, &bus.target(NodeId(5)), &source});
    ASSERT_TRUE(network.begin(plan));
    world.run_for(3s);
    EXPECT_EQ(slave.device.state(), right ? NmtState::operational : NmtState::pre_operational);
    EXPECT_EQ(network.find(NodeId(5))->phase, right ? network::SlavePhase::started : network::SlavePhase::failed);
    network.end();
  }
}

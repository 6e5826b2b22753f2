// Links across gateways, in one simulated machine (examples/signals): Berth has the backbone alone, plans the links,
// configures devices, gateways and the gateways' own nodes, and the values arrive through one gateway and through two.
#include "tests/harvester/signals.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>

#include "../pch.hpp"
#include "berth/co/emcy.hpp"
#include "berth/eds/write.hpp"

namespace berth::test {
namespace {

struct Signals : ::testing::Test, SignalMachine {
  Signals() { EXPECT_TRUE(up()) << log(); }
};

}  // namespace

// Each change arrives within the bound that the plan gives, which is within the link's deadline.
TEST_F(Signals, ValuesArriveThroughOneGatewayAndThroughTwoWithinTheBound) {
  ASSERT_EQ(links.plan.crossings.size(), 3U);
  rt::Duration bound{};
  for (const auto& each : links.plan.crossings) {
    ASSERT_TRUE(each.worst && each.deadline);
    EXPECT_LE(*each.worst, *each.deadline);
    if (each.gateways.size() == 2) bound = *each.worst;
  }
  ASSERT_GT(bound, 0ms);
  std::int16_t torque = 100;
  for (int i = 0; i < 20; ++i) {
    ++torque;
    measure<std::int16_t>("torque sensor", {0x7100, 0}, torque);
    const auto at = world->executor().now();
    ASSERT_TRUE(run_until(
        [&] {
          return value<std::int16_t>("engine", {0x2002, 0}) == torque;
        },
        1s))
        << i << "\n"
        << log();
    EXPECT_LE(world->executor().now() - at, bound);
    EXPECT_EQ(value<std::int16_t>("front motor", {0x6042, 0}), torque);
    world->sim().run_for(7ms * i);
  }
  measure<std::uint16_t>("engine", {0x2001, 0}, std::uint16_t{1800});
  ASSERT_TRUE(run_until([&] { return value<std::uint16_t>("rear motor", {0x6040, 0}) == 1800; }, 50ms)) << log();
}

// A sensor that is silent ends what the gateways send of it, so that each consumer's RPDO deadline tells it (8250h),
// and what else goes through the left gateway goes on.
TEST_F(Signals, ASilentProducerIsToldByItsConsumers) {
  measure<std::int16_t>("torque sensor", {0x7100, 0}, std::int16_t{7});
  world->sim().run_for(1s);
  const auto misses = [&](const std::string& name) {
    return (value<std::uint8_t>(name, {0x1001, 0}) & co::error_register::communication) != 0;
  };
  EXPECT_FALSE(misses("engine")) << "a producer that runs is no error";
  EXPECT_FALSE(misses("front motor"));
  world->find("torque sensor")->power(false);
  EXPECT_TRUE(run_until([&] { return misses("engine") && misses("front motor"); }, 5s)) << log();
  EXPECT_FALSE(misses("rear motor")) << "what comes from the engine goes on";
  EXPECT_NE(log().find("front motor: EMCY 3/2: 8250h"), std::string::npos) << log();
  measure<std::uint16_t>("engine", {0x2001, 0}, std::uint16_t{900});
  EXPECT_TRUE(run_until([&] { return value<std::uint16_t>("rear motor", {0x6040, 0}) == 900; }, 1s)) << log();
}

// The descriptions of the example are those of the plant's gateways. BERTH_WRITE_EDS=1 writes them.
TEST(SignalExample, DescriptionsOfTheGateways) {
  const auto plant = plant::load_plant(signals_file("plant.toml"));
  ASSERT_TRUE(plant.plant);
  const std::pair<const char*, const char*> files[] = {{"left gateway", "gateway.eds"}, {"left port", "port.eds"}};
  for (const auto& [name, file_name] : files) {
    const auto& device = *plant.plant->device(name);
    plant::Descriptions descriptions;
    Findings findings;
    const auto* const described = descriptions.of(device, findings, plant.plant->gateway_part(name));
    ASSERT_NE(described, nullptr);
    eds::File file;
    file.description = described->description;
    file.info.file_name = file_name;
    file.info.description = "A gateway of a plant file, with room for 4 signals";
    file.device.vendor_name = "Berth";
    file.device.product_name = name == std::string("left gateway") ? "Gateway" : "Gateway's own node beneath";
    file.device.vendor_number = device.address.vendor;
    file.device.product_number = device.address.product;
    file.device.revision_number = device.address.revision;
    file.device.baud_rates = {125, 250, 500, 1000};
    file.device.granularity = 8;
    file.device.rpdos = file.device.tpdos = 4;
    file.device.lss = true;
    const auto text = eds::write(file, {.line_end = "\n"}).text;
    const auto path = signals_file(std::string("eds/") + file_name);
    if (std::getenv("BERTH_WRITE_EDS") != nullptr) std::ofstream(path) << text;
    std::ifstream stream(path);
    const std::string there{std::istreambuf_iterator<char>(stream), {}};
    EXPECT_EQ(there, text) << path;
  }
}

}  // namespace berth::test

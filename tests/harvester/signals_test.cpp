// Links across gateways, in one simulated machine (examples/signals): Berth has the backbone alone, plans the links,
// configures devices, gateways and the gateways' own nodes, and the values arrive through one gateway and through two.
#include <gtest/gtest.h>

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>

#include "../pch.hpp"
#include "berth/co/emcy.hpp"
#include "berth/command/link_network.hpp"
#include "berth/design/machine.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/eds/write.hpp"
#include "berth/operate/session.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"
#include "tests/paths.hpp"

namespace berth::test {
namespace {

using namespace std::chrono_literals;

std::string signals_file(const std::string& name) { return source_dir() + "/examples/signals/" + name; }

std::string lines_of(const Findings& findings) {
  std::string text;
  for (const auto& each : findings) text += to_string(each) + "\n";
  return text;
}

struct Signalled : ::testing::Test {
  void bring_up(const std::string& machine_file, const std::string& plant_file) {
    auto read = design::load_machine(machine_file);
    auto plant = plant::load_plant(plant_file);
    EXPECT_TRUE(read.machine && plant.plant) << lines_of(read.findings) << lines_of(plant.findings);
    if (!read.machine || !plant.plant) return;
    machine = std::move(*read.machine);
    links = command::plan_links(machine);
    EXPECT_FALSE(has_errors(links.findings)) << lines_of(links.findings);
    Findings findings;
    std::vector<plant::BusRate> rates;
    for (const auto* const bus : machine.all_buses()) rates.push_back({bus->name, bus->bitrate});
    world = plant::World::make(*plant.plant, rates, findings);
    EXPECT_TRUE(world) << lines_of(findings);
    if (!world) return;
    port = world->attach_master("backbone");
    world->start();
    session = std::make_unique<operate::Session>(world->executor(), machine, store);
    EXPECT_TRUE(session->connect("backbone", *port));
    session->configure_with(command::settings_of(links));
    EXPECT_TRUE(session->open());
    session->start();
    EXPECT_TRUE(run_until([&] { return session->operational(); }, 60s)) << log();
    world->sim().run_for(1s);
  }
  ~Signalled() override {
    session.reset();
    port.reset();
  }
  bool run_until(const std::function<bool()>& over, rt::Duration limit) { return world->sim().run_until(over, limit); }
  device::Device& device(const std::string& name) { return world->find(name)->device(); }
  template <class T>
  T value(const std::string& name, ObjectRef object) {
    return device(name).values().get_or<T>(object, T{});
  }
  /// Its application has another value.
  template <class T>
  void measure(const std::string& name, ObjectRef object, T now) {
    ASSERT_EQ(device(name).values().set<T>(object, now), od::AbortCode::none);
    device(name).services().changed(object);
  }
  std::string log() {
    std::string text;
    for (const auto& each : session->report().events) text += operate::to_line(each) + "\n";
    return text;
  }
  design::Machine machine;
  command::LinkPlan links;
  places::MemoryStore store;
  std::unique_ptr<plant::World> world;
  std::unique_ptr<can::Port> port;
  std::unique_ptr<operate::Session> session;
};

struct SignalMachine : Signalled {
  SignalMachine() { bring_up(signals_file("machine.toml"), signals_file("plant.toml")); }
};

// ---- many signals through a gateway two levels down

constexpr unsigned many = 12;

void write_description(const std::string& path, const std::shared_ptr<const od::Description>& description,
                       std::uint32_t product, std::uint16_t pdos) {
  eds::File file;
  file.description = description;
  file.info.file_name = std::filesystem::path(path).filename();
  file.device.vendor_name = "test";
  file.device.product_name = file.info.file_name;
  file.device.vendor_number = 1;
  file.device.product_number = product;
  file.device.revision_number = 0;
  file.device.baud_rates = {125, 250};
  file.device.granularity = 8;
  file.device.rpdos = file.device.tpdos = pdos;
  file.device.lss = true;
  std::ofstream(path) << eds::write(file, {.line_end = "\n"}).text;
}

// A source on the reel's bus, a sink on the one above.
std::shared_ptr<const od::Description> end_of_links(bool source) {
  od::DescriptionBuilder b;
  device::add_device(b, {.name = source ? "Source" : "Sink"});
  const std::uint16_t index = source ? 0x2100 : 0x2200;
  b.object(index, od::ObjectCode::array, "Values");
  for (std::uint8_t sub = 1; sub <= many; ++sub) {
    b.sub(index, {.sub = sub,
                  .name = "Value",
                  .type = od::DataType::unsigned8,
                  .access = source ? od::Access::ro : od::Access::rww,
                  .mappable = true});
  }
  for (unsigned number = 1; number <= 2; ++number) {
    if (source) device::add_tpdo(b, number, {});
    if (!source) device::add_rpdo(b, number, {});
  }
  return b.build();
}

struct ManySignals : Signalled {
  ManySignals() : folder(std::filesystem::temp_directory_path() / ("berth-signals-" + std::to_string(getpid()))) {
    std::filesystem::create_directories(folder);
    std::ofstream(file("plant.toml")) << plant_text;
    const auto plant = plant::load_plant(file("plant.toml"));
    EXPECT_TRUE(plant.plant) << lines_of(plant.findings);
    plant::Descriptions descriptions;
    Findings findings;
    for (const auto& [name, product] : {std::pair{"left gateway", 0x5AU}, std::pair{"left port", 0x5BU}}) {
      const auto* const described =
          descriptions.of(*plant.plant->device(name), findings, plant.plant->gateway_part(name));
      write_description(file(product == 0x5A ? "gateway.eds" : "port.eds"), described->description, product, 4);
    }
    write_description(file("source.eds"), end_of_links(true), 0x60, 2);
    write_description(file("sink.eds"), end_of_links(false), 0x61, 2);
    std::string text = machine_text;
    for (unsigned i = 1; i <= many; ++i) {
      text += fmt::format("[[link]]\nfrom = \"source/2100h:{0:02X}\"\nto = [\"sink/2200h:{0:02X}\"]\n", i);
    }
    std::ofstream(file("machine.toml")) << text;
  }
  ~ManySignals() override { std::filesystem::remove_all(folder); }
  std::string file(const std::string& name) const { return (folder / name).string(); }
  std::filesystem::path folder;

  static constexpr const char* plant_text = R"(
[bus.backbone]
[bus.left]
[bus.reel]
[[device]]
bus = "backbone"
name = "left gateway"
type = { vendor = 1, product = 0x5A }
serial = 1
[[device]]
bus = "left"
name = "left port"
type = { vendor = 1, product = 0x5B }
serial = 2
node_id = 1
source = "hard-coded"
master = { flying = false, most = 20 }
[[device]]
bus = "left"
name = "sink"
eds = "sink.eds"
serial = 3
[[device]]
bus = "left"
name = "reel gateway"
type = { vendor = 1, product = 0x5A }
serial = 4
[[device]]
bus = "reel"
name = "reel port"
type = { vendor = 1, product = 0x5B }
serial = 5
node_id = 1
source = "hard-coded"
master = { flying = false, most = 20 }
[[device]]
bus = "reel"
name = "source"
eds = "source.eds"
serial = 6
[[gateway]]
above = "left gateway"
beneath = ["left port"]
signals = 12
speaks_layout = [3]
[[gateway]]
above = "reel gateway"
beneath = ["reel port"]
signals = 12
)";
  static constexpr const char* machine_text = R"(
[machine]
name = "many signals"
[bus.backbone]
port = "sim"
bitrate = 250_000
[bus.left]
port = "gateway"
bitrate = 250_000
master_id = 1
gateway = { bus = "backbone", slot = 3, eds = "port.eds" }
[bus.reel]
port = "gateway"
bitrate = 125_000
master_id = 1
gateway = { bus = "left", slot = 3, eds = "port.eds" }
[[slot]]
bus = "backbone"
id = 3
name = "left gateway"
eds = "gateway.eds"
replacement = "auto"
mandatory = true
[[slot]]
bus = "left"
id = 2
name = "sink"
eds = "sink.eds"
replacement = "auto"
mandatory = true
[[slot]]
bus = "left"
id = 3
name = "reel gateway"
eds = "gateway.eds"
replacement = "auto"
mandatory = true
[[slot]]
bus = "reel"
id = 2
name = "source"
eds = "source.eds"
replacement = "auto"
mandatory = true
)";
};

}  // namespace

// The rows for twelve signals and their PDOs take more than 250 bytes of the left master's 1F22h:03.
TEST_F(ManySignals, ThroughAGatewayTwoLevelsDown) {
  ASSERT_FALSE(HasFailure());
  bring_up(file("machine.toml"), file("plant.toml"));
  const auto row = device("left port").values().bytes({0x1F22, 3});
  EXPECT_GT(row.size(), 250U);
  for (std::uint8_t round = 1; round <= 3; ++round) {
    for (std::uint8_t sub = 1; sub <= many; ++sub) {
      measure<std::uint8_t>("source", {0x2100, sub}, static_cast<std::uint8_t>(20 * round + sub));
    }
    const auto arrived = [&] {
      unsigned count = 0;
      for (std::uint8_t sub = 1; sub <= many; ++sub) {
        count += value<std::uint8_t>("sink", {0x2200, sub}) == 20 * round + sub ? 1U : 0U;
      }
      return count == many;
    };
    EXPECT_TRUE(run_until(arrived, 1s)) << round << "\n" << log();
  }
  // It is saved: the gateway and its bus come back by themselves.
  world->find("left gateway")->power(false);
  ASSERT_TRUE(run_until([&] { return !session->operational(); }, 30s)) << log();
  world->find("left gateway")->power(true);
  EXPECT_TRUE(run_until([&] { return session->operational(); }, 60s)) << log();
  const auto after = device("left port").values().bytes({0x1F22, 3});
  EXPECT_EQ(after.size(), row.size());
}

// Each change arrives within the bound that the plan gives, which is within the link's deadline.
TEST_F(SignalMachine, ValuesArriveThroughOneGatewayAndThroughTwoWithinTheBound) {
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
TEST_F(SignalMachine, ASilentProducerIsToldByItsConsumers) {
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

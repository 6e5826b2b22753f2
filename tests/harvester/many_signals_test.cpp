// Twelve signals through a gateway two levels down: what it needs is brought there whole.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

#include "../pch.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/eds/write.hpp"
#include "tests/harvester/signals.hpp"

namespace berth::test {
namespace {

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

/// The machine's files, in a folder of their own.
struct ManyFiles {
  ManyFiles() : folder(std::filesystem::temp_directory_path() / ("berth-signals-" + std::to_string(getpid()))) {
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
  ~ManyFiles() { std::filesystem::remove_all(folder); }
  ManyFiles(const ManyFiles&) = delete;
  ManyFiles& operator=(const ManyFiles&) = delete;
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

struct ManySignals : ::testing::Test, ManyFiles, SignalMachine {
  ManySignals() : SignalMachine(file("machine.toml"), file("plant.toml")) { EXPECT_TRUE(up()) << log(); }
};

}  // namespace

// The rows for twelve signals and their PDOs take more than 250 bytes of the left master's 1F22h:03.
TEST_F(ManySignals, ThroughAGatewayTwoLevelsDown) {
  ASSERT_FALSE(HasFailure());
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

}  // namespace berth::test

// The harvester (examples/harvester) as a machine of processes on a kernel's CAN: an interface for each of its buses, a
// process for each of its gateways, one for all other devices, and Berth, which has the backbone's interface alone. Of
// its 62 devices and five buses seven and four are left here, among them every kind of gateway: all of them take some
// three minutes in an emulated machine.
#include <gtest/gtest.h>
#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "../paths.hpp"
#include "interface.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using Words = std::vector<std::string>;

const std::set<std::string> kept{"engine",       "left gateway", "header gateway", "left front motor", "knife motor",
                                 "reel gateway", "reel motor",   "left port",      "header port",      "reel port"};

/// The tables of a file of the example, apart from those of slots and devices that are not kept, and of the bus that
/// has none then.
std::string cut(const std::string& file) {
  const std::string folder = source_dir() + "/examples/harvester/";
  std::istringstream lines(read_whole(folder + file));
  std::vector<std::string> tables(1);
  for (std::string line; std::getline(lines, line); tables.back() += line + "\n") {
    if (line.starts_with('[')) tables.emplace_back();
  }
  std::string made;
  for (auto& table : tables) {
    std::string name;
    for (const std::string_view key : {"name ", "above "}) {
      const auto at = table.find("\n" + std::string(key));
      if (at == std::string::npos) continue;
      const auto quote = table.find('"', at);
      name = table.substr(quote + 1, table.find('"', quote + 1) - quote - 1);
    }
    const bool counts = table.starts_with("[[") ? kept.contains(name) : !table.starts_with("[bus.right]");
    if (!counts) continue;
    // Its values are of slots that are not kept, too.
    const auto watch = table.find("\nwatch = [");
    if (watch != std::string::npos) table.erase(watch, table.find("]\n", watch) + 1 - watch);
    made += table;
  }
  return made;
}

struct GatewayProcess {
  const char* device;
  const char* above;
  const char* beneath;
};
constexpr std::array gateways{GatewayProcess{"left gateway", "backbone", "left"},
                              GatewayProcess{"header gateway", "backbone", "header"},
                              GatewayProcess{"reel gateway", "header", "reel"}};
constexpr std::array buses{"backbone", "left", "header", "reel"};

/// An interface's name has 15 letters at most.
std::string port(const std::string& bus) { return bus + "=socketcan:hv" + bus; }

class HarvesterProcesses : public testing::Test {
 protected:
  void SetUp() override {
    if (const auto why = no_interface("vcan0"); !why.empty()) GTEST_SKIP() << "needs vm: " << why;
    for (const char* const folder : {"eds", "scripts"})
      std::filesystem::copy(source_dir() + "/examples/harvester/" + folder, place.file(folder));
    machine = place.write("machine.toml", cut("machine.toml"));
    plant = place.write("plant.toml", cut("plant.toml"));
    Words others{"device", plant, "--json"};
    for (const char* const bus : buses) {
      interfaces.push_back(std::make_unique<Vcan>(std::string("hv") + bus));
      others.insert(others.end(), {"--port", port(bus)});
    }
    for (const auto& gateway : gateways) others.insert(others.end(), {"--except", gateway.device});
    processes["others"] = std::make_unique<Running>(place, "others", others);
    for (const auto& gateway : gateways) start(gateway);
    up = std::make_unique<Running>(place, "up",
                                   Words{"up", machine, "--port", "socketcan:hvbackbone", "--yes", "--store",
                                         place.file("slots.db"), "--control", place.file("control")});
  }
  void TearDown() override {
    if (!HasFailure() || !up) return;
    std::printf("---- up\n%s%s", up->out().c_str(), up->err().c_str());
    for (const auto& [name, process] : processes) {
      std::printf("---- %s\n%s%s", name.c_str(), process->out().c_str(), process->err().c_str());
    }
  }
  /// What the gateway stores outlives its process.
  void start(const GatewayProcess& gateway) {
    const std::string name = gateway.device;
    processes[name] =
        std::make_unique<Running>(place, name,
                                  Words{"device", plant, "--device", name, "--port", port(gateway.above), "--port",
                                        port(gateway.beneath), "--sim-state", place.file(name + ".state"), "--json"});
  }
  /// How often `berth up` has said it.
  [[nodiscard]] long said(const std::string& text) const {
    std::istringstream lines(up->out());
    long count = 0;
    for (std::string line; std::getline(lines, line);) count += line.find(text) != std::string::npos ? 1 : 0;
    return count;
  }

  std::vector<std::unique_ptr<Vcan>> interfaces;
  Place place;
  std::string machine, plant;
  std::map<std::string, std::unique_ptr<Running>> processes;
  std::unique_ptr<Running> up;
};

TEST_F(HarvesterProcesses, FromBlankToOperationalAndAGatewayProcessIsKilledAndStartedAgain) {
  ASSERT_TRUE(up->says("backbone  operational"));
  for (const char* const slot : {"left front motor", "knife motor", "reel motor", "reel gateway", "engine"}) {
    EXPECT_EQ(said(std::string(slot) + ": operational"), 1) << slot;
  }
  EXPECT_EQ(said("left gateway: absent"), 0);
  // An emulated machine that does much else may miss a heartbeat while they come up.
  constexpr std::array others{"knife motor", "reel motor", "reel gateway", "header gateway"};
  std::map<std::string, long> before;
  for (const char* const slot : others) before[slot] = said(std::string(slot) + ": absent");
  processes.at("left gateway")->kill();
  ASSERT_TRUE(up->says("left gateway: absent"));
  ASSERT_TRUE(up->says("left front motor: absent"));
  start(gateways[0]);
  ASSERT_TRUE(eventually([&] { return said("left front motor: operational") == 2; }));
  ASSERT_TRUE(eventually([&] { return said("left gateway: operational") == 2; }));
  EXPECT_EQ(said("left gateway: absent"), 1);
  EXPECT_EQ(said("left front motor: absent"), 1);
  for (const char* const slot : others) {
    EXPECT_EQ(said(std::string(slot) + ": absent"), before.at(slot)) << slot << " runs on";
  }
  up->signal(SIGTERM);
  EXPECT_EQ(up->wait(), 0);
}

}  // namespace
}  // namespace berth::test

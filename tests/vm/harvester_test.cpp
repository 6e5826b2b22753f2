// The harvester (examples/harvester) as a machine of processes on a kernel's CAN: an interface for each of its buses, a
// process for each of its gateways, one for all other devices, and Berth, which has the backbone's interface alone.
#include <gtest/gtest.h>
#include <array>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "../paths.hpp"
#include "interface.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

const std::string harvester = berth::test::source_dir() + "/examples/harvester/";
using Words = std::vector<std::string>;

struct GatewayProcess {
  const char* device;
  const char* above;
  const char* beneath;
};
constexpr std::array gateways{
    GatewayProcess{"left gateway", "backbone", "left"}, GatewayProcess{"right gateway", "backbone", "right"},
    GatewayProcess{"header gateway", "backbone", "header"}, GatewayProcess{"reel gateway", "header", "reel"}};
/// "hv" and the bus's name is an interface: 15 letters at most.
std::string port(const std::string& bus) { return bus + "=socketcan:hv" + bus; }

class HarvesterProcesses : public testing::Test {
 protected:
  void SetUp() override {
    if (const auto why = no_interface("vcan0"); !why.empty()) GTEST_SKIP() << "needs vm: " << why;
    Words others{"device", harvester + "plant.toml", "--json"};
    for (const char* const bus : {"backbone", "left", "right", "header", "reel"}) {
      interfaces.push_back(std::make_unique<Vcan>(std::string("hv") + bus));
      others.insert(others.end(), {"--port", port(bus)});
    }
    for (const auto& gateway : gateways) others.insert(others.end(), {"--except", gateway.device});
    processes["others"] = std::make_unique<Running>(place, "others", others);
    for (const auto& gateway : gateways) start(gateway);
    up = std::make_unique<Running>(place, "up",
                                   Words{"up", harvester + "machine.toml", "--port", "socketcan:hvbackbone", "--yes",
                                         "--store", place.file("slots.db"), "--control", place.file("control")});
  }
  void TearDown() override {
    if (!HasFailure()) return;
    std::printf("---- up\n%s%s", up->out().c_str(), up->err().c_str());
    for (const auto& [name, process] : processes) {
      std::printf("---- %s\n%s%s", name.c_str(), process->out().c_str(), process->err().c_str());
    }
  }
  void start(const GatewayProcess& gateway) {
    const std::string name = gateway.device;
    processes[name] = std::make_unique<Running>(
        place, name,
        Words{"device", harvester + "plant.toml", "--device", name, "--port", port(gateway.above), "--port",
              port(gateway.beneath), "--sim-state", place.file(name + ".state"), "--json"});
  }
  /// The state of each slot, as the running `berth up` reports it.
  std::map<std::string, std::string> slots() {
    Running status(place, "status",
                   {"status", "--machine", harvester + "machine.toml", "--control", place.file("control"), "--json"});
    status.wait();
    const auto json = nlohmann::json::parse(status.out(), nullptr, false);
    std::map<std::string, std::string> states;
    if (json.is_discarded() || !json.contains("slots")) return states;
    for (const auto& slot : json.at("slots")) states[slot.at("name")] = slot.at("state");
    return states;
  }
  bool all_operational() {
    const auto states = slots();
    return states.size() == 62 &&
           std::ranges::all_of(states, [](const auto& slot) { return slot.second == "operational"; });
  }
  /// How often `berth up` has told it of the slot.
  long told(const std::string& slot, const std::string& what) const {
    std::istringstream lines(up->out());
    std::string line;
    long count = 0;
    while (std::getline(lines, line)) count += line.find(slot + ": " + what) != std::string::npos ? 1 : 0;
    return count;
  }

  std::vector<std::unique_ptr<Vcan>> interfaces;
  Place place;
  std::map<std::string, std::unique_ptr<Running>> processes;
  std::unique_ptr<Running> up;
};

TEST_F(HarvesterProcesses, FromBlankToOperationalAndAGatewayProcessIsKilledAndStartedAgain) {
  ASSERT_TRUE(eventually([&] { return all_operational(); }, std::chrono::seconds(300)));
  processes.at("left gateway")->kill();
  ASSERT_TRUE(eventually([&] {
    const auto states = slots();
    return !states.empty() && states.at("left gateway") == "absent" && states.at("left front motor") == "absent";
  }));
  EXPECT_EQ(slots().at("right front motor"), "operational") << "the others run on";
  start(gateways[0]);
  ASSERT_TRUE(eventually([&] { return all_operational(); }));
  EXPECT_EQ(told("left gateway", "absent"), 1);
  EXPECT_EQ(told("left front motor", "absent"), 1);
  up->signal(SIGTERM);
  EXPECT_EQ(up->wait(), 0);
}

TEST_F(HarvesterProcesses, WhatAGatewayNeedsIsSaid) {
  const std::string plant = harvester + "plant.toml";
  const auto refused = [&](const Words& words) {
    Running process(place, "refused", words);
    EXPECT_EQ(process.wait(), 2);
    return process.err();
  };
  EXPECT_NE(refused({"device", plant, "--port", port("backbone"), "--device", "left gateway"})
                .find("left port is on the bus \"left\", which has no port: add --port left=PORT; it is a port of the "
                      "gateway \"left gateway\""),
            std::string::npos);
  EXPECT_NE(refused({"device", plant, "--port", port("left"), "--device", "left port"})
                .find("left port is a port of the gateway \"left gateway\": name that one"),
            std::string::npos);
}

}  // namespace
}  // namespace berth::test

// `berth plant FILE --for TIME`: a plant by itself, and paper 2's two use cases (S2.31).
#include <gtest/gtest.h>
#include <csignal>
#include <sstream>
#include <string>
#include <vector>

#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using Json = nlohmann::json;

Json run(const std::string& plant, const std::string& time, int status) {
  const Outcome outcome = berth({"plant", plant, "--for", time, "--json"});
  EXPECT_EQ(outcome.status, status) << outcome.out << outcome.err;
  return Json::parse(outcome.out, nullptr, false);
}

/// Node-ID by device; 0 = none.
std::map<std::string, int> node_ids(const Json& report) {
  std::map<std::string, int> ids;
  for (const auto& d : report.at("devices")) {
    ids[d.at("name")] = d.at("node_id").is_null() ? 0 : d.at("node_id").get<int>();
  }
  return ids;
}

void each_its_own(const std::map<std::string, int>& ids, const std::set<std::string>& without) {
  std::set<int> seen;
  for (const auto& [name, id] : ids) {
    if (without.contains(name)) {
      EXPECT_EQ(id, 0) << name;
    } else {
      EXPECT_TRUE(id >= 1 && id <= 127 && seen.insert(id).second) << name << " " << id;
    }
  }
}

// Issue 12: the device has what CiA 301 wants of every device, and whoever runs it hears what the file lacks.
TEST(PlantAlone, WhatADescriptionLacksIsSaid) {
  const Folder folder;
  const auto eds = folder.write("small.eds", R"([DeviceInfo]
VendorNumber=1
ProductNumber=2
[OptionalObjects]
SupportedObjects=1
1=0x1018
[1018]
ParameterName=Identity
ObjectType=0x9
SubNumber=2
[1018sub0]
ParameterName=Count
ObjectType=0x7
DataType=0x0005
AccessType=ro
DefaultValue=1
[1018sub1]
ParameterName=Vendor-ID
ObjectType=0x7
DataType=0x0007
AccessType=ro
)");
  const auto plant = folder.write("plant.toml", R"([bus.b]
bitrate = 125_000
[[device]]
bus = "b"
name = "small"
eds = "small.eds"
node_id = 5
)");
  const std::string warning = "berth: " + eds +
                              ": warning: not described, and mandatory in every device (CiA 301): 1000h, 1001h, 1017h. "
                              "The device made from it has them\n";
  const Outcome alone = berth({"plant", plant, "--for", "1 s"});
  EXPECT_EQ(alone.status, 0) << alone.out;
  EXPECT_EQ(alone.err, warning);
  EXPECT_EQ(berth({"plant", plant, "--for", "1 s", "--json"}).err, "");
  const std::string socket = folder.file("plant.sock");
  const auto bus = folder.write("bus.toml", "[bus.b]\nbitrate = 125_000\n");
  const Background wire({"plant", bus, "--listen", socket});
  ASSERT_TRUE(eventually([&] { return exists(socket); }));
  const Outcome device = berth({"device", plant, "--port", "plant:" + socket, "--for", "10 ms"});
  EXPECT_EQ(device.status, 0) << device.out;
  EXPECT_EQ(device.err, warning);
}

// Issue 16: the devices of `berth device` do what their scripts say, in words and as JSON.
TEST(PlantAlone, ADeviceOnAPortRunsItsScript) {
  const Folder folder;
  static_cast<void>(folder.write("talks.lua", "print('a word')\ndevice.after(5, function() nothing() end)\n"));
  const auto plant = folder.write("plant.toml", R"([bus.b]
bitrate = 125_000
[[device]]
bus = "b"
name = "talker"
type = { vendor = 1, product = 2 }
node_id = 5
script = "talks.lua"
)");
  const std::string socket = folder.file("plant.sock");
  const Background wire({"plant", folder.write("bus.toml", "[bus.b]\nbitrate = 125_000\n"), "--listen", socket});
  ASSERT_TRUE(eventually([&] { return exists(socket); }));
  Background json({"device", plant, "--port", "plant:" + socket, "--json"});
  ASSERT_TRUE(json.says([](const auto& said) { return said.find("\"failed\":true") != std::string::npos; }));
  json.signal(SIGTERM);
  EXPECT_EQ(json.end().status, 0);
  std::vector<Json> told;
  std::istringstream lines(json.said());
  for (std::string line; std::getline(lines, line);) {
    if (Json::parse(line).at("event") == "script") told.push_back(Json::parse(line));
  }
  ASSERT_EQ(told.size(), 2U) << json.said();
  EXPECT_EQ(told[0].at("device"), "talker");
  EXPECT_EQ(told[0].at("text"), "a word");
  EXPECT_EQ(told[0].at("failed"), false);
  EXPECT_EQ(told[1].at("line"), 2);
  Background words({"device", plant, "--port", "plant:" + socket});
  ASSERT_TRUE(words.says("node-ID   5")) << "it has booted";
  words.signal(SIGTERM);
  const Outcome outcome = words.end();
  EXPECT_EQ(outcome.status, 0);
  EXPECT_NE(outcome.err.find("talker"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("a word"), std::string::npos) << outcome.err;
}

TEST(PlantAlone, S2_31_HeatingSystem) {
  const Json report = run(example("heating.plant.toml"), "20 s", 0);
  const auto ids = node_ids(report);
  ASSERT_EQ(ids.size(), 11U);
  each_its_own(ids, {"pump"});
  // The boiler gets back what it had before its power failed.
  std::vector<Json> boiler;
  for (const auto& e : report.at("events")) {
    if (e.at("device") == "boiler") boiler.push_back(e.at("node_id"));
  }
  ASSERT_EQ(boiler.size(), 3U) << report.dump();
  EXPECT_TRUE(boiler[1].is_null());
  EXPECT_EQ(boiler[2], boiler[0]);
}

TEST(PlantAlone, S2_31_BatteryCluster) {
  const Json report = run(example("battery-cluster.plant.toml"), "60 s", 0);
  const auto ids = node_ids(report);
  ASSERT_EQ(ids.size(), 10U);
  each_its_own(ids, {"battery 5"});
  for (const auto& d : report.at("devices")) {
    EXPECT_EQ(d.at("why").is_null(), d.at("name") != "battery 5") << d.dump();
    EXPECT_EQ(d.at("lss_address").get<std::string>().size(), 35U);
  }
}

// Devices that wait for a master say so, and the command's status is 1.
TEST(PlantAlone, WithoutAMasterSomeWait) {
  const Folder folder;
  const std::string text =
      std::string(small_plant).insert(std::string(small_plant).find("[bus.line]") + 10, "\nbitrate = 125_000");
  const Json report = run(folder.write("plant.toml", text), "1 s", 1);
  EXPECT_EQ(report.at("devices").at(0).at("why"), "waits for a master to give it one");
  EXPECT_EQ(report.at("devices").at(3).at("why"), "not plugged in");
}

TEST(PlantAlone, RecordsEveryFrame) {
  const Folder folder;
  const auto log = folder.file("log");
  const Outcome outcome =
      berth({"plant", example("battery-cluster.plant.toml"), "--for", "4 s", "--record", log, "--json"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(contents(log).find(" cluster 00000100#\n"), std::string::npos);
}

// Of a bus beneath a gateway the machine file has the bit rate, as of any other.
TEST(PlantAlone, TheHarvesterAsItIsShipped) {
  const Outcome outcome = berth({"plant", example("harvester/plant.toml"), "--machine",
                                 example("harvester/machine.toml"), "--for", "100 ms", "--json"});
  EXPECT_EQ(outcome.err, "");
  EXPECT_NE(outcome.out.find("reel motor"), std::string::npos) << outcome.out;
}

TEST(PlantAlone, WrongWords) {
  const auto plant = example("heating.plant.toml");
  EXPECT_EQ(berth({"plant", plant}).status, 2) << "neither --for nor --listen";
  EXPECT_EQ(berth({"plant", plant, "--for", "5 s", "--listen", "/tmp/x"}).status, 2);
  EXPECT_EQ(berth({"plant", plant, "--for", "soon"}).status, 2);
  EXPECT_EQ(berth({"plant", plant, "--for", "0 s"}).status, 2);
  EXPECT_EQ(berth({"plant", "no such file", "--for", "5 s"}).status, 2);
}

}  // namespace
}  // namespace berth::test

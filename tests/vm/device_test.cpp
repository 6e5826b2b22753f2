// `berth device` on a virtual interface, asked by frames as the standards have them.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "asker.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using namespace std::chrono_literals;

const char* const plant_of_two = R"(
[plant]
seed = 1
[bus.field]
bitrate = 125_000
[[device]]
bus = "field"
name = "blank"
type = { vendor = 0x0000_0001, product = 0x0000_0002 }
serial = 0x0A
[[device]]
bus = "field"
name = "fixed"
type = { vendor = 0x0000_0001, product = 0x0000_0003 }
serial = 0x0B
node_id = 5
source = "hard-coded"
)";

class DeviceCommand : public testing::Test {
 protected:
  void SetUp() override {
    if (const auto why = no_interface("vcan0"); !why.empty()) GTEST_SKIP() << "needs vm: " << why;
    vcan.emplace("vt0");
    plant = place.write("plant.toml", plant_of_two);
  }
  /// Selects the blank device, gives it a node-ID, lets it store that, and puts it back to waiting (CiA 305).
  static void give_node_id(Asker& asker, const std::string& id) {
    for (const char* const part : {"7E5#4001000000000000", "7E5#4102000000000000", "7E5#4200000000000000"}) {
      asker.send(part);
    }
    EXPECT_TRUE(asker.ask("7E5#430A000000000000", "7E4#4400000000000000"));
    EXPECT_TRUE(asker.ask("7E5#11" + id + "000000000000", "7E4#1100000000000000"));
    EXPECT_TRUE(asker.ask("7E5#1700000000000000", "7E4#1700000000000000"));
    EXPECT_TRUE(asker.ask("7E5#0400000000000000", "7" + id + "#00"));
  }
  std::optional<Vcan> vcan;
  Place place;
  std::string plant;
};

TEST_F(DeviceCommand, AnswersForTheDevicesOfThePlantUntilItIsToldToEnd) {
  Asker asker("vt0");
  Running device(place, "device", {"device", plant, "--port", "socketcan:vt0"});
  ASSERT_TRUE(asker.hears("705#00")) << device.err();
  EXPECT_TRUE(asker.ask("605#4018100400000000", "585#431810040B000000"));
  EXPECT_TRUE(asker.ask("7E5#4C00000000000000", "7E4#5000000000000000")) << "the blank one waits for a node-ID";
  give_node_id(asker, "09");
  EXPECT_TRUE(asker.ask("609#4018100200000000", "589#4318100202000000"));
  EXPECT_TRUE(device.says("node-ID   9"));
  device.signal(SIGTERM);
  EXPECT_EQ(device.wait(), 0) << device.err();
}

TEST_F(DeviceCommand, OneProcessADeviceAndWhatItStoresOutlivesIt) {
  const std::vector<std::string> words{
      "device", plant, "--port", "socketcan:vt0", "--device", "blank", "--sim-state", place.file("state"), "--json"};
  Asker asker("vt0");
  Running fixed(place, "fixed", {"device", plant, "--port", "socketcan:vt0", "--device", "fixed"});
  ASSERT_TRUE(asker.hears("705#00")) << fixed.err();
  {
    Running device(place, "first", words);
    ASSERT_TRUE(device.says("\"state\":\"initialising\"")) << device.err();
    give_node_id(asker, "09");
    device.kill();
  }
  Running device(place, "second", words);
  EXPECT_TRUE(asker.hears("709#00")) << device.err();
  ASSERT_TRUE(device.says("\"node_id\":9"));
  device.signal(SIGTERM);
  EXPECT_EQ(device.wait(), 0);
  std::istringstream lines(device.out());
  std::string line;
  std::vector<std::string> events;
  while (std::getline(lines, line)) events.push_back(nlohmann::json::parse(line).at("event"));
  ASSERT_GE(events.size(), 3U);
  EXPECT_EQ(events.front(), "started");
  EXPECT_EQ(events.back(), "ended");
  EXPECT_TRUE(asker.ask("605#4018100400000000", "585#431810040B000000")) << "the other process goes on";
}

TEST_F(DeviceCommand, InterfaceDownAndUpIsToldAndTheDeviceGoesOn) {
  Asker asker("vt0");
  Running device(place, "device", {"device", plant, "--port", "socketcan:vt0"});
  ASSERT_TRUE(asker.hears("705#00")) << device.err();
  vcan->down();
  EXPECT_TRUE(device.says("socketcan:vt0 is down"));
  vcan->up();
  EXPECT_TRUE(device.says("socketcan:vt0 is up"));
  // The asker's own port comes back by itself, too, maybe later.
  EXPECT_TRUE(eventually([&] {
    asker.send("605#4018100400000000");
    return asker.hears("585#431810040B000000", 1s);
  }));
}

TEST_F(DeviceCommand, EndsAfterItsTime) {
  Running device(place, "device", {"device", plant, "--port", "socketcan:vt0", "--for", "300 ms", "--json"});
  EXPECT_EQ(device.wait(), 0) << device.err();
  EXPECT_NE(device.out().find("\"why\":\"time\""), std::string::npos);
}

TEST_F(DeviceCommand, WhatIsWrongIsSaid) {
  Running nobody(place, "nobody", {"device", plant, "--port", "socketcan:vt0", "--device", "blnk"});
  EXPECT_EQ(nobody.wait(), 2);
  EXPECT_NE(nobody.err().find("blank"), std::string::npos) << nobody.err();
  Running nowhere(place, "nowhere", {"device", plant, "--port", "socketcan:none0"});
  EXPECT_EQ(nowhere.wait(), 3);
  EXPECT_NE(nowhere.err().find("none0"), std::string::npos) << nowhere.err();
}

}  // namespace
}  // namespace berth::test

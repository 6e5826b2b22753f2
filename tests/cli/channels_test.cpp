// `berth sdo connect`, `release` and `channels`: the SDO manager of a running `berth up`, and another one.
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <string>

#include "running_fixture.hpp"

namespace berth::test {
namespace {

/// io.eds with one SDO channel more as server, and one as client.
std::string eds_with_channels() {
  std::string eds = contents(example("eds/io.eds"));
  const auto replace = [&](const std::string& what, const std::string& by) {
    const auto at = eds.find(what);
    ASSERT_NE(at, std::string::npos) << what;
    eds.replace(at, what.size(), by);
  };
  replace("SupportedObjects=18", "SupportedObjects=20");
  replace("18=0x6206", "18=0x6206\n19=0x1201\n20=0x1280");
  for (const std::string index : {"1201", "1280"}) {
    eds += "\n[" + index + "]\nParameterName=SDO parameter\nObjectType=0x9\nSubNumber=4\n";
    const auto sub = [&](const std::string& number, const std::string& type, const std::string& value) {
      eds += "\n[" + index + "sub" + number + "]\nParameterName=part " + number + "\nObjectType=0x7\nDataType=" + type +
             "\nAccessType=" + (number == "0" ? "const" : "rw") + "\nDefaultValue=" + value + "\nPDOMapping=0\n";
    };
    sub("0", "0x0005", "3");
    sub("1", "0x0007", "0x80000000");
    sub("2", "0x0007", "0x80000000");
    sub("3", "0x0005", "0");
  }
  return eds;
}

class Channels : public Running {
 protected:
  void SetUp() override {
    Running::SetUp();
    const std::string eds = folder.write("io.eds", eds_with_channels());
    std::string slots = "[machine]\nname = \"channels\"\n[bus.field]\nport = \"sim\"\nbitrate = 250_000\n";
    std::string devices = "[plant]\nseed = 1\n[bus.field]\n";
    for (const std::string& name : {std::string("panel"), std::string("left"), std::string("drive")}) {
      const auto number = std::to_string(++count_);
      slots += "[[slot]]\nbus = \"field\"\nid = " + number + "\nname = \"" + name + "\"\neds = \"" + eds + "\"\n";
      devices += "[[device]]\nbus = \"field\"\nname = \"" + name + "\"\neds = \"" + eds + "\"\nserial = " + number +
                 "\nnode_id = " + number + "\n";
    }
    machine = folder.write("channels.toml", slots);
    plant = folder.write("channels.plant.toml", devices);
  }
  [[nodiscard]] std::uint32_t number(const std::string& node, const std::string& object) const {
    const Outcome read = ask({"sdo", "read", node, object});
    EXPECT_EQ(read.status, 0) << read.out;
    return Json::parse(read.out).at("value").get<std::uint32_t>();
  }
  int count_ = 0;
};

// S5.20: planned in the machine file, they stand in both devices when these are operational, and in a replacement.
TEST_F(Channels, S5_20_PlannedOnesArePartOfTheConfigurations) {
  machine = folder.write("planned.toml", contents(machine) + "[[channel]]\nclient = \"panel\"\nserver = \"drive\"\n");
  begin(plant);
  ASSERT_TRUE(all_operational());
  const auto stands = [&] {
    EXPECT_EQ(number("panel", "1280h:01"), 0x6DEU);
    EXPECT_EQ(number("panel", "1280h:02"), 0x6DFU);
    EXPECT_EQ(number("panel", "1280h:03"), 3U);
    EXPECT_EQ(number("drive", "1201h:01"), 0x6DEU);
    EXPECT_EQ(number("drive", "1201h:02"), 0x6DFU);
    EXPECT_EQ(number("drive", "1201h:03"), 1U);
    EXPECT_EQ(number("left", "1201h:01"), 0x8000'0000U);
  };
  stands();
  // The manager leaves it, gives others beside it, and takes its own back.
  EXPECT_EQ(ask({"sdo", "connect", "panel", "left"}).status, 1) << "the panel's only channel is taken";
  ASSERT_EQ(ask({"sdo", "connect", "drive", "panel", "--lease", "1 s"}).status, 0);
  EXPECT_EQ(number("drive", "1280h:01"), 0x680U);
  EXPECT_TRUE(eventually([&] { return number("drive", "1280h:01") == 0x8000'0680U; })) << "its lease is over";
  const Json listed = Json::parse(ask({"sdo", "channels"}).out);
  ASSERT_EQ(listed.at("planned").size(), 1U);
  EXPECT_EQ(listed.at("planned").at(0).at("request"), "0x6DE");
  EXPECT_TRUE(listed.at("channels").empty()) << listed;
  const Outcome release = ask({"sdo", "release", "panel", "drive"});
  EXPECT_EQ(release.status, 1);
  EXPECT_TRUE(contains(release.out, "1 -> 3 is in the machine file")) << release.out;
  stands();
  // What an earlier machine file planned is no end of a channel now.
  ASSERT_EQ(ask({"sdo", "write", "left", "1201h:01", "0x6DE"}).status, 0);
  const Outcome check = ask({"configure", "left", "--check"});
  EXPECT_EQ(check.status, 1) << check.out;
  EXPECT_TRUE(contains(check.out, "1201")) << check.out;
  ASSERT_EQ(ask({"nmt", "reset", "left"}).status, 0);
  EXPECT_TRUE(eventually([&] { return number("left", "1201h:01") == 0x8000'0000U; }));
  ASSERT_EQ(ask({"sdo", "write", "drive", "1201h:01", "0x800006DE"}).status, 0);
  ASSERT_EQ(ask({"nmt", "reset", "drive"}).status, 0);
  EXPECT_TRUE(eventually([&] { return number("drive", "1201h:01") == 0x6DEU; })) << "it boots with what it has saved";
}

TEST_F(Channels, ARunningManagerGivesThemListsThemAndTakesThemBack) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  EXPECT_TRUE(Json::parse(ask({"sdo", "channels"}).out).at("channels").empty());
  const Outcome made = ask({"sdo", "connect", "panel", "drive", "--lease", "500 s"});
  ASSERT_EQ(made.status, 0) << made.out << made.err;
  const Json channel = Json::parse(made.out);
  EXPECT_EQ(channel.at("client"), 1);
  EXPECT_EQ(channel.at("server"), 3);
  EXPECT_EQ(channel.at("client_object"), "1280h");
  EXPECT_EQ(channel.at("server_object"), "1201h");
  EXPECT_GT(channel.at("lease_s").get<double>(), 400);
  // It stands in both devices, and nowhere else.
  EXPECT_EQ(number("panel", "1280h:01"), 0x680U);
  EXPECT_EQ(number("panel", "1280h:02"), 0x681U);
  EXPECT_EQ(number("panel", "1280h:03"), 3U);
  EXPECT_EQ(number("drive", "1201h:01"), 0x680U);
  EXPECT_EQ(number("drive", "1201h:02"), 0x681U);
  EXPECT_EQ(number("left", "1201h:01"), 0x8000'0000U);
  const Json all = Json::parse(ask({"sdo", "channels"}).out).at("channels");
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all.at(0).at("request"), "0x680");
  // A device with one server channel has no second one.
  const Outcome full = ask({"sdo", "connect", "left", "drive"});
  EXPECT_EQ(full.status, 1) << full.out;
  EXPECT_EQ(ask({"sdo", "release", "panel", "drive"}).status, 0);
  EXPECT_NE(number("panel", "1280h:01") & 0x8000'0000U, 0U);
  EXPECT_NE(number("drive", "1201h:01") & 0x8000'0000U, 0U);
  EXPECT_EQ(ask({"sdo", "release", "panel", "drive"}).status, 1) << "there is none any more";
  EXPECT_EQ(ask({"sdo", "connect", "left", "drive"}).status, 0) << "its server channel is free again";
}

// A lease that is over.
TEST_F(Channels, AChannelIsTakenBackWhenItsLeaseIsOver) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  ASSERT_EQ(ask({"sdo", "connect", "panel", "drive", "--lease", "1 s"}).status, 0);
  EXPECT_TRUE(eventually([&] { return (number("drive", "1201h:01") & 0x8000'0000U) != 0; }));
  EXPECT_TRUE(eventually([&] { return (number("panel", "1280h:01") & 0x8000'0000U) != 0; }));
}

// Any node asks Berth's own master by 1F00h: here the command line does, of the master's node-ID.
TEST_F(Channels, AnotherManagerIsAskedByItsObjects) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  const Outcome refused = ask({"sdo", "connect", "panel", "drive", "--request", "2"});
  EXPECT_EQ(refused.status, 1) << refused.out;
  EXPECT_TRUE(contains(refused.out, "1F00h")) << "node 2 is no SDO manager: " << refused.out;
}

TEST_F(Channels, WrongWordsAreUsageAndADryRunNeedsAWorld) {
  const Words in{"--machine", machine, "--sim", plant};
  const auto run = [&](Words words) {
    words.insert(words.end(), in.begin(), in.end());
    return berth(words);
  };
  EXPECT_EQ(run({"sdo", "connect", "panel", "panel"}).status, 2);
  EXPECT_EQ(run({"sdo", "connect", "panel"}).status, 2);
  EXPECT_EQ(run({"sdo", "connect", "panel", "nobody"}).status, 2);
  EXPECT_EQ(run({"sdo", "connect", "panel", "drive", "--lease", "0 s"}).status, 2);
  const Outcome dry = run({"sdo", "connect", "panel", "drive", "--up", "--dry-run"});
  EXPECT_EQ(dry.status, 0) << dry.out << dry.err;
  EXPECT_TRUE(contains(dry.out, "601#2380120100000080") || contains(dry.out, "601#2380120180060000")) << dry.out;
  const Outcome here = run({"sdo", "connect", "panel", "drive", "--up"});
  EXPECT_EQ(here.status, 0) << here.err;
  EXPECT_TRUE(contains(here.out, "1280h of the client, 1201h of the server, 680h and 681h")) << here.out;
}

}  // namespace
}  // namespace berth::test

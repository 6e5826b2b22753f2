// Devices of one LSS address on two buses, as a person sees them: both work, and each is spoken of with its bus.
#include <gtest/gtest.h>
#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "berth/store/database.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using Json = nlohmann::json;

// Serial number 0 on both, as many devices have.
constexpr const char* twin_machine = R"([machine]
name = "twin"
[bus.a]
port = "sim"
bitrate = 500_000
master_id = 127
[bus.b]
port = "sim"
bitrate = 500_000
master_id = 127
[[slot]]
bus = "a"
id = 1
name = "left"
type = { vendor = 1, product = 1 }
[[slot]]
bus = "b"
id = 1
name = "right"
type = { vendor = 1, product = 1 }
)";
constexpr const char* twin_plant = R"([plant]
seed = 1
[bus.a]
[bus.b]
[[device]]
bus = "a"
name = "l"
type = { vendor = 1, product = 1 }
serial = 0
[[device]]
bus = "b"
name = "r"
type = { vendor = 1, product = 1 }
serial = 0
)";

class TwinCommand : public testing::Test {
 protected:
  Outcome run(Words words) const {
    for (const std::string& word : {std::string("--machine"), machine, std::string("--sim"), plant,
                                    std::string("--store"), store, std::string("--json")}) {
      words.push_back(word);
    }
    return berth(words);
  }
  Folder folder;
  std::string machine = folder.write("twin.toml", twin_machine);
  std::string plant = folder.write("twin.plant.toml", twin_plant);
  std::string store = folder.file("twin.db");
  LssAddress address{1, 1, 0, 0};
};

}  // namespace

TEST_F(TwinCommand, BothAreOperationalAndHaveAHistoryOfTheirOwn) {
  for (const char* start : {"the first", "from the store"}) {
    const Outcome up = berth({"up", machine, "--sim", plant, "--store", store, "--sim-state", folder.file("memory"),
                              "--fast", "--until", "operational"});
    EXPECT_EQ(up.status, 0) << start << "\n" << up.out << up.err;
    EXPECT_EQ(up.out.find("has the LSS address of"), std::string::npos) << "no clone, and nothing to remark";
  }
  const Outcome told = run({"history"});
  ASSERT_EQ(told.status, 0) << told.err;
  const Json history = Json::parse(told.out).at("history");
  for (const char* bus : {"a", "b"}) {
    const auto confirmed = [&](const Json& line) { return line.at("event") == "confirmed" && line.at("bus") == bus; };
    EXPECT_EQ(std::ranges::count_if(history, confirmed), 1) << told.out;
  }
}

// A machine sees no lines of another one that has the same store, and of its own those without a slot with their bus.
TEST_F(TwinCommand, TheHistoryIsTheMachinesOwn) {
  {
    const auto opened = store::Database::open(store);
    ASSERT_TRUE(opened);
    ASSERT_TRUE((*opened)->ask_blank({address, "twin", "b", NodeId(9)}, "ours"));
    ASSERT_TRUE((*opened)->ask_blank({address, "another", "b", NodeId(9)}, "another machine's"));
  }
  const Outcome told = run({"history"});
  ASSERT_EQ(told.status, 0) << told.err;
  EXPECT_EQ(told.out.find("another machine's"), std::string::npos) << told.out;
  const Json history = Json::parse(told.out).at("history");
  const auto ours = std::ranges::find_if(history, [](const Json& line) { return line.at("reason") == "ours"; });
  ASSERT_NE(ours, history.end()) << told.out;
  EXPECT_EQ(ours->at("bus"), "b");
  EXPECT_EQ(ours->at("slot"), "");
}

TEST_F(TwinCommand, ForgettingWantsTheBusWhenTwoAreWaitedFor) {
  {
    const auto opened = store::Database::open(store);
    ASSERT_TRUE(opened);
    ASSERT_TRUE((*opened)->ask_blank({address, "twin", "a", NodeId(9)}, "x"));
    ASSERT_TRUE((*opened)->ask_blank({address, "twin", "b", NodeId(9)}, "x"));
  }
  const std::string device = to_string(address);
  const Outcome both = run({"forget", device});
  EXPECT_EQ(both.status, 2) << both.out;
  EXPECT_NE(both.out.find("a, b"), std::string::npos) << both.out;
  EXPECT_NE(both.out.find("--bus"), std::string::npos) << both.out;
  EXPECT_EQ(run({"forget", device, "--bus", "b"}).status, 0);
  {
    const auto opened = store::Database::open(store);
    ASSERT_TRUE(opened);
    const auto left = (*opened)->unfinished_blanks().value();
    ASSERT_EQ(left.size(), 1U);
    EXPECT_EQ(left[0].bus, "a");
  }
  EXPECT_EQ(run({"forget", device}).status, 0) << "one is left";
}

}  // namespace berth::test

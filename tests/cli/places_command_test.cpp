// bind --method, locate, scan and find with devices of every kind, and questions as a program sees them.
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using Json = nlohmann::json;

class PlacesCommand : public testing::Test {
 protected:
  // `changes`: text of the machine or the plant, and what stands there instead, everywhere.
  using Changes = std::vector<std::pair<std::string, std::string>>;
  static std::string changed(std::string text, const Changes& changes) {
    for (const auto& [what, by] : changes) {
      EXPECT_NE(text.find(what), std::string::npos) << what;
      for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
        text.replace(at, what.size(), by);
    }
    return text;
  }
  void write(const Changes& machine, const Changes& plant) {
    machine_ = folder_.write("machine.toml", changed(small_machine, machine));
    plant_ = folder_.write("plant.toml", changed(small_plant, plant));
  }
  Outcome run(Words words) {
    for (const std::string& word : {std::string("--machine"), machine_, std::string("--sim"), plant_}) {
      words.push_back(word);
    }
    return berth(words);
  }

  Folder folder_;
  std::string machine_;
  std::string plant_;
};

// S1.54: no device speaks RAND.
TEST_F(PlacesCommand, S1_54_BindByMethod) {
  write({}, {{"serial = 0x", "speaks = [\"fastscan\"]\nserial = 0x"}});
  const auto by_fastscan = run({"bind", "--method", "planner-fastscan", "--json"});
  EXPECT_EQ(by_fastscan.status, 0) << by_fastscan.out << by_fastscan.err;
  const auto by_rand = run({"bind", "--method", "rand", "--json"});
  EXPECT_EQ(by_rand.status, 1) << "nobody speaks it";
  const auto by_default = run({"bind", "--json"});
  ASSERT_EQ(by_default.status, 0) << by_default.out << by_default.err;
  for (const auto& slot : Json::parse(by_default.out)["slots"]) EXPECT_EQ(slot["state"], "present") << slot;
  EXPECT_EQ(run({"bind", "--method", "magic"}).status, 2);
}

// Everybody's node-ID goes: that is asked first, whatever the bus; a dry run shows what would be sent.
TEST_F(PlacesCommand, FromScratchIsConfirmedFirst) {
  write({}, {});
  const auto kept = [&](Words words) {
    for (const std::string& word : {std::string("--store"), folder_.file("kept.db"), std::string("--sim-state"),
                                    folder_.file("kept.state"), std::string("--json")}) {
      words.push_back(word);
    }
    return run(words);
  };
  ASSERT_EQ(kept({"bind"}).status, 0);
  const auto asked = kept({"bind", "--from-scratch"});
  EXPECT_EQ(asked.status, 1) << asked.out << asked.err;
  EXPECT_EQ(Json::parse(asked.out)["result"], "unconfirmed") << asked.out;
  EXPECT_EQ(Json::parse(asked.out)["bound"], 3) << asked.out;
  const auto in_words = run({"bind", "--from-scratch"});
  EXPECT_EQ(in_words.status, 1);
  EXPECT_NE(in_words.err.find("confirm it with --yes"), std::string::npos) << in_words.err;
  const std::string taken = "7E5#11FF";  // LSS: configure node-ID, 255 is none
  const auto dry = kept({"bind", "--from-scratch", "--dry-run"});
  EXPECT_EQ(dry.status, 0) << dry.out << dry.err;
  EXPECT_NE(dry.out.find(taken), std::string::npos) << dry.out;
  EXPECT_EQ(Json::parse(kept({"bind", "--from-scratch"}).out)["bound"], 3) << "the dry run changed nothing";
  const auto done = kept({"bind", "--from-scratch", "--yes"});
  ASSERT_EQ(done.status, 0) << done.out << done.err;
  for (const auto& slot : Json::parse(done.out)["slots"]) EXPECT_EQ(slot["state"], "present") << slot;
}

// On a terminal the person is asked, and only "y" or "yes" is a yes.
TEST_F(PlacesCommand, OnATerminalAPersonIsAsked) {
  write({}, {});
  for (const auto& [answer, status] : {std::pair{"\n", 1}, {"nay\n", 1}, {"yes\n", 0}}) {
    Background process({"bind", "--from-scratch", "--machine", machine_, "--sim", plant_}, OnTerminal{});
    process.type(answer);
    const auto outcome = process.end();
    EXPECT_EQ(outcome.status, status) << answer << outcome.out << outcome.err;
    EXPECT_NE(outcome.out.find("Do it? [y/N]"), std::string::npos) << outcome.out;
    EXPECT_EQ(outcome.out.find("present") != std::string::npos, status == 0) << outcome.out;
  }
}

// The machine file's word, and one that is none.
TEST_F(PlacesCommand, DiscoveryOfTheMachineFile) {
  write({{"bitrate = 500_000", "bitrate = 500_000\ndiscovery = \"planner-fastscan\""}},
        {{"serial = 0x", "speaks = [\"fastscan\"]\nserial = 0x"}});
  EXPECT_EQ(run({"bind"}).status, 0);
  write({{"bitrate = 500_000", "bitrate = 500_000\ndiscovery = \"magic\""}}, {});
  const auto refused = run({"bind"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_NE(refused.err.find("discovery"), std::string::npos) << refused.err;
}

TEST_F(PlacesCommand, ScanAndFindSeeWhoDoesNotSpeakRand) {
  write({}, {{"serial = 0x20", "speaks = [\"fastscan\"]\nserial = 0x20"},
             {"serial = 0x30", "speaks = [\"lss\"]\nserial = 0x30"}});
  const auto scan = run({"scan", "--all", "--json"});
  ASSERT_EQ(scan.status, 0) << scan.out << scan.err;
  EXPECT_EQ(Json::parse(scan.out)["unconfigured"], 3) << scan.out;
  const auto find = run({"lss", "find", "--json"});
  ASSERT_EQ(find.status, 0) << find.out << find.err;
  EXPECT_EQ(Json::parse(find.out)["devices"].size(), 3U) << find.out;
}

TEST_F(PlacesCommand, LocateShowsANewDeviceAndLeavesRunningOnesAlone) {
  write({}, {});
  const auto fresh = run({"locate", "00000001-00000001-00000000-00000021", "--seconds", "2", "--json"});
  ASSERT_EQ(fresh.status, 0) << fresh.out << fresh.err;
  EXPECT_TRUE(Json::parse(fresh.out)["id"].is_null());
  const auto running = run({"locate", "left", "--up"});
  EXPECT_EQ(running.status, 1) << running.out;
  EXPECT_NE(running.err.find("--anyway"), std::string::npos) << running.err;
  const auto anyway = run({"locate", "left", "--up", "--anyway", "--json"});
  ASSERT_EQ(anyway.status, 0) << anyway.err;
  EXPECT_EQ(Json::parse(anyway.out)["id"], 2);
  EXPECT_EQ(run({"locate", "nobody"}).status, 2);
  EXPECT_EQ(run({"locate", "left"}).status, 2) << "nobody sits there yet";
  EXPECT_EQ(run({"locate", "00000001-00000001-00000000-000000FF"}).status, 1);
}

// S4.19: what a program gets, and how it answers.
TEST_F(PlacesCommand, S4_19_AQuestionInJsonAndItsAnswer) {
  write({{"\"ascending\"", "\"ask\""}}, {});
  const auto asked = run({"bind", "--json"});
  EXPECT_EQ(asked.status, 1);
  const auto report = Json::parse(asked.out);
  ASSERT_EQ(report["questions"].size(), 1U) << asked.out;
  const auto question = report["questions"][0];
  EXPECT_EQ(question["slots"], (Json{"left", "right"}));
  EXPECT_EQ(question["devices"], (Json{"00000001-00000001-00000000-00000020", "00000001-00000001-00000000-00000021"}));
  const auto answer = run({"replace", "left", "--device", question["devices"][1].get<std::string>(), "--json"});
  ASSERT_EQ(answer.status, 0) << answer.out << answer.err;
  EXPECT_EQ(Json::parse(answer.out)["r_sn"], "0x0000000000000021");
}

}  // namespace
}  // namespace berth::test

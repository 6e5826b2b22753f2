// `berth backup`: what devices hold as DCFs, compared and brought back, on a machine that runs.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "../pch.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

class Backup : public ::testing::Test {
 protected:
  void SetUp() override {
    up_ = std::make_unique<Background>(Words{"up", example("belt.toml"), "--sim", example("belt.plant.toml"), "--pace",
                                             "--control", socket_, "--store", folder_.file("store")});
    ASSERT_TRUE(comes_up());
  }
  [[nodiscard]] bool comes_up() const {
    return eventually([&] { return ask({"status"}).status == 0; });
  }
  [[nodiscard]] Outcome ask(Words words) const {
    words.insert(words.end(), {"--control", socket_, "--json"});
    return berth(words);
  }
  [[nodiscard]] Json told(const Words& words, int status) const {
    const Outcome outcome = ask(words);
    EXPECT_EQ(outcome.status, status) << outcome.out << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }
  [[nodiscard]] int value(const std::string& object) const {
    return told({"sdo", "read", "belt", object}, 0).at("value").get<int>();
  }
  void write(const std::string& object, const std::string& value) const {
    static_cast<void>(told({"sdo", "write", "belt", object, value}, 0));
  }
  /// The DCF of the belt as it is now.
  [[nodiscard]] std::string saved() const {
    const Json reply = told({"backup", "save", "belt", "-o", folder_.file("backups")}, 0);
    return reply.at("backups").at(0).at("file").get<std::string>();
  }
  /// The DCF with another value of an object.
  [[nodiscard]] std::string with(const std::string& file, const std::string& section, const std::string& value) const {
    std::string text = contents(file);
    const auto at = text.find("[" + section + "]");
    const auto key = text.find("ParameterValue=", at);
    const auto end = text.find_first_of("\r\n", key);
    if (at == std::string::npos || key == std::string::npos) return {};
    text.replace(key, end - key, "ParameterValue=" + value);
    return folder_.write("other.dcf", text);
  }
  /// "0x1017:00", of each entry.
  static std::vector<std::string> objects(const Json& list) {
    std::vector<std::string> names;
    for (const auto& each : list) names.push_back(each.at("object").get<std::string>());
    return names;
  }

  Folder folder_;
  std::string socket_ = folder_.file("up.sock");
  std::unique_ptr<Background> up_;
};

TEST_F(Backup, WhatWasSavedComesBack) {
  const std::string file = saved();
  EXPECT_TRUE(fs::path(file).filename().string().starts_with("belt-20")) << file;
  EXPECT_NE(contents(file).find("LSS_SerialNumber=1"), std::string::npos) << "which device it was";
  EXPECT_EQ(told({"backup", "compare", "belt", file}, 0).at("result"), "equal");
  const int cob_id = value("1800h:01"), mapped = value("1A00h:00"), heartbeat = value("1017h");
  write("1017h", "650");
  // A mapping that is not empty may only change while its PDO is off (CiA 301 §7.5.2.38).
  write("1800h:01", "0x8000018A");
  write("1A00h:00", "0");
  write("1A00h:01", "0x60000208");
  const Json differs = told({"backup", "compare", "belt", file}, 1);
  EXPECT_EQ(differs.at("result"), "differs");
  EXPECT_EQ(objects(differs.at("differences")),
            (std::vector<std::string>{"0x1017:00", "0x1800:01", "0x1A00:00", "0x1A00:01"}));
  EXPECT_EQ(differs.at("differences").at(0).at("has"), "650 (0x28A)");
  EXPECT_EQ(value("1017h"), 650) << "compared only";
  const Json restored = told({"backup", "restore", "belt", file}, 0);
  EXPECT_EQ(restored.at("result"), "restored");
  EXPECT_TRUE(restored.at("refused").empty()) << restored;
  EXPECT_EQ(value("1017h"), heartbeat);
  EXPECT_EQ(value("1800h:01"), cob_id);
  EXPECT_EQ(value("1A00h:00"), mapped);
  EXPECT_EQ(told({"backup", "compare", "belt", file}, 0).at("result"), "equal");
}

// Done is done: "650 instead of 640" would read as if it were so still.
TEST_F(Backup, WhatWasRestoredIsToldAsDone) {
  const std::string file = saved();
  const int heartbeat = value("1017h");
  write("1017h", "650");
  const Outcome done = berth({"backup", "restore", "belt", file, "--control", socket_});
  EXPECT_EQ(done.status, 0) << done.err;
  EXPECT_NE(done.out.find(": " + std::to_string(heartbeat) + " (0x"), std::string::npos) << done.out;
  EXPECT_NE(done.out.find(", was 650 (0x28A)"), std::string::npos) << done.out;
  EXPECT_EQ(done.out.find("instead of"), std::string::npos) << done.out;
}

TEST_F(Backup, WhatIsThereIsReplacedWhenItIsSaid) {
  const Words save{"backup", "save", "belt", "-o", folder_.file("backups")};
  static_cast<void>(told(save, 0));
  Words again = save;
  again.insert(again.end(), {"--control", socket_});
  const Outcome refused = berth(again);
  // Behind the turn of a minute it is another file.
  if (refused.status != 0) {
    EXPECT_NE(refused.err.find("--force replaces it, or name another folder by -o"), std::string::npos) << refused.err;
  }
  Words forced = save;
  forced.emplace_back("--force");
  static_cast<void>(told(forced, 0));
}

TEST_F(Backup, EachRefusalIsToldAndTheOthersAreRestored) {
  const std::string file = with(saved(), "1017", "640");
  const std::string bad = with(file, "1014", "0x0");  // 000h is no COB-ID of an emergency
  const Json reply = told({"backup", "restore", "belt", bad}, 1);
  EXPECT_EQ(reply.at("result"), "partly restored");
  ASSERT_EQ(objects(reply.at("refused")), std::vector<std::string>{"0x1014:00"}) << reply;
  EXPECT_NE(reply.at("refused").at(0).at("why").get<std::string>().find("the device refused it"), std::string::npos);
  EXPECT_EQ(value("1017h"), 640);
}

TEST_F(Backup, OfAnotherTypeNothingIsWritten) {
  const std::string file = with(saved(), "1017", "640");
  const Outcome refused = ask({"backup", "restore", "barrier", file});
  EXPECT_EQ(refused.status, 1) << refused.out;
  EXPECT_NE(refused.out.find("of another type of device"), std::string::npos) << refused.out;
  EXPECT_NE(told({"sdo", "read", "barrier", "1017h"}, 0).at("value"), 640);
}

TEST_F(Backup, OneThatIsAwayIsNamedAndTheOthersAreSaved) {
  static_cast<void>(told({"sim", "unplug", "light barrier"}, 0));
  const Json reply = told({"backup", "save", "--all", "-o", folder_.file("all")}, 1);
  EXPECT_EQ(reply.at("failed"), 1);
  ASSERT_EQ(reply.at("backups").size(), 2U);
  EXPECT_TRUE(fs::exists(reply.at("backups").at(0).at("file").get<std::string>()));
  EXPECT_FALSE(reply.at("backups").at(1).contains("file"));
  EXPECT_FALSE(reply.at("backups").at(1).at("problem").get<std::string>().empty());
}

TEST_F(Backup, ADeviceThatGoesAwayInTheMiddle) {
  const std::string file = with(saved(), "1017", "640");
  static_cast<void>(told({"sim", "fault", "slow", "belt", "latency=80 ms"}, 0));
  // However late this machine is with the next two processes, the restore is not over by then.
  static_cast<void>(told({"world", "speed", "0.05"}, 0));
  Background restore({"backup", "restore", "belt", file, "--control", socket_, "--json"});
  ASSERT_TRUE(eventually([&] {
    return ask({"history", "--audit"}).out.find("backup restore") != std::string::npos;
  })) << "it has begun";
  static_cast<void>(told({"sim", "unplug", "belt"}, 0));
  static_cast<void>(told({"world", "speed", "1"}, 0));
  const Outcome end = restore.end();
  EXPECT_TRUE(end.status == 3 || end.status == 1) << end.out << end.err;
  const Json reply = Json::parse(end.out);
  const bool silent = reply.dump().find("did not answer") != std::string::npos ||
                      reply.dump().find("no answer to the SDO request") != std::string::npos;
  EXPECT_TRUE(silent) << reply;
  static_cast<void>(told({"sim", "plug", "belt"}, 0));
  ASSERT_TRUE(comes_up());
  EXPECT_EQ(told({"backup", "restore", "belt", file}, 0).at("result"), "restored");
  EXPECT_EQ(value("1017h"), 640);
}

TEST_F(Backup, WhatIsNoDcfIsNamed) {
  const std::string file = folder_.write("no.dcf", "[FileInfo\nnonsense");
  const Outcome outcome = ask({"backup", "restore", "belt", file});
  EXPECT_EQ(outcome.status, 2) << outcome.out;
  EXPECT_NE(outcome.out.find("no.dcf"), std::string::npos) << outcome.out;
  EXPECT_EQ(berth({"backup", "save"}).status, 2);
}

}  // namespace
}  // namespace berth::test

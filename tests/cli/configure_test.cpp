// `berth configure`, and what `berth up` says of configurations.
#include <gtest/gtest.h>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "process.hpp"
#include "tests/pch.hpp"

namespace berth::test {
namespace {

using Json = nlohmann::json;

class Configure : public ::testing::Test {
 protected:
  [[nodiscard]] Outcome run(Words words) const {
    words.insert(words.begin(), "configure");
    words.insert(words.end(), {"--machine", machine, "--sim", plant});
    return berth(words);
  }
  std::string machine = example("configured.toml");
  std::string plant = example("configured.plant.toml");
};

TEST_F(Configure, CheckSaysWhatDiffersAndWritesNothing) {
  const Outcome check = run({"--check", "--json"});
  EXPECT_EQ(check.status, 1);
  const Json reply = Json::parse(check.out);
  ASSERT_EQ(reply.at("slots").size(), 3U);
  const auto& slot = reply.at("slots").at(0);
  EXPECT_EQ(slot.at("slot"), "pump 1");
  EXPECT_EQ(slot.at("result"), "differs");
  bool found = false;
  for (const auto& d : slot.at("differences")) {
    if (d.at("object") != "0x2000:01") continue;
    found = true;
    EXPECT_EQ(d.at("has"), "100 (0x64)");
    EXPECT_EQ(d.at("wants"), "500 (0x1F4)");
    EXPECT_GT(d.at("line").get<int>(), 0);
  }
  EXPECT_TRUE(found) << check.out;
  const Outcome words = run({"--check"});
  EXPECT_EQ(words.status, 1);
  EXPECT_NE(words.out.find("2000h:01 \"Limits: Upper pressure limit\": 100 (0x64) instead of 500 (0x1F4) (pump.dcf:"),
            std::string::npos)
      << words.out;
}

TEST_F(Configure, OneSlot) {
  const Outcome done = run({"pump 2", "--json"});
  EXPECT_EQ(done.status, 0) << done.out << done.err;
  const Json reply = Json::parse(done.out);
  ASSERT_EQ(reply.at("slots").size(), 1U);
  EXPECT_EQ(reply.at("slots").at(0).at("result"), "configured");
}

TEST_F(Configure, AfterUpEverythingIsRight) {
  const Outcome done = run({"--up", "--check"});
  EXPECT_EQ(done.status, 0) << done.out << done.err;
  EXPECT_NE(done.out.find("pump 1: right"), std::string::npos) << done.out;
}

TEST_F(Configure, APowerCycleIsNo) {
  const Outcome done = run({"booster"});
  EXPECT_EQ(done.status, 1) << done.out;
  EXPECT_NE(done.out.find("power cycle needed"), std::string::npos) << done.out;
}

TEST_F(Configure, WrongWordsAreUsage) {
  EXPECT_EQ(run({"nobody"}).status, 2);
  EXPECT_EQ(run({"--bus", "nowhere"}).status, 2);
  const Outcome none =
      berth({"configure", "--machine", example("five-slaves.toml"), "--sim", example("five-slaves.plant.toml")});
  EXPECT_EQ(none.status, 2);
  EXPECT_NE(none.err.find("config = "), std::string::npos) << none.err;
}

// A machine file whose configuration is for another type, or missing, is not used: file, line, column.
TEST_F(Configure, AWrongFileIsAnErrorOfTheMachineFile) {
  const Folder folder;
  std::string text = contents(machine);
  const auto replace = [&](const std::string& what, const std::string& by) {
    for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size())) {
      text.replace(at, what.size(), by);
    }
  };
  replace("eds/", folder.bring("eds/"));
  auto wrong = text;
  const auto booster = wrong.find("booster.dcf");
  ASSERT_NE(booster, std::string::npos);
  wrong.replace(booster, 11, "pump.dcf");
  const Outcome other = berth({"up", folder.write("other.toml", wrong), "--sim", plant});
  EXPECT_EQ(other.status, 2);
  EXPECT_NE(other.err.find("other.toml:"), std::string::npos) << other.err;
  EXPECT_NE(other.err.find("00000001-00000030"), std::string::npos) << other.err;
  replace("booster.dcf", "gone.dcf");
  const Outcome gone = berth({"up", folder.write("gone.toml", text), "--sim", plant});
  EXPECT_EQ(gone.status, 2);
  EXPECT_NE(gone.err.find("gone.dcf"), std::string::npos) << gone.err;
}

// The store keeps what waits for a power cycle, and the devices keep what they saved: over processes.
TEST_F(Configure, WhatWaitsForAPowerCycleIsKeptOverProcesses) {
  const Folder folder;
  const std::string store = folder.file("berth.db");
  const std::string state = folder.file("state");
  std::string text = contents(plant);
  text = text.substr(0, text.find("[[event]]"));  // nobody switches the booster off
  const auto eds = [&] {
    std::string all;
    for (std::size_t from = 0;;) {
      const auto at = text.find("eds/", from);
      all += text.substr(from, at - from);
      if (at == std::string::npos) return all;
      all += folder.bring("eds/");
      from = at + 4;
    }
  };
  const std::string quiet = folder.write("quiet.plant.toml", eds());
  const Outcome first = berth({"up", machine, "--sim", quiet, "--store", store, "--sim-state", state, "--json"});
  EXPECT_EQ(first.status, 1);
  const auto state_of = [](const Outcome& run, const std::string& name) {
    const Json report = Json::parse(run.out);
    for (const auto& slot : report.at("slots")) {
      if (slot.at("name") == name) return slot.at("state").get<std::string>();
    }
    return std::string();
  };
  EXPECT_EQ(state_of(first, "booster"), "power cycle needed") << first.out;
  EXPECT_EQ(state_of(first, "pump 1"), "operational");
  // The next process begins with devices that were without power meanwhile.
  const Outcome second = berth({"up", machine, "--sim", quiet, "--store", store, "--sim-state", state, "--json"});
  EXPECT_EQ(second.status, 0) << second.out << second.err;
  EXPECT_EQ(state_of(second, "booster"), "operational");
  EXPECT_EQ(second.out.find("writing"), std::string::npos) << "nothing is written a second time: " << second.out;
}

// ---- berth upload ---------------------------------------------------------------------------------------------------

TEST_F(Configure, S5_22_WhatADeviceHasBecomesAFileThatItsReplacementGets) {
  const Folder folder;
  const std::string dcf = folder.file("pump1.dcf");
  const Words upload{"upload", "pump 1", "--machine", machine, "--sim", plant, "--up", "-o", dcf};
  const auto with = [&](const Words& more) {
    Words words = upload;
    words.insert(words.end(), more.begin(), more.end());
    return berth(words);
  };
  const Outcome tried = with({"--dry-run"});
  EXPECT_EQ(tried.status, 0) << tried.err;
  EXPECT_NE(tried.out.find("would write " + dcf), std::string::npos) << tried.out;
  EXPECT_FALSE(std::ifstream(dcf).good()) << "nothing is written";
  const Outcome done = with({"--json"});
  ASSERT_EQ(done.status, 0) << done.err;
  const Json reply = Json::parse(done.out);
  EXPECT_EQ(reply.at("slot"), "pump 1");
  EXPECT_EQ(reply.at("file"), dcf);
  EXPECT_TRUE(reply.at("written").get<bool>());
  EXPECT_TRUE(reply.at("changes").empty()) << "it has what config = wants: " << done.out;
  EXPECT_FALSE(reply.contains("dcf")) << "that is in the file";
  const std::string text = contents(dcf);
  EXPECT_EQ(reply.at("bytes").get<std::size_t>(), text.size());
  // 500 is not the maker's value (100), but that of pump.dcf.
  const auto limit = text.find("[2000sub1]");
  ASSERT_NE(limit, std::string::npos);
  const auto value = text.find("ParameterValue=", limit);
  ASSERT_NE(value, std::string::npos);
  EXPECT_EQ(text.substr(value, 18), "ParameterValue=500") << text.substr(limit, 300);
  // What is there is kept, unless a person says so.
  const Outcome again = with({});
  EXPECT_EQ(again.status, 1) << again.out;
  EXPECT_NE(again.err.find(dcf), std::string::npos) << again.err;
  EXPECT_EQ(with({"--force"}).status, 0);
  EXPECT_EQ(contents(dcf), text);
  // Another machine with this file wants what the device has.
  std::string other = contents(machine);
  for (const std::string what : {"eds/pump.dcf", "eds/pump.eds", "eds/booster.dcf"}) {
    const auto at = other.find(what);
    ASSERT_NE(at, std::string::npos) << what;
    other.replace(at, what.size(), what == "eds/pump.dcf" ? dcf : folder.bring(what));
  }
  const std::string second = folder.write("second.toml", other);
  const Outcome check =
      berth({"configure", "pump 1", "--machine", second, "--sim", plant, "--up", "--check", "--json"});
  ASSERT_EQ(check.status, 0) << check.out << check.err;
  EXPECT_EQ(Json::parse(check.out).at("slots").at(0).at("result"), "right");
}

// S5.22, the network access interface: scan, verification, download, control of the network, LSS, one after the other
// on a machine that runs, each by what it does to the devices.
TEST_F(Configure, S5_22_ARunningNetworkIsScannedVerifiedAndControlled) {
  const Folder folder;
  const std::string socket = folder.file("up.sock");
  Background up({"up", machine, "--sim", plant, "--pace", "--control", socket});
  const auto ask = [&](Words words, int status) {
    words.insert(words.end(), {"--control", socket, "--json"});
    const Outcome outcome = berth(words);
    EXPECT_EQ(outcome.status, status) << words.front() << outcome.out << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  };
  const auto state_is = [&](const std::string& nmt) {
    return eventually([&] {
      const Outcome outcome = berth({"status", "--control", socket, "--json"});
      const Json status = Json::parse(outcome.out, nullptr, false);
      if (!status.contains("slots")) return false;
      const auto& slot = status.at("slots").at(0);
      return slot.at("name") == "pump 1" && slot.value("nmt", "") == nmt;
    });
  };
  ASSERT_TRUE(state_is("operational"));
  const Json devices = ask({"scan"}, 0).at("nodes");
  const auto pump = std::ranges::find_if(devices, [](const Json& d) { return d.at("id") == 1; });
  ASSERT_NE(pump, devices.end()) << devices;
  EXPECT_EQ(pump->at("type"), "0x0000000100000030");
  EXPECT_EQ(pump->at("slot"), "pump 1");
  const auto result = [&](const Json& reply) { return reply.at("slots").at(0).at("result"); };
  EXPECT_EQ(result(ask({"configure", "pump 1", "--check"}, 0)), "right");
  ask({"sdo", "write", "pump 1", "2000h:01", "123"}, 0);
  const Json wrong = ask({"configure", "pump 1", "--check"}, 1);
  EXPECT_EQ(result(wrong), "differs");
  const Json difference = wrong.at("slots").at(0).at("differences").at(0);
  EXPECT_EQ(difference.at("object"), "0x2000:01");
  EXPECT_EQ(difference.at("has"), "123 (0x7B)");
  EXPECT_EQ(difference.at("wants"), "500 (0x1F4)");
  ask({"nmt", "preop", "pump 1"}, 0);
  EXPECT_TRUE(state_is("pre-operational"));
  EXPECT_EQ(result(ask({"configure", "pump 1"}, 0)), "configured");
  EXPECT_EQ(ask({"sdo", "read", "pump 1", "2000h:01"}, 0).at("value"), 500);
  ask({"nmt", "start", "pump 1"}, 0);
  EXPECT_TRUE(state_is("operational"));
  EXPECT_EQ(ask({"sdo", "read", "pump 1", "2000h:01"}, 0).at("value"), 500);
  EXPECT_TRUE(eventually([&] { return berth({"status", "--control", socket}).status == 0; }));
  ask({"lss", "identify-unconfigured"}, 1);  // each has its node-ID
}

// A user's file replaces `config =`: the running device is left alone until it is restarted, and the next `berth up`
// knows it.
TEST_F(Configure, AnotherConfigurationFromAFile) {
  const Folder folder;
  std::string text = contents(example("eds/pump.dcf"));
  const std::string old = "ParameterValue=500";
  ASSERT_NE(text.find(old), std::string::npos);
  text.replace(text.find(old), old.size(), "ParameterValue=640");
  const std::string dcf = folder.write("new.dcf", text);
  const std::string socket = folder.file("control");
  const Words up{"up", machine, "--sim", plant, "--pace", "--store", folder.file("a.db"), "--control", socket};
  const auto ask = [&](Words words) {
    words.insert(words.end(), {"--control", socket, "--json"});
    return berth(words);
  };
  const auto runs = [&] {
    return eventually([&] {
      const Json told = Json::parse(ask({"status", "pump 1"}).out, nullptr, false);
      return told.is_object() && told.value("state", "") == "operational";
    });
  };
  const auto limit = [&] { return Json::parse(ask({"sdo", "read", "pump 1", "2000h:01"}).out).at("value"); };
  {
    const Background running(up);
    ASSERT_TRUE(runs());
    const Outcome unfit = ask({"configure", "pump 1", "--from", example("eds/booster.dcf")});
    EXPECT_EQ(unfit.status, 1);
    EXPECT_NE(unfit.out.find("nothing has changed"), std::string::npos) << unfit.out;
    EXPECT_EQ(ask({"configure", "--from", dcf}).status, 2) << "of which slot?";
    EXPECT_EQ(ask({"configure", "pump 1", "--from", dcf, "--check"}).status, 2);
    EXPECT_EQ(ask({"configure", "pump 1", "--from", folder.file("none.dcf")}).status, 2);
    EXPECT_EQ(limit(), 500);
    const Outcome kept = ask({"configure", "pump 1", "--from", dcf});
    EXPECT_EQ(kept.status, 1) << "the device runs and is left alone";
    EXPECT_EQ(limit(), 500);
    const Outcome restarted = ask({"configure", "pump 1", "--restart"});
    EXPECT_EQ(restarted.status, 0) << restarted.out << restarted.err;
    EXPECT_EQ(Json::parse(restarted.out).at("slots").at(0).at("result"), "configured");
    EXPECT_EQ(limit(), 640);
    EXPECT_TRUE(exists(folder.file("a.db-written/configured.water.pump%201.dcf")));
    EXPECT_FALSE(exists(folder.file("a.db-written/configured.water.pump%202.dcf"))) << "the other pump keeps its own";
  }
  const Background again(up);
  ASSERT_TRUE(runs());
  EXPECT_EQ(limit(), 640) << "kept beside the slot table";
  const Outcome restarted = ask({"configure", "pump 1", "--from", example("eds/pump.dcf"), "--restart"});
  EXPECT_EQ(restarted.status, 0) << restarted.out << restarted.err;
  EXPECT_EQ(limit(), 500);
}

TEST_F(Configure, AnUploadThatCannotBeSaysWhy) {
  const Outcome nobody = berth({"upload", "nobody", "--machine", machine, "--sim", plant, "--up"});
  EXPECT_EQ(nobody.status, 2);
  EXPECT_NE(nobody.err.find("nobody"), std::string::npos) << nobody.err;
  const Outcome silent = berth({"upload", "pump 1", "--machine", machine, "--sim", plant});
  EXPECT_EQ(silent.status, 1) << "no device has a node-ID yet";
  EXPECT_NE(silent.err.find("its identity cannot be read"), std::string::npos) << silent.err;
  const Outcome unknown =
      berth({"upload", "1", example("five-slaves.toml"), "--sim", example("five-slaves.plant.toml"), "--up"});
  EXPECT_EQ(unknown.status, 1);
  EXPECT_NE(unknown.err.find("eds = of the slot"), std::string::npos) << unknown.err;
  const Folder folder;
  std::string text = contents(machine);
  const std::string config = "config = \"eds/pump.dcf\"\n";
  ASSERT_NE(text.find(config), std::string::npos);
  text.erase(text.find(config), config.size());
  for (const std::string what : {"eds/pump.eds", "eds/booster.dcf"})
    text.replace(text.find(what), what.size(), folder.bring(what));
  const Outcome nowhere = berth({"upload", "pump 1", folder.write("plain.toml", text), "--sim", plant, "--up"});
  EXPECT_EQ(nowhere.status, 2);
  EXPECT_NE(nowhere.err.find("--output FILE.dcf"), std::string::npos) << nowhere.err;
}

}  // namespace
}  // namespace berth::test

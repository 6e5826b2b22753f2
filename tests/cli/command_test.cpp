// Single commands in a world of their own, wrong input.
#include <gtest/gtest.h>
#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "berth/can/frame.hpp"
#include "command_fixture.hpp"

namespace berth::test {
namespace {

TEST_F(Command, UpIsQuietWhenItIsTold) {
  const Outcome loud = berth({"up", machine, "--sim", plant});
  const Outcome quiet = berth({"up", machine, "--sim", plant, "-q"});
  EXPECT_EQ(quiet.status, 0) << quiet.err;
  EXPECT_TRUE(contains(loud.out, "discovery:") && contains(loud.out, "bus ")) << loud.out;
  EXPECT_FALSE(contains(quiet.out, "discovery:")) << quiet.out;
  EXPECT_TRUE(contains(quiet.out, "operational")) << "the slot table: " << quiet.out;
}

// Two devices of one type that came with the node-IDs of its slots, against the order of their serial numbers: the
// machine was commissioned before, and keeps its order (docs/machine-file.md, `ascending`).
TEST_F(Command, UpKeepsTheOrderOfACommissionedMachine) {
  std::string text(small_plant);
  for (const auto& [serial, id] : {std::pair("0x21", 2), std::pair("0x20", 3)}) {
    const std::string line = std::string("serial = ") + serial + "\n";
    text.insert(text.find(line), "node_id = " + std::to_string(id) + "\n");
  }
  const Outcome outcome = berth({"up", machine, "--sim", folder.write("swapped.toml", text), "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.out << outcome.err;
  const Json slots = Json::parse(outcome.out).at("slots");
  EXPECT_EQ(slots.at(0).at("r_sn"), "0x0000000000000021");
  EXPECT_EQ(slots.at(1).at("r_sn"), "0x0000000000000020");
}

// Words that a newcomer tried, and what would have helped.
TEST_F(Command, WhatOtherVerbsCallOtherwiseIsMeant) {
  const Outcome up = berth({"up", machine, "--sim", plant, "--for", "3 s"});
  EXPECT_EQ(up.status, 2);
  EXPECT_TRUE(contains(up.err, "did you mean --timeout?")) << up.err;
  const Outcome trace = berth({"trace", "-m", machine});
  EXPECT_EQ(trace.status, 3);
  EXPECT_TRUE(contains(trace.err, "start `berth up`")) << trace.err;
  EXPECT_TRUE(contains(berth({"stat"}).err, "did you mean status?"));
  EXPECT_FALSE(contains(berth({"st"}).err, "did you mean")) << "status, studio";
  EXPECT_TRUE(contains(berth({"up"}).err, "berth init")) << "a folder without a machine";
}

TEST_F(Command, MemoryOfTheDevicesNeedsAPlaceForAFile) {
  for (const char* place : {"/tmp", "/no such folder/state"}) {
    const Outcome outcome = berth({"up", machine, "--sim", plant, "--sim-state", place});
    EXPECT_EQ(outcome.status, 3) << outcome.err;
    EXPECT_TRUE(contains(outcome.err, place)) << outcome.err;
  }
}

// ---- services ----

// It only reports, so that those found go on answering; 120 are asked for between all others within its time limit.
TEST_F(Command, AScanOfManyBlankDevicesEnds) {
  for (const auto* const devices : {"sixty", "hundred-twenty"}) {
    std::string plant_file = example("hundred-twenty.plant.toml");
    if (std::string(devices) == "sixty") {
      plant_file =
          folder.write("sixty.plant.toml",
                       "[bus.field]\n[[device]]\nbus = \"field\"\nname = \"d {n}\"\ncount = 60\nserial_first = "
                       "0x10005\nserial_step = 3\ntype = { vendor = 1, product = 1, revision = 0x10000 }\n");
    }
    const Outcome outcome =
        berth({"scan", "--all", "--machine", example("hundred-twenty.toml"), "--sim", plant_file, "--json"});
    ASSERT_EQ(outcome.status, 0) << devices << outcome.out;
    EXPECT_EQ(Json::parse(outcome.out).at("unconfigured"), std::string(devices) == "sixty" ? 60 : 120) << devices;
  }
}

// 300 ms are within the SDO timeout: each is shown with its identity, whether it is heard or silent.
TEST_F(Command, AScanWaitsForSlowAnswers) {
  std::string slow = "[bus.line]\n";
  for (const std::string serial : {"1", "2"}) {
    slow += "[[device]]\nbus = \"line\"\nname = \"d" + serial +
            "\"\ntype = { vendor = 1, product = 9 }\nserial = " + serial + "\nnode_id = 5" + serial +
            "\nresponse = \"300 ms\"\n" + (serial == "1" ? "heartbeat = \"500 ms\"\n" : "");
  }
  const std::string file = folder.write("slow.plant.toml", slow);
  for (const bool all : {false, true}) {
    Words words{"scan", "--machine", machine, "--sim", file, "--json"};
    if (all) words.emplace_back("--all");
    const Outcome outcome = berth(words);
    ASSERT_EQ(outcome.status, 0) << outcome.out;
    const Json nodes = Json::parse(outcome.out).at("nodes");
    ASSERT_EQ(nodes.size(), 2U) << outcome.out;
    for (const auto& node : nodes) EXPECT_TRUE(node.contains("address")) << outcome.out;
  }
}

TEST_F(Command, ScanSeesBlankAndConfiguredDevices) {
  const Json blank = reply({"scan", "--all"}, 0);
  EXPECT_EQ(blank.at("configured"), 0);
  EXPECT_EQ(blank.at("unconfigured"), 3);
  for (const auto& node : blank.at("nodes")) EXPECT_TRUE(node.at("id").is_null());
  const Json silent = reply({"scan"}, 0);
  EXPECT_EQ(silent.at("nodes").size(), 0U) << "without a node-ID a device says nothing, and nobody is asked";
  EXPECT_EQ(silent.at("asked"), "heard");
  const Json configured = reply({"scan"}, 0, true);
  EXPECT_EQ(configured.at("configured"), 3);
  EXPECT_EQ(configured.at("unconfigured"), 0);
  EXPECT_EQ(configured.at("nodes").at(0).at("id"), 2);
  EXPECT_EQ(configured.at("nodes").at(0).at("slot"), "left");
  EXPECT_EQ(configured.at("nodes").at(0).at("r_sn"), "0x0000000000000020");
}

TEST_F(Command, ScanNamesDuplicates) {
  const std::string text = R"([bus.line]
[[device]]
bus = "line"
name = "x"
type = { vendor = 1, product = 1 }
serial = 1
source = "switches"
node_id = 2
response = "1 ms"
[[device]]
bus = "line"
name = "y"
type = { vendor = 1, product = 1 }
serial = 2
source = "switches"
node_id = 2
response = "3 ms"
)";
  const std::string clones = folder.write("clones.toml", text);
  const Outcome outcome = berth({"scan", "--machine", machine, "--sim", clones, "--json"});
  EXPECT_EQ(outcome.status, 1) << outcome.out << outcome.err;
  EXPECT_GE(Json::parse(outcome.out).at("duplicates").get<int>(), 1);
}

TEST_F(Command, BindSeatsWithoutStarting) {
  const Json report = reply({"bind"}, 0);
  for (const auto& slot : report.at("slots")) EXPECT_EQ(slot.at("state"), "present") << slot;
  EXPECT_EQ(report.at("slots").at(0).at("r_sn"), "0x0000000000000020");
}

TEST_F(Command, SdoReadsAndWritesWithTypes) {
  EXPECT_EQ(reply({"sdo", "read", "9", "0x1018", "3", "--type", "u32"}, 0, true).at("value"), 3);
  const Json raw = reply({"sdo", "read", "9", "0x1018", "4"}, 0, true);
  EXPECT_EQ(raw.at("bytes"), "30 00 00 00");
  EXPECT_EQ(raw.at("index"), "0x1018");
  EXPECT_EQ(reply({"sdo", "write", "9", "0x1017", "0", "0x1F4", "--type", "u16"}, 0, true).at("bytes"), "F4 01");
  EXPECT_EQ(reply({"sdo", "write", "9", "0x1017", "0", "F4 01"}, 0, true).at("bytes"), "F4 01");
}

// No bytes are a value, and block transfer can be wanted.
TEST_F(Command, SdoOfNoBytesAndByBlockTransfer) {
  EXPECT_EQ(reply({"sdo", "write", "9", "0x1017", "0", "500", "--type", "u16", "--block"}, 0, true).at("bytes"),
            "F4 01");
  EXPECT_EQ(reply({"sdo", "read", "9", "0x1017", "0", "--type", "u16", "--block"}, 0, true).at("value"), 100);
  const Words world{"-t", "u16", "--block", "--dry-run", "--up", "--machine", machine, "--sim", plant};
  const auto sent = [&](Words words) {
    words.insert(words.end(), world.begin(), world.end());
    return berth(words).out;
  };
  EXPECT_TRUE(contains(sent({"sdo", "write", "9", "0x1017", "0", "500"}), " 609#C617100002000000"))
      << "CiA 301 §7.2.4.3.9: ccs 6, with CRC and size, two bytes";
  EXPECT_TRUE(contains(sent({"sdo", "read", "9", "0x1017", "0"}), " 609#A41710007F000000"))
      << "§7.2.4.3.13: ccs 5, with CRC, blocks of 127";
  const Json nothing = reply({"sdo", "write", "9", "0x1017", "0", ""}, 1, true).at("error");
  EXPECT_EQ(nothing.at("abort_code"), "0x06070013") << "it went to the device, whose object has two bytes";
  EXPECT_EQ(reply({"sdo", "write", "9", "0x1017", "0", "", "-t", "u16"}, 2, true).at("error").is_object(), true);
}

TEST_F(Command, SdoFailuresSayWhereAndWhy) {
  const Json missing = reply({"sdo", "read", "9", "0x7777", "1"}, 1, true).at("error");
  EXPECT_EQ(missing.at("code"), "aborted");
  EXPECT_EQ(missing.at("node"), 9);
  EXPECT_EQ(missing.at("object"), "0x7777:01");
  EXPECT_EQ(missing.at("abort_code"), "0x06020000");
  EXPECT_EQ(missing.at("text"), "object does not exist");
  const Json read_only = reply({"sdo", "write", "9", "0x1018", "1", "1", "-t", "u32"}, 1, true).at("error");
  EXPECT_EQ(read_only.at("abort_code"), "0x06010002");
  EXPECT_EQ(reply({"sdo", "read", "44", "0x1000"}, 1, true).at("error").at("code"), "timeout");
  const Json length = reply({"sdo", "read", "9", "0x1018", "4", "-t", "u16"}, 1, true).at("error");
  EXPECT_TRUE(contains(length.at("message"), "has 4 bytes")) << length;
}

TEST_F(Command, WrongArgumentsAreExitTwo) {
  for (const Words& words : std::vector<Words>{
           {"sdo", "read", "0", "0x1000"},
           {"sdo", "read", "128", "0x1000"},
           {"sdo", "read", "127", "0x1000"},  // Berth's own
           {"sdo", "read", "3//5", "0x1000"},
           {"sdo", "read", "five", "0x1000"},
           {"sdo", "read", "2", "0x10000"},
           {"sdo", "read", "2", "0x1000", "256"},
           {"sdo", "read", "2", "0x1000", "0", "-t", "u31"},
           {"sdo", "write", "2", "0x1017", "0", "65536", "-t", "u16"},
           {"sdo", "write", "2", "0x1017", "0", "-1", "-t", "u16"},
           {"sdo", "write", "2", "0x1017", "0", "xyz"},
           {"nmt", "begin", "2"},
           {"nmt", "start", "0"},
           {"nmt", "start", "everybody"},
           {"lss", "select", "1-2-3"},
           {"lss", "set-node-id", left, "128"},
           {"lss", "set-node-id", left, "127"},  // Berth's own
           {"lss", "bit-timing", "100000"},
           {"lss", "inquire", left, "--part", "name"},
           {"sdo", "read", "2", "0x1000", "--sdo-timeout", "0"},
           {"lss", "activate", "65536"},
           {"lss", "global", "asleep"},
           {"lss", "identify", "1"},
           {"replace", "middle"},
           {"replace", "left", "--device", "nobody"},
           {"scan", "--bus", "other"},
           {"scan", "--timeout", "soon"},
           {"scan", "--seed", "-3"},
           {"scan", "--frob"},
           {"sdo"},
           {"frobnicate"},
       }) {
    std::string shown;
    for (const auto& word : words) shown += word + " ";
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.status, 2) << shown << outcome.out << outcome.err;
    const Json json = Json::parse(outcome.out, nullptr, false);
    ASSERT_TRUE(json.is_object() && json.contains("error")) << shown << outcome.out;
    EXPECT_FALSE(json.at("error").at("message").get<std::string>().empty()) << shown;
  }
}

TEST_F(Command, Nmt) {
  const Json all = reply({"nmt", "stop", "all"}, 0);
  EXPECT_EQ(all.at("node"), "all");
  for (const char* const word : {"start", "stop", "preop", "reset-node", "reset-comm"}) {
    EXPECT_EQ(reply({"nmt", word, "2"}, 0, true).at("command"), word);
  }
}

TEST_F(Command, LssServices) {
  const Json inquired = reply({"lss", "inquire", "00000001-00000007-00000003-00000030"}, 0);
  EXPECT_EQ(inquired.at("vendor"), "0x00000001");
  EXPECT_EQ(inquired.at("product"), "0x00000007");
  EXPECT_EQ(inquired.at("revision"), "0x00000003");
  EXPECT_EQ(inquired.at("serial"), "0x00000030");
  EXPECT_EQ(inquired.at("node_id"), 255);
  const Json part = reply({"lss", "inquire", left, "--part", "serial"}, 0);
  EXPECT_EQ(part.at("serial"), "0x00000020");
  EXPECT_FALSE(part.contains("vendor"));
  EXPECT_EQ(reply({"lss", "inquire", left, "--part", "node-id"}, 0).at("node_id"), 255);
  EXPECT_EQ(reply({"lss", "inquire", left, "--part", "address"}, 0).at("address"), left);
  EXPECT_EQ(reply({"lss", "identify-unconfigured"}, 0).at("anybody"), true);
  EXPECT_EQ(reply({"lss", "bit-timing", "auto", left}, 1, true).at("error").at("message").get<std::string>().empty(),
            false);
  EXPECT_EQ(reply({"lss", "select", left}, 0).at("address"), left);
  static_cast<void>(reply({"lss", "select", "00000001-00000001-00000000-00000099"}, 1));
  EXPECT_EQ(reply({"lss", "set-node-id", left, "9", "--save"}, 0).at("stored"), true);
  EXPECT_EQ(reply({"lss", "store", left}, 0).at("service"), "store");
  EXPECT_EQ(reply({"lss", "bit-timing", "125000", left}, 0).at("index"), 4);
  EXPECT_EQ(reply({"lss", "activate", "100"}, 0).at("delay_ms"), 100);
  EXPECT_EQ(reply({"lss", "global", "configuration"}, 0).at("state"), "configuration");
  EXPECT_EQ(reply({"lss", "identify", "1", "7"}, 0).at("anybody"), true);
  EXPECT_EQ(reply({"lss", "identify", "1", "7", "--serial-high", "0x2F"}, 1).at("anybody"), false);
  const Json found = reply({"lss", "find"}, 0);
  EXPECT_EQ(found.at("devices").size(), 3U);
  EXPECT_EQ(found.at("unconfigured_lss"), true);
}

// Two devices with distinct LSS addresses never get one node-ID from Berth, by hand neither.
TEST_F(Command, LssSetNodeIdRefusesOneThatIsInUse) {
  const Json refused = reply({"lss", "set-node-id", left, "3"}, 1, true);
  EXPECT_TRUE(contains(refused.at("error").at("message"), "another device answers")) << refused;
  EXPECT_EQ(reply({"lss", "set-node-id", left, "2"}, 0, true).at("node_id"), 2) << "its own is no conflict";
}

// ---- roles ----

TEST_F(Command, ObserverSendsNothingAndCommissionerStartsNothing) {
  const auto with_role = [&](const std::string& role) {
    std::string text = small_machine;
    text.replace(text.find("bitrate ="), 0, "role = \"" + role + "\"\n");
    return folder.write(role + ".toml", text);
  };
  const std::string observer = with_role("observer");
  for (const Words& words : std::vector<Words>{{"scan"},
                                               {"bind"},
                                               {"nmt", "stop", "all"},
                                               {"lss", "find"},
                                               {"sdo", "read", "2", "0x1000"},
                                               {"replace", "left"}}) {
    Words all = words;
    all.insert(all.end(), {"--machine", observer, "--sim", plant, "--dry-run", "--json"});
    const Outcome outcome = berth(all);
    EXPECT_EQ(outcome.status, 2) << words.front() << outcome.out << outcome.err;
    EXPECT_TRUE(Json::parse(outcome.out).at("frames").empty()) << outcome.out;
  }
  const std::string commissioner = with_role("commissioner");
  EXPECT_EQ(berth({"nmt", "start", "2", "--machine", commissioner, "--sim", plant}).status, 2);
  EXPECT_EQ(berth({"nmt", "reset-node", "2", "--machine", commissioner, "--sim", plant}).status, 2);
  EXPECT_EQ(berth({"nmt", "preop", "2", "--machine", commissioner, "--sim", plant}).status, 0);
  EXPECT_EQ(berth({"lss", "find", "--machine", commissioner, "--sim", plant}).status, 0);
}

// ---- dry runs ----

TEST_F(Command, DryRunPrintsTheFramesOfTheCommand) {
  const Json dry = reply({"nmt", "start", "3", "--dry-run"}, 0);
  ASSERT_EQ(dry.at("frames").size(), 1U) << dry;
  EXPECT_EQ(dry.at("frames").at(0).at("frame"), "000#0103");
  const Outcome select = berth({"lss", "select", left, "--machine", machine, "--sim", plant, "--dry-run"});
  EXPECT_TRUE(contains(select.out, "line 7E5#0400000000000000\n")) << select.out;
  EXPECT_TRUE(contains(select.out, "line 7E5#4320000000000000\n")) << select.out;
  EXPECT_FALSE(contains(select.out, "7E4#")) << "only what Berth sends";
}

TEST_F(Command, DryRunLeavesStoreAndPlantAsTheyAre) {
  const std::string store = folder.file("slots.db");
  const std::string state = folder.file("plant.state");
  ASSERT_EQ(
      berth({"up", machine, "--sim", plant, "--store", store, "--sim-state", state, "--until", "operational"}).status,
      0);
  const std::string before = contents(store) + contents(state);
  const Outcome dry = berth({"lss", "set-node-id", left, "55", "--save", "--machine", machine, "--sim", plant,
                             "--store", store, "--sim-state", state, "--dry-run"});
  EXPECT_EQ(dry.status, 0) << dry.err;
  EXPECT_TRUE(contains(dry.out, "7E5#1137")) << dry.out;
  EXPECT_EQ(before, contents(store) + contents(state));
}

// What a running `berth up` would be asked to send is told only when it is known in advance.
TEST_F(Command, DryRunWithoutAWorld) {
  const auto dry = [&](Words words) {
    words.insert(words.end(), {"--machine", machine, "--dry-run"});
    return berth(words);
  };
  EXPECT_EQ(dry({"nmt", "reset-comm", "all"}).out, "000#8200\n");
  EXPECT_EQ(dry({"sdo", "read", "5", "0x1018", "4"}).out, "605#4018100400000000\n");
  EXPECT_EQ(dry({"sdo", "write", "5", "0x1017", "0", "500", "-t", "u16"}).out, "605#2B171000F4010000\n");
  EXPECT_EQ(dry({"sdo", "write", "5", "0x1016", "1", "1", "-t", "u8"}).out, "605#2F16100101000000\n");
  EXPECT_EQ(dry({"lss", "global", "configuration"}).out, "7E5#0401000000000000\n");
  EXPECT_EQ(dry({"lss", "activate", "1000"}).out, "7E5#15E8030000000000\n");
  for (const Words& words : std::vector<Words>{{"scan"},
                                               {"bind"},
                                               {"replace", "left"},
                                               {"lss", "find"},
                                               {"sdo", "write", "5", "0x1008", "0", "a long text", "-t", "vs"}}) {
    const Outcome refused = dry(words);
    EXPECT_EQ(refused.status, 2) << words.front();
    EXPECT_TRUE(contains(refused.err, "--sim PLANT")) << refused.err;
  }
}

// ---- wrong files ----

TEST_F(Command, BadMachineFilesNameThePlace) {
  struct Bad {
    const char* from;
    const char* to;
    const char* place;
  };
  for (const Bad& bad : {Bad{"bitrate =", "bitrat =", ":6:1"}, Bad{"500_000", "\"fast\"", ":6:11"},
                         Bad{"id   = 3", "id   = 2", ":22:8"}, Bad{"id   = 3", "id   = 128", ":22:8"},
                         Bad{"id   = 3", "id   = 0", ":22:8"}, Bad{"[machine]", "[machine", ":1:"}}) {
    std::string text = small_machine;
    text.replace(text.find(bad.from), std::string(bad.from).size(), bad.to);
    const std::string file = folder.write("bad.toml", text);
    const std::string store = folder.file("never.db");
    const Outcome outcome = berth({"up", file, "--sim", plant, "--store", store});
    EXPECT_EQ(outcome.status, 2) << bad.to;
    EXPECT_TRUE(contains(outcome.err, file + bad.place)) << bad.to << ": " << outcome.err;
    EXPECT_TRUE(outcome.out.empty()) << outcome.out;
    EXPECT_FALSE(exists(store)) << "nothing changed";
    const Json json = Json::parse(berth({"up", file, "--sim", plant, "--json"}).out);
    EXPECT_GT(json.at("error").at("findings").at(0).at("line").get<int>(), 0) << json;
  }
}

TEST_F(Command, BadPlantFilesNameThePlace) {
  std::string text = small_plant;
  text.replace(text.find("serial = 0x30"), 6, "serail");
  const std::string bad = folder.write("bad-plant.toml", text);
  const Outcome outcome = berth({"up", machine, "--sim", bad});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_TRUE(contains(outcome.err, bad + ":24:1")) << outcome.err;
}

TEST_F(Command, MissingFilesAreExitTwo) {
  const Folder elsewhere;  // where no plant file is beside it
  const std::string alone = elsewhere.write("machine.toml", contents(machine));
  for (const Words& words : std::vector<Words>{{"up", folder.file("none.toml"), "--sim", plant},
                                               {"up", machine, "--sim", folder.file("none.toml")},
                                               {"scan", "--machine", folder.file("none.toml")},
                                               {"up", alone},
                                               {"up"},
                                               {"scan"}}) {
    const Outcome outcome = berth(words);
    EXPECT_EQ(outcome.status, 2) << words.back() << outcome.err;
    EXPECT_FALSE(outcome.err.empty());
  }
}

TEST_F(Command, FilesThatCannotBeWrittenAreExitThree) {
  EXPECT_EQ(berth({"up", machine, "--sim", plant, "--store", folder.file("no/such/folder.db")}).status, 3);
  EXPECT_EQ(berth({"up", machine, "--sim", plant, "--record", folder.file("no/such/folder.log")}).status, 3);
  const std::string foreign = folder.write("foreign.db", "this is no slot table");
  EXPECT_EQ(berth({"up", machine, "--sim", plant, "--store", foreign}).status, 3);
  EXPECT_EQ(contents(foreign), "this is no slot table");
}

TEST_F(Command, ARecordIsNamedAsWhatItIs) {
  for (const char* const other : {"run.asc", "run.trc", "run.pcapng"}) {
    const Outcome outcome = berth({"up", machine, "--sim", plant, "--record", folder.file(other)});
    EXPECT_EQ(outcome.status, 2) << other;
    EXPECT_TRUE(contains(outcome.err, "berth trace " + folder.file("run.log") + " -o " + folder.file(other)))
        << outcome.err;
  }
}

TEST_F(Command, RealPortsAreRefusedInWords) {
  std::string text = small_machine;
  text.replace(text.find("\"sim\""), 5, "\"socketcan:can0\"");
  const std::string real = folder.write("real.toml", text);
  const Outcome outcome = berth({"up", real});
  EXPECT_EQ(outcome.status, 3);
  EXPECT_TRUE(contains(outcome.err, "socketcan:can0")) << outcome.err;
  for (const Words& worldly : {Words{"--fast"}, Words{"--sim-state", folder.file("state")}}) {
    Words words{"up", real};
    words.insert(words.end(), worldly.begin(), worldly.end());
    const Outcome refused = berth(words);
    EXPECT_EQ(refused.status, 2) << "no simulated world stands behind a real port";
    EXPECT_TRUE(contains(refused.err, worldly.front() + " needs a world of this process")) << refused.err;
  }
  EXPECT_EQ(berth({"up", real, "--sim", plant, "--until", "operational"}).status, 0)
      << "the same file on a simulated bus";
}

}  // namespace
}  // namespace berth::test

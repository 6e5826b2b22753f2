// `berth demo`, `berth up`: the main job from the outside.
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>
#include <algorithm>
#include <string>
#include <vector>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "../pages.hpp"
#include "../paths.hpp"
#include "berth/can/frame.hpp"
#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using Json = nlohmann::json;

std::map<std::string, std::string> r_sn_by_slot(const Json& report) {
  std::map<std::string, std::string> all;
  for (const auto& slot : report.at("slots")) all[slot.at("name")] = slot.at("r_sn").is_null() ? "" : slot.at("r_sn");
  return all;
}

bool all_operational(const Json& report) {
  return std::ranges::all_of(report.at("slots"), [](const Json& s) { return s.at("state") == "operational"; });
}

const std::map<std::string, std::string> table_1{{"s1", "0x000000000000000A"},
                                                 {"s2", "0x0000000000000005"},
                                                 {"s3", "0x0000000000000008"},
                                                 {"s4", "0x0000000000000006"},
                                                 {"s5", "0x0000000000000007"}};
const std::map<std::string, std::string> table_2{{"s1", "0x000000000000000A"},
                                                 {"s2", "0x0000000000000015"},
                                                 {"s3", "0x0000000000000008"},
                                                 {"s4", "0x0000000000000018"},
                                                 {"s5", "0x0000000000000007"}};

// What the README shows is what one gets.
TEST(Demo, PrintsWhatTheReadmeShows) {
  const std::string readme = contents(berth::test::source_dir() + "/README.md");
  const std::string fence = "```text\n";
  const auto begin = readme.find(fence) + fence.size();
  const std::string shown = readme.substr(begin, readme.find("```", begin) - begin);
  EXPECT_EQ(difference(shown, berth({"demo"}).out), std::nullopt);
  std::istringstream lines(shown);
  int count = 0;
  for (std::string line; std::getline(lines, line); ++count) {
    if (line.starts_with("field  ")) {
      EXPECT_LE(line.size(), 80U) << "a terminal cuts off: " << line;
    }
  }
  EXPECT_GT(count, 10);
}

// S1.38, S1.51: paper 1's Table II.
TEST(Demo, S1_38_S1_51_EndsInTableTwo) {
  const Outcome run = berth({"demo", "--until", "replaced", "--json"});
  ASSERT_EQ(run.status, 0) << run.err;
  const Json report = Json::parse(run.out);
  EXPECT_EQ(report.at("slots").size(), 5U);
  EXPECT_EQ(r_sn_by_slot(report), table_2);
  EXPECT_TRUE(all_operational(report));
  EXPECT_TRUE(run.err.empty()) << run.err;
}

// S1.49: the five are found and started; Table I's devices in the order of rule 2.
TEST(Demo, S1_49_UntilOperationalEndsAfterTheFirstStart) {
  const Outcome run = berth({"demo", "--until", "operational", "--json"});
  ASSERT_EQ(run.status, 0) << run.err;
  const Json report = Json::parse(run.out);
  EXPECT_EQ(r_sn_by_slot(report), table_1);
  EXPECT_TRUE(all_operational(report));
}

TEST(Demo, JsonHasTheShapeThatIsPromised) {
  const Json report = Json::parse(berth({"demo", "--json"}).out);
  ASSERT_EQ(report.size(), 3U);
  for (const auto& slot : report.at("slots")) {
    EXPECT_EQ(slot.at("bus"), "field");
    EXPECT_TRUE(slot.at("id").is_number_integer());
    EXPECT_TRUE(slot.at("name").is_string());
    EXPECT_EQ(slot.at("type").get<std::string>().size(), 18U);
    EXPECT_TRUE(slot.at("since_s").is_number());
  }
  EXPECT_GT(report.at("bus_time_s").at("field").get<double>(), 1.0);
  ASSERT_FALSE(report.at("events").empty());
  for (const auto& event : report.at("events")) {
    EXPECT_TRUE(event.at("at_s").is_number() && event.at("kind").is_string() && event.at("text").is_string());
  }
}

TEST(Demo, InAPipePlainLinesAndAnEndByItself) {
  const Outcome run = berth({"demo"});
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(run.out.find('\x1b'), std::string::npos);
  EXPECT_NE(run.out.find("00000018"), std::string::npos);
  EXPECT_NE(run.out.find("absent"), std::string::npos) << "the failure of s2 and s4 is noticed";
}

TEST(Demo, OnATerminalALiveTableInRealTime) {
  const Folder folder;
  Background demo({"demo", "--until", "operational", "--control", folder.file("demo.sock")}, OnTerminal{});
  const Outcome run = demo.end();
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.out.find("\x1b["), std::string::npos) << "the table is drawn anew in place";
  EXPECT_NE(run.out.find("on the bus"), std::string::npos);
  EXPECT_NE(run.out.find("bound to 00000001-00000001-00000000-00000005 as node-ID 2"), std::string::npos);
}

TEST(Demo, IsTheExample) {
  const Outcome demo = berth({"demo", "--json"});
  const Outcome example_run =
      berth({"up", example("five-slaves.toml"), "--sim", example("five-slaves.plant.toml"), "--json"});
  EXPECT_EQ(demo.status, 0);
  EXPECT_EQ(demo.out, example_run.out);
}

TEST(Demo, TakesNoFiles) { EXPECT_EQ(berth({"demo", "--machine", "x.toml"}).status, 2); }

// Every machine in examples/ comes up on its plant.
TEST(Examples, AllEndOperational) {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(example(""))) {
    const std::string file = entry.path().string();
    if (!file.ends_with(".plant.toml") || file.ends_with("/ailing.plant.toml")) continue;  // a patient for the doctor
    const std::string machine_file = file.substr(0, file.size() - std::string(".plant.toml").size()) + ".toml";
    if (!std::filesystem::exists(machine_file)) continue;  // devices that agree without a master
    const Outcome run = berth({"up", machine_file, "--sim", file, "--until", "operational", "--json"});
    EXPECT_EQ(run.status, 0) << file << run.err;
    EXPECT_TRUE(all_operational(Json::parse(run.out))) << file;
    ++count;
  }
  EXPECT_GE(count, 3U) << "five slaves, 120 slaves, slots that name device descriptions";
}

class Up : public ::testing::Test {
 protected:
  Folder folder;
  std::string machine = folder.write("machine.toml", small_machine);
  std::string plant = folder.write("plant.toml", small_plant);
};

// The belt is started before the barrier; pieces come all the same, one in five sticks, and each jam is told.
TEST(Examples, TheBeltRunsJamsAndRunsOn) {
  const Outcome run = berth(
      {"emcy", "--listen", "20 s", "--up", "-m", example("belt.toml"), "--sim", example("belt.plant.toml"), "--json"});
  ASSERT_EQ(run.status, 0) << run.err;
  int jams = 0;
  int over = 0;
  const Json heard = Json::parse(run.out);
  for (const auto& message : heard.at("messages")) {
    if (message.at("node") != 10) continue;
    jams += message.at("code") == "0xFF01" ? 1 : 0;
    over += message.at("code") == "0x0000" ? 1 : 0;
  }
  EXPECT_GE(jams, 2) << run.out;
  EXPECT_GE(over, 1) << run.out;
}

// `berth init` writes the two files beside each other.
TEST(Examples, TheirPlantFilesAreFoundBesideThem) {
  const Outcome run = berth({"up", example("belt.toml"), "--fast", "--until", "operational"});
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.err.find("belt.plant.toml, beside the machine file"), std::string::npos) << run.err;
}

TEST_F(Up, OperationalIsExitZero) {
  const Outcome run = berth({"up", machine, "--sim", plant, "--json"});
  ASSERT_EQ(run.status, 0) << run.err;
  const Json report = Json::parse(run.out);
  EXPECT_TRUE(all_operational(report));
  EXPECT_EQ(r_sn_by_slot(report).at("left"), "0x0000000000000020");
  EXPECT_EQ(r_sn_by_slot(report).at("drive"), "0x0000000300000030");
}

TEST_F(Up, EventsAreLinesOfJsonAsTheyHappenAndTheLastIsTheReport) {
  const Outcome run = berth({"up", machine, "--sim", plant, "--fast", "--json", "--events"});
  EXPECT_EQ(run.status, 0) << run.err;
  std::istringstream lines(run.out);
  std::vector<Json> all;
  for (std::string line; std::getline(lines, line);) all.push_back(Json::parse(line));
  ASSERT_GT(all.size(), 10U);
  EXPECT_TRUE(all_operational(all.back()));
  all.pop_back();
  double last = 0;
  for (const auto& event : all) {
    EXPECT_GE(event.at("at_s").get<double>(), last);
    last = event.at("at_s");
    EXPECT_FALSE(event.at("kind").get<std::string>().empty());
  }
  EXPECT_EQ(all.size(),
            Json::parse(berth({"up", machine, "--sim", plant, "--fast", "--json"}).out).at("events").size());
  EXPECT_EQ(berth({"up", machine, "--sim", plant, "--fast", "--events"}).status, 2);
}

TEST_F(Up, NotOperationalIsExitOneWithTheReasons) {
  const std::string without_drive = folder.write("broken.toml", std::string(small_plant) + R"(
[[event]]
at     = "0 s"
action = "unplug"
device = "c"
)");
  const Outcome run = berth({"up", machine, "--sim", without_drive});
  EXPECT_EQ(run.status, 1);
  EXPECT_NE(run.err.find("slot drive (node-ID 9)"), std::string::npos) << run.err;
  EXPECT_EQ(run.err.find("slot left"), std::string::npos) << "it is operational: " << run.err;
}

TEST_F(Up, PlantEventsArePlayedToTheirEnd) {
  const std::string dies = folder.write("dies.toml", std::string(small_plant) + drive_dies);
  const Outcome run = berth({"up", machine, "--sim", dies, "--json"});
  EXPECT_EQ(run.status, 1) << "replacement = \"ask\": nobody has pressed the button";
  const Json report = Json::parse(run.out);
  for (const auto& slot : report.at("slots")) {
    EXPECT_EQ(slot.at("state") == "operational", slot.at("name") != "drive");
  }
  EXPECT_LT(report.at("bus_time_s").at("line").get<double>(), 60)
      << "settled, although the spare is found again and again";
  std::string text = small_machine;
  text += "replacement = \"auto\"\n";
  const std::string automatic = folder.write("auto.toml", text);
  const Outcome again = berth({"up", automatic, "--sim", dies, "--until", "replaced", "--json"});
  ASSERT_EQ(again.status, 0) << again.out;
  EXPECT_EQ(r_sn_by_slot(Json::parse(again.out)).at("drive"), "0x0000000300000031");
}

// A search by ranges on a slow bus takes longer than Berth waits for a change. A device that is plugged in meanwhile is
// found by the next one, and the run does not end before.
TEST_F(Up, ADeviceThatComesDuringALongSearchIsWaitedFor) {
  constexpr int last = 14;
  std::string slots = "[machine]\nname = \"slow\"\n[bus.line]\nport = \"sim\"\nbitrate = 20_000\n";
  std::string devices = "[bus.line]\n";
  for (int i = 1; i <= last; ++i) {
    const std::string id = std::to_string(i);
    const std::string type = "type = { vendor = " + id + ", product = 7 }\n";
    slots += "[[slot]]\nbus = \"line\"\nid = " + id + "\nname = \"s" + id + "\"\n" + type;
    devices += "[[device]]\nbus = \"line\"\nname = \"d" + id + "\"\n" + type;
    devices += "serial = " + std::to_string(i * 1'000'003) + "\n";
    // The last one answers neither ranges nor 5Eh, and comes late.
    devices += i < last
                   ? "speaks = [\"lss\"]\n"
                   : "speaks = [\"fastscan\"]\nlss_without = [\"identify\", \"inquire-node-id\"]\nplugged = false\n";
  }
  const std::string slow = folder.write("slow.toml", slots);
  for (int at = 100; at <= 160; at += 10) {
    const std::string plug = "[[event]]\nat = \"" + std::to_string(at) + " s\"\naction = \"plug\"\ndevice = \"d14\"\n";
    const std::string late = folder.write("late.toml", devices + plug);
    const Outcome run = berth({"up", slow, "--sim", late, "--json"});
    EXPECT_EQ(run.status, 0) << "plugged in at " << at << " s";
  }
}

TEST_F(Up, UntilReplacedWithoutAReplacementIsNo) {
  const Outcome run = berth({"up", machine, "--sim", plant, "--until", "replaced"});
  EXPECT_EQ(run.status, 1);
  EXPECT_NE(run.err.find("no device was replaced"), std::string::npos) << run.err;
}

TEST_F(Up, TimeoutEndsIt) {
  const Outcome run = berth({"up", machine, "--sim", plant, "--timeout", "20 ms"});
  EXPECT_EQ(run.status, 1);
  EXPECT_NE(run.err.find("the time allowed is over"), std::string::npos) << run.err;
}

TEST_F(Up, OneSeedOneRun) {
  const auto run = [&](const std::string& seed, const std::string& log) {
    const Outcome outcome =
        berth({"up", machine, "--sim", plant, "--seed", seed, "--record", folder.file(log), "--json"});
    EXPECT_EQ(outcome.status, 0);
    return outcome.out + contents(folder.file(log));
  };
  const std::string first = run("7", "a.log");
  EXPECT_EQ(first, run("7", "b.log"));
  EXPECT_NE(first, run("8", "c.log"));
  EXPECT_GT(contents(folder.file("a.log")).size(), 1000U);
}

// The table told and the table seen on the wire: boot-up, NMT start, heartbeat 05h.
TEST_F(Up, TheRecordedFramesTellTheSameTable) {
  for (const auto& [m, p] :
       {std::pair(machine, plant), {example("five-slaves.toml"), example("five-slaves.plant.toml")}}) {
    const std::string log = folder.file("frames.log");
    const Outcome run = berth({"up", m, "--sim", p, "--until", "operational", "--record", log, "--force", "--json"});
    ASSERT_EQ(run.status, 0) << run.err;
    struct Node {
      bool booted = false;
      bool started = false;
      double operational = -1;
    };
    std::map<unsigned, Node> nodes;
    std::istringstream lines(contents(log));
    std::string time;
    std::string bus;
    std::string word;
    while (lines >> time >> bus >> word) {
      const auto frame = can::parse_frame(word);
      ASSERT_TRUE(frame) << word;
      const double at = std::stod(time.substr(1));
      if (frame->extended || frame->remote) continue;
      if (frame->id == 0 && frame->size == 2 && frame->data[0] == 1) nodes[frame->data[1]].started = true;
      if (frame->id < 0x701 || frame->id > 0x77F || frame->size != 1) continue;
      Node& node = nodes[frame->id - 0x700];
      if (frame->data[0] == 0) node = Node{true, false, -1};
      if (frame->data[0] == 5 && node.booted && node.started && node.operational < 0) node.operational = at;
    }
    for (const auto& slot : Json::parse(run.out).at("slots")) {
      const Node& node = nodes[slot.at("id").get<unsigned>()];
      EXPECT_TRUE(node.booted && node.started);
      EXPECT_NEAR(node.operational, slot.at("since_s").get<double>(), 1e-6) << slot.at("name");
    }
  }
}

TEST_F(Up, DryRunPrintsFramesAndChangesNothing) {
  const std::string store = folder.file("slots.db");
  const std::string state = folder.file("plant.state");
  const Outcome run = berth({"up", machine, "--sim", plant, "--dry-run", "--store", store, "--sim-state", state});
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_FALSE(exists(store));
  EXPECT_FALSE(exists(state));
  EXPECT_NE(run.out.find(" line 1F940000#80000000"), std::string::npos) << run.out.substr(0, 500);
  EXPECT_NE(run.out.find(" line 000#0109"), std::string::npos) << "NMT start of node 9";
  EXPECT_EQ(run.out.find(" line 7E4#"), std::string::npos) << "only what Berth sends";
}

// Two buses in one world and one event queue; a command names its bus when there are several.
TEST_F(Up, SeveralBuses) {
  const std::string two = folder.write("two.toml", std::string(small_machine) + R"(
[[slot]]
bus  = "other"
id   = 2
name = "far"
type = { vendor = 1, product = 1 }

[bus.other]
port    = "sim"
bitrate = 125_000
)");
  const std::string both = folder.write("both.toml", std::string(small_plant) + R"(
[bus.other]

[[device]]
bus  = "other"
name = "far"
type = { vendor = 1, product = 1 }
serial = 0x40
)");
  const Outcome run = berth({"up", two, "--sim", both, "--until", "operational", "--json"});
  ASSERT_EQ(run.status, 0) << run.err << run.out;
  const Json report = Json::parse(run.out);
  EXPECT_EQ(report.at("slots").size(), 4U);
  EXPECT_EQ(report.at("slots").at(3).at("bus"), "other");
  EXPECT_EQ(report.at("slots").at(3).at("r_sn"), "0x0000000000000040");
  EXPECT_EQ(report.at("bus_time_s").size(), 2U);
  const auto ask = [&](Words words) {
    words.insert(words.end(), {"--machine", two, "--sim", both, "--up"});
    return berth(words);
  };
  const Outcome nameless = ask({"sdo", "read", "2", "0x1000"});
  EXPECT_EQ(nameless.status, 2);
  EXPECT_NE(nameless.err.find("line, other"), std::string::npos) << nameless.err;
  const Outcome named = ask({"sdo", "read", "2", "0x1018", "4", "-t", "u32", "--bus", "other"});
  EXPECT_NE(named.out.find("0x00000040"), std::string::npos) << named.out << named.err;
  EXPECT_EQ(ask({"replace", "2"}).status, 2) << "both buses have a slot of this node-ID";
  for (const char* const slot : {"far", "other/far", "9"})
    EXPECT_EQ(ask({"replace", slot}).status, 1) << "its device is there";
  EXPECT_EQ(ask({"scan"}).status, 0);
}

TEST_F(Up, CtrlCEndsALongRunCleanly) {
  const std::string lasting = folder.write("lasting.toml", std::string(small_plant) + R"(
[[event]]
at     = "20 h"
action = "unplug"
device = "c"
)");
  const std::string store = folder.file("slots.db");
  Background run({"up", machine, "--sim", lasting, "--store", store, "--timeout", "100 h"});
  ASSERT_TRUE(run.says("operational"));
  run.signal(SIGINT);
  const Outcome outcome = run.end();
  EXPECT_EQ(outcome.status, 0) << outcome.err << outcome.out;
  EXPECT_NE(outcome.out.find("serial"), std::string::npos) << "the table as it stood";
}

// A second run knows its machine: the store has the bindings, the devices their node-IDs.
TEST_F(Up, StoreAndPlantStateOutliveARun) {
  const Words flags{
      "up",    machine, "--sim", plant, "--store", folder.file("slots.db"), "--sim-state", folder.file("plant.state"),
      "--json"};
  const Outcome first = berth(flags);
  ASSERT_EQ(first.status, 0) << first.err;
  const Outcome second = berth(flags);
  ASSERT_EQ(second.status, 0) << second.err;
  EXPECT_EQ(r_sn_by_slot(Json::parse(first.out)), r_sn_by_slot(Json::parse(second.out)));
  EXPECT_NE(first.out.find("\"bound\""), std::string::npos);
  const Json report = Json::parse(second.out);
  EXPECT_TRUE(std::ranges::none_of(report.at("events"), [](const Json& e) { return e.at("kind") == "bound"; }))
      << "nothing is bound anew";
  const Outcome read = berth({"sdo", "read", "9", "0x1018", "4", "-t", "u32", "--machine", machine, "--sim", plant,
                              "--sim-state", folder.file("plant.state"), "--json"});
  ASSERT_EQ(read.status, 0) << read.err << read.out;
  EXPECT_EQ(Json::parse(read.out).at("value"), 0x30);
}

TEST_F(Up, ASecondRunOnOneStoreIsRefusedWithTheOwner) {
  const std::string store = folder.file("slots.db");
  Background first({"up", machine, "--sim", plant, "--store", store, "--pace", "--control", folder.file("a.sock")});
  ASSERT_TRUE(eventually([&] { return berth({"status", "--control", folder.file("a.sock")}).status == 0; }));
  const Outcome second = berth({"up", machine, "--sim", plant, "--store", store});
  EXPECT_EQ(second.status, 3);
  EXPECT_NE(second.err.find(std::to_string(first.pid())), std::string::npos) << second.err;
  first.signal(SIGTERM);
  static_cast<void>(first.end());
  EXPECT_EQ(berth({"up", machine, "--sim", plant, "--store", store}).status, 0) << "the lock went with its owner";
}

TEST(Demo, ARecordThatCannotBeWrittenIsAFailure) {
  const Outcome full = berth({"demo", "--record", "/dev/full"});
  EXPECT_EQ(full.status, 3) << full.out;
  EXPECT_NE(full.err.find("/dev/full"), std::string::npos) << full.err;
}

}  // namespace
}  // namespace berth::test

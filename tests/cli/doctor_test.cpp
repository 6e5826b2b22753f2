// `berth doctor`: every fault of the ailing plant, the same from another process, and nothing on a healthy machine.
#include <gtest/gtest.h>
#include <algorithm>
#include <string>

#include <signal.h>
#include <unistd.h>

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using Json = nlohmann::json;

/// "line duplicate-node-id 2", for each finding.
std::set<std::string> named(const Json& reply) {
  std::set<std::string> all;
  for (const auto& f : reply.at("findings")) {
    const Json& node = f.at("node");
    all.insert(f.at("bus").get<std::string>() + " " + f.at("kind").get<std::string>() +
               (node.is_null() ? "" : " " + std::to_string(node.get<int>())));
  }
  return all;
}

std::string words(const std::set<std::string>& all) {
  std::string text;
  for (const auto& one : all) text += one + "\n";
  return text;
}

/// The machine file with its buses in another process.
std::string served(std::string text, const std::string& socket) {
  const std::string old = "\"sim\"";
  for (auto at = text.find(old); at != std::string::npos; at = text.find(old, at + 1))
    text.replace(at, old.size(), "\"plant:" + socket + "\"");
  return text;
}

// The faults that examples/ailing.plant.toml has, as its comments say.
const std::set<std::string> faults{
    "line duplicate-node-id 2",   // clone and other clone
    "line identifier-collision",  // two clocks on 080h
    "line blank-node 4",          // new from the shelf
    "line blank-node 7",          // passively nobody can tell a mute device from a blank one
    "line missing-heartbeat 4",   // it has no node-ID, so it has no heartbeat
    "line missing-heartbeat 7",   // switched off
    "line missing-heartbeat 8",   // its heartbeats never get through
    "line error-passive 8",       // and that is why
    "mixed wrong-bit-rate 13",    // the stranger
    "busy overload",              // the chatterbox
};

// S4.1, S4.21, SX.7.
TEST(DoctorCommand, S4_21_NamesEveryFaultOfAPlantThatHasThemAll) {
  const Outcome run = berth({"doctor", example("ailing.toml"), "--sim", example("ailing.plant.toml"), "--json"});
  ASSERT_EQ(run.status, 1) << run.out << run.err;
  const Json reply = Json::parse(run.out);
  EXPECT_EQ(named(reply), faults) << words(named(reply));
  EXPECT_EQ(reply.at("asked"), "nothing");
  for (const auto& f : reply.at("findings")) {
    EXPECT_FALSE(f.at("evidence").empty()) << f;
    EXPECT_FALSE(f.at("do").get<std::string>().empty()) << f;
    const std::set<std::string> certainties{"possible", "likely", "certain"};
    EXPECT_TRUE(certainties.contains(f.at("certainty").get<std::string>())) << f;
  }
}

// By what the port tells, not by looking into the simulator: the doctor in a process of its own.
TEST(DoctorCommand, FromAnotherProcessTheSameFindings) {
  const Folder folder;
  const std::string socket = folder.file("plant.sock");
  Background plant({"plant", example("ailing.plant.toml"), "--listen", socket});
  ASSERT_TRUE(plant.says("Ctrl-C ends it")) << "it listens";
  // A bus that runs is listened to, not one on which every device boots just now: it tells how far it is.
  {
    Background trace({"trace", "--port", "plant:" + socket, "--bus", "line", "-q", "-o", "-", "--to", "candump"});
    const auto beats = [](const std::string& so_far) {
      unsigned count = 0;
      for (auto at = so_far.find(" 701#"); at != std::string::npos; at = so_far.find(" 701#", at + 1)) ++count;
      return count;
    };
    ASSERT_TRUE(trace.says([&](const std::string& so_far) { return beats(so_far) >= 4; })) << trace.said();
  }
  const std::string machine = folder.write("machine.toml", served(contents(example("ailing.toml")), socket));
  // A plant that got no processor for a second is a silent bus, and the doctor says so: then it listens once more.
  std::set<std::string> found;
  for (int listening = 0; listening < 5 && found != faults; ++listening) {
    const Outcome run = berth({"doctor", machine, "--json"});
    ASSERT_EQ(run.status, 1) << run.out << run.err;
    found = named(Json::parse(run.out));
  }
  EXPECT_EQ(found, faults) << words(found);
}

// LSS tells more: who the clones are, that the mute device is there, that a blank one is.
TEST(DoctorCommand, ActiveQuestionsProve) {
  const Outcome run = berth(
      {"doctor", example("ailing.toml"), "--sim", example("ailing.plant.toml"), "--bus", "line", "--active", "--json"});
  ASSERT_EQ(run.status, 1) << run.out << run.err;
  const Json reply = Json::parse(run.out);
  const auto names = named(reply);
  EXPECT_TRUE(names.contains("line blank-node 4")) << words(names);
  EXPECT_FALSE(names.contains("line blank-node 7")) << "it has a node-ID: LSS told";
  for (const auto& f : reply.at("findings")) {
    if (f.at("kind") == "duplicate-node-id") {
      EXPECT_EQ(f.at("certainty"), "certain") << f;
      EXPECT_EQ(f.at("devices"), Json({"00000001-00000002-00000000-00000002", "00000001-00000002-00000000-00000003"}));
    }
    if (f.at("kind") == "blank-node") {
      EXPECT_EQ(f.at("certainty"), "certain") << f;
      EXPECT_EQ(f.at("devices"), Json({"00000001-00000004-00000000-00000004"})) << f;
    }
  }
}

TEST(DoctorCommand, IntrusiveReadsSerialNumbers) {
  const Outcome run = berth({"doctor", example("ailing.toml"), "--sim", example("ailing.plant.toml"), "--bus", "line",
                             "--intrusive", "--json"});
  ASSERT_EQ(run.status, 1) << run.out << run.err;
  const Json reply = Json::parse(run.out);
  EXPECT_EQ(reply.at("asked"), "lss and sdo");
  bool told = false;
  for (const auto& f : reply.at("findings")) {
    for (const auto& line : f.at("evidence")) told = told || line.get<std::string>().find("SDO") != std::string::npos;
  }
  EXPECT_TRUE(told) << run.out;
}

TEST(DoctorCommand, AHealthyMachineHasNone) {
  const Outcome run =
      berth({"doctor", example("five-slaves.toml"), "--sim", example("five-slaves.plant.toml"), "--up", "--json"});
  EXPECT_EQ(run.status, 0) << run.out << run.err;
  EXPECT_EQ(Json::parse(run.out).at("findings"), Json::array()) << run.out;
}

// Beside a running `berth up`, as another node of the served plant; it sends nothing, so nothing there changes.
TEST(DoctorCommand, BesideARunningUpOnAHealthyMachine) {
  const Folder folder;
  const std::string socket = folder.file("plant.sock");
  Background plant({"plant", folder.write("plant.toml", small_plant), "--listen", socket, "--machine",
                    folder.write("sim.toml", small_machine)});
  ASSERT_TRUE(plant.says("Ctrl-C ends it")) << "it listens";
  const std::string machine = folder.write("machine.toml", served(patient(small_machine), socket));
  const std::string control = folder.file("control.sock");
  const Background up({"up", machine, "--pace", "--control", control});
  const auto operational = [&] {
    const Outcome status = berth({"status", "--machine", machine, "--control", control, "--json"});
    const Json report = Json::parse(status.out, nullptr, false);
    if (status.status != 0 || !report.contains("slots")) return false;
    return std::ranges::all_of(report.at("slots"), [](const Json& s) { return s.at("state") == "operational"; });
  };
  ASSERT_TRUE(eventually(operational));
  const Outcome run = berth({"doctor", machine, "--json"});
  EXPECT_EQ(run.status, 0) << run.out << run.err;
  EXPECT_EQ(Json::parse(run.out).at("findings"), Json::array()) << run.out;
  EXPECT_TRUE(operational());
}

/// The small machine's devices in another process, each with its node-ID and its heartbeat. Nobody is their master.
class OnALivePort : public ::testing::Test {
 protected:
  OnALivePort() {
    std::string text = "[plant]\nseed = 5\n\n[bus.line]\nbitrate = 500_000\n";
    for (const auto& [id, product] : {std::pair(2, 1), std::pair(3, 1), std::pair(9, 7)}) {
      text += fmt::format(
          "\n[[device]]\nbus = \"line\"\nname = \"d{0}\"\ntype = {{ vendor = 1, product = {1} }}\nserial = {0}\n"
          "node_id = {0}\nheartbeat = \"100 ms\"\n",
          id, product);
    }
    plant_file = folder.write("plant.toml", text);
  }
  [[nodiscard]] std::string on(const std::string& port) const {
    std::string text = patient(small_machine);
    const std::string old = "\"sim\"";
    text.replace(text.find(old), old.size(), "\"" + port + "\"");
    return folder.write("machine.toml", text);
  }
  // Some 60 heartbeats; a processor that does much else leaves fewer.
  static void hears_and_asks(const std::string& machine, const std::string& questions) {
    const Outcome run = berth({"doctor", machine, "--for", "2 s", questions, "--json"});
    EXPECT_EQ(run.status, 0) << run.out << run.err;
    const Json reply = Json::parse(run.out, nullptr, false);
    ASSERT_TRUE(reply.contains("buses")) << run.out;
    EXPECT_GT(reply.at("buses").at(0).at("frames").get<int>(), 10) << questions << ": it is deaf: " << run.out;
    EXPECT_EQ(reply.at("findings"), Json::array()) << questions << run.out;
  }
  Folder folder;
  std::string plant_file;
};

// The search for other masters took the port's listener from the doctor: "silent-bus (certain)" beside heartbeats.
TEST_F(OnALivePort, OfAPlantItHearsBeforeItAsks) {
  const std::string socket = folder.file("plant.sock");
  Background plant({"plant", plant_file, "--listen", socket});
  ASSERT_TRUE(plant.says("Ctrl-C ends it")) << "it listens";
  const std::string machine = on("plant:" + socket);
  hears_and_asks(machine, "--active");
  hears_and_asks(machine, "--intrusive");
}

TEST_F(OnALivePort, OfASocketcandServerItHearsBeforeItAsks) {
  Background server({"serve", plant_file, "--listen", "127.0.0.1:0"});
  ASSERT_TRUE(server.says("/line\n")) << server.said();
  const std::string url = server.said().substr(0, server.said().find('\n'));
  hears_and_asks(on(url), "--active");
}

// A simulated machine that another process runs: the doctor hears what that one's control socket tells, and a second
// world is not made.
TEST(DoctorCommand, JoinsASimulatedMachineThatRuns) {
  const Folder folder;
  const std::string machine = folder.write("machine.toml", small_machine);
  const std::string control = folder.file("control.sock");
  Background up({"up", machine, "--sim", folder.write("plant.toml", small_plant), "--pace", "--control", control});
  const auto status = [&] { return berth({"status", machine, "--control", control}).status; };
  ASSERT_TRUE(eventually([&] { return status() == 0; }));
  const Outcome well = berth({"doctor", machine, "--control", control, "--json"});
  EXPECT_EQ(well.status, 0) << well.out << well.err;
  EXPECT_GT(Json::parse(well.out).at("buses").at(0).at("frames").get<int>(), 50);
  ASSERT_EQ(berth({"sim", "unplug", "drive", machine, "--control", control}).status, 0);
  const Outcome ill = berth({"doctor", machine, "--control", control, "--json"});
  EXPECT_EQ(ill.status, 1) << ill.out << ill.err;
  const Json found = Json::parse(ill.out).at("findings");
  EXPECT_TRUE(std::ranges::any_of(found, [](const Json& f) { return f.at("slot") == "drive"; })) << found;
  const Outcome active = berth({"doctor", machine, "--control", control, "--active"});
  EXPECT_EQ(active.status, 1) << "only the other process reaches its devices";
  EXPECT_NE(active.err.find("another process runs this simulated machine"), std::string::npos) << active.err;
  up.signal(SIGTERM);
  static_cast<void>(up.end());
}

TEST(DoctorCommand, WrongUseIsExitTwo) {
  EXPECT_EQ(berth({"doctor"}).status, 2);
  EXPECT_EQ(berth({"doctor", example("ailing.toml")}).status, 2) << "simulated buses need a plant";
  EXPECT_EQ(berth({"doctor", example("ailing.toml"), "--sim", example("ailing.plant.toml"), "--bus", "none"}).status,
            2);
  EXPECT_EQ(berth({"doctor", example("ailing.toml"), "--sim", example("ailing.plant.toml"), "--for", "soon"}).status,
            2);
  EXPECT_EQ(berth({"doctor", example("ailing.toml"), "--sim", example("ailing.plant.toml"), "--dry-run"}).status, 2);
}

// The network's bit rate by LSS, from the command line.
TEST(MoveBitRate, AsksForConfirmationAndSaysWhatItDid) {
  const Folder folder;
  const std::string machine = folder.write("machine.toml", small_machine);
  std::string text(small_plant);
  for (const auto& [serial, id] : {std::pair("0x21", 2), std::pair("0x20", 3)}) {
    const std::string line = std::string("serial = ") + serial + "\n";
    text.insert(text.find(line), "node_id = " + std::to_string(id) + "\n");
  }
  const std::string plant = folder.write("plant.toml", text);
  const Words words{"lss", "move-bit-rate", "250000", "--machine", machine, "--sim", plant, "--json"};
  const Outcome asked = berth(words);
  EXPECT_EQ(asked.status, 1) << asked.out << asked.err;
  EXPECT_EQ(Json::parse(asked.out).at("result"), "unconfirmed");
  Words yes = words;
  yes.emplace_back("--yes");
  const Outcome done = berth(yes);
  ASSERT_EQ(done.status, 0) << done.out << done.err;
  const Json reply = Json::parse(done.out);
  EXPECT_EQ(reply.at("result"), "moved");
  EXPECT_EQ(reply.at("bit_rate"), 250'000);
  EXPECT_EQ(reply.at("nodes").size(), 3U) << "one of them has no node-ID";
  for (const auto& node : reply.at("nodes")) EXPECT_EQ(node.at("stored"), true);
  EXPECT_EQ(berth({"lss", "move-bit-rate", "100000", "--machine", machine, "--sim", plant}).status, 2);
}

}  // namespace
}  // namespace berth::test

// Buses that are outside this process: another master is seen before the first frame and named, roles hold on the wire,
// ports are given on the command line, single commands find their way, the port goes and comes back.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>
#include <string>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "berth/io/stream.hpp"
#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using Json = nlohmann::json;

std::string replaced(std::string text, const std::string& what, const std::string& with) {
  const auto at = text.find(what);
  if (at != std::string::npos) text.replace(at, what.size(), with);
  return text;
}

/// A device that says of itself that it is the NMT master (CiA 302-2: 1F80h bit 0) and starts itself (bit 3).
std::string master_eds(const std::string& startup) {
  const auto object = [](const std::string& section, const std::string& type, const std::string& value) {
    return "\n[" + section + "]\nParameterName=o" + section + "\nObjectType=7\nDataType=" + type +
           "\nAccessType=rw\nDefaultValue=" + value + "\nPDOMapping=0\n";
  };
  std::string text =
      "[FileInfo]\nFileName=master.eds\nEDSVersion=4.0\n[DeviceInfo]\nVendorName=v\nVendorNumber=2\n"
      "ProductNumber=9\nRevisionNumber=1\nBaudRate_500=1\nGranularity=8\n"
      "[MandatoryObjects]\nSupportedObjects=3\n1=0x1000\n2=0x1001\n3=0x1018\n"
      "[OptionalObjects]\nSupportedObjects=3\n1=0x1017\n2=0x1F80\n3=0x1F81\n";
  text += object("1000", "7", "0x191") + object("1001", "5", "0") + object("1017", "6", "100");
  text += object("1F80", "7", startup);
  text += "\n[1018]\nParameterName=identity\nObjectType=9\nSubNumber=5\n" + object("1018sub0", "5", "4") +
          object("1018sub1", "7", "2") + object("1018sub2", "7", "9") + object("1018sub3", "7", "1") +
          object("1018sub4", "7", "0x77");
  text += "\n[1F81]\nParameterName=list\nObjectType=8\nSubNumber=2\n" + object("1F81sub0", "5", "1") +
          object("1F81sub1", "7", "5");
  return text;
}

bool wait_for(const std::string& path) {
  return eventually([&] { return exists(path); });
}

/// The small plant in a process of its own, and the small machine on it. Each process of Berth gets a folder of its own
/// for sockets, so that no two of them know of each other but by the bus.
class Live : public ::testing::Test {
 protected:
  Live() : socket(folder.file("plant.sock")) {
    plant_file = folder.write("plant.toml", small_plant);
    sim_file = folder.write("sim.toml", small_machine);
    machine = folder.write("machine.toml", on_plant("cli test"));
    start_plant();
  }
  void start_plant() {
    plant = std::make_unique<Background>(
        Words{"plant", plant_file, "--listen", socket, "--machine", sim_file, "--plant-state", folder.file("state")});
    ASSERT_TRUE(plant->says("Ctrl-C ends it")) << "it listens";
  }
  [[nodiscard]] std::string on_plant(const std::string& name, const std::string& more = {}) const {
    std::string text = replaced(patient(small_machine), "\"sim\"", "\"plant:" + socket + "\"" + more);
    text = replaced(text, "cli test", name);
    return replaced(text, "probe_period", "listen            = \"1 s\"\nprobe_period");
  }
  [[nodiscard]] bool operational(const std::string& file, const std::string& control) const {
    return eventually([&] {
      const Outcome status = berth({"status", "--machine", file, "--control", control, "--json"});
      const Json report = Json::parse(status.out, nullptr, false);
      return status.status == 0 && report.contains("slots") &&
             std::ranges::all_of(report.at("slots"), [](const Json& s) { return s.at("state") == "operational"; });
    });
  }
  Folder folder;
  std::string socket, plant_file, sim_file, machine;
  std::unique_ptr<Background> plant;
};

TEST_F(Live, BesideAnotherMasterUpRefusesAndNamesIt) {
  const std::string control = folder.file("first.sock");
  const Background first({"up", machine, "--pace", "--control", control});
  ASSERT_TRUE(operational(machine, control));
  const std::string other = folder.write("other.toml", on_plant("other machine"));
  const Outcome up = berth({"up", other, "--until", "operational", "--control", folder.file("second.sock")});
  EXPECT_EQ(up.status, 1) << up.out << up.err;
  EXPECT_NE(up.err.find("another master is on this bus, probably node 127"), std::string::npos) << up.err;
  EXPECT_NE(up.err.find("discovery requests"), std::string::npos) << up.err;
  EXPECT_NE(up.err.find("commissioner"), std::string::npos) << up.err;
  const Outcome json = berth({"up", other, "--json", "--control", folder.file("second.sock")});
  EXPECT_EQ(json.status, 1);
  EXPECT_TRUE(Json::parse(json.out).contains("error")) << json.out;
  EXPECT_TRUE(operational(machine, control)) << "the first is not disturbed";
}

// Two masters of which each listened before the other sent: whichever hears the other first shuts, so one of them at
// least, and that one writes nothing more. Which, and whether both, is the machine's scheduling; one that hears the
// other before it sends ends.
TEST_F(Live, OfTwoMastersTheOneThatHearsTheOtherIsShut) {
  const std::string control = folder.file("first.sock");
  const Background first({"up", machine, "--pace", "--control", control});
  ASSERT_TRUE(operational(machine, control));
  const std::string deaf = folder.write(
      "deaf.toml", replaced(on_plant("deaf machine"), "listen            = \"1 s\"", "listen            = \"0 s\""));
  const std::string second_control = folder.file("second.sock");
  Background second({"up", deaf, "--pace", "--control", second_control});
  const auto status = [](const std::string& file, const std::string& at) {
    return berth({"status", "--machine", file, "--control", at, "--json"}).out;
  };
  std::string texts[2];
  const auto is_shut = [](const std::string& text) {
    return text.find("another master is on this bus") != std::string::npos;
  };
  const auto second_has_ended = [&] {
    siginfo_t how{};
    const auto pid = static_cast<id_t>(second.pid());
    return ::waitid(P_PID, pid, &how, WEXITED | WNOHANG | WNOWAIT) == 0 && how.si_pid != 0;
  };
  EXPECT_TRUE(eventually([&] {
    texts[0] = status(machine, control);
    texts[1] = status(deaf, second_control);
    return is_shut(texts[0]) || is_shut(texts[1]) || second_has_ended();
  })) << texts[0]
      << texts[1];
  if (second_has_ended()) {
    const Outcome refused = second.end();
    EXPECT_EQ(refused.status, 1) << refused.out;
    EXPECT_TRUE(is_shut(refused.err)) << refused.out << refused.err;
  }
  for (const std::string& text : texts) {
    if (!is_shut(text)) continue;
    EXPECT_NE(text.find("Berth writes nothing more on this bus"), std::string::npos) << text;
    EXPECT_EQ(text.find("\"state\": \"operational\""), std::string::npos) << text;
    const bool first_is = &text == &texts[0];
    const std::string& file = first_is ? machine : deaf;
    const std::string& at = first_is ? control : second_control;
    for (const Words& asked :
         {Words{"sdo", "read", "2", "1018h:04"}, Words{"nmt", "start", "2"}, Words{"replace", "2"}}) {
      Words words = asked;
      words.insert(words.end(), {"--machine", file, "--control", at});
      const Outcome no = berth(words);
      EXPECT_NE(no.err.find("another master is on this bus"), std::string::npos) << asked.front() << no.out << no.err;
      EXPECT_NE(no.err.find("Berth sends nothing there"), std::string::npos) << asked.front() << no.err;
    }
  }
}

TEST_F(Live, AnObserverSendsNoFrameAndACommissionerNoNmt) {
  const std::string record = folder.file("frames.log");
  Background ear({"up", folder.write("ear.toml", on_plant("ear", "\nrole = \"observer\"")), "--pace", "--record",
                  record, "--control", folder.file("ear.sock")});
  ASSERT_TRUE(wait_for(folder.file("ear.sock"))) << "its port is open by then";
  const std::string commissioner = folder.write("comm.toml", on_plant("comm", "\nrole = \"commissioner\""));
  const Outcome bind = berth({"bind", "--machine", commissioner, "--control", folder.file("none.sock")});
  EXPECT_NE(bind.status, 0) << "a control socket that is named and not there is no leave to open the port";
  const Outcome bound = berth({"bind", "--machine", commissioner, "--timeout", "60"});
  EXPECT_EQ(bound.status, 0) << bound.out << bound.err;
  ear.signal(SIGTERM);
  static_cast<void>(ear.end());  // the record is closed
  std::ifstream in(record);
  std::string line;
  std::size_t lss = 0;
  while (std::getline(in, line)) {
    if (line.find(" 7E5#") != std::string::npos) ++lss;
    EXPECT_EQ(line.find(" 000#01"), std::string::npos) << line;
    EXPECT_EQ(line.find(" 000#8"), std::string::npos) << line;
    EXPECT_EQ(line.find(" 080#"), std::string::npos) << line;
  }
  EXPECT_GT(lss, 0U) << "the record is real";
}

TEST_F(Live, ThePortOfTheCommandLineIsStrongerThanTheFile) {
  const Outcome up = berth({"up", sim_file, "--port", "plant:" + socket, "--until", "operational", "--timeout", "100"});
  EXPECT_EQ(up.status, 0) << up.out << up.err;
  EXPECT_EQ(berth({"up", sim_file, "--port", "nonsense"}).status, 2);
  EXPECT_EQ(berth({"up", sim_file, "--port", "ghost=plant:" + socket}).status, 2);
  const Outcome none = berth({"up", sim_file, "--port", "line=plant:" + folder.file("none")});
  EXPECT_EQ(none.status, 3) << none.err;
  EXPECT_NE(none.err.find("bus line"), std::string::npos) << none.err;
}

// Who sat where is told while nobody runs the machine, and no port is needed for it.
TEST_F(Live, HistoryTellsWhoSatWhere) {
  const std::string store = folder.file("slots.db");
  const Outcome bound = berth({"bind", "--machine", machine, "--store", store});
  ASSERT_EQ(bound.status, 0) << bound.out << bound.err;
  plant.reset();
  const Outcome all = berth({"history", machine, "--store", store, "--json"});
  EXPECT_EQ(all.status, 0) << all.out << all.err;
  const Json history = Json::parse(all.out).at("history");
  const auto seated = [](const Json& line) { return line.at("event") == "confirmed"; };
  EXPECT_EQ(std::ranges::count_if(history, seated), 3) << history;
  const Outcome one = berth({"history", "drive", machine, "--store", store, "--json"});
  for (const Json& line : Json::parse(one.out).at("history")) EXPECT_EQ(line.at("slot"), "line/drive") << line;
  const Json drive = Json::parse(one.out).at("history").back();
  EXPECT_EQ(drive.at("r_sn"), "0x0000000300000030");
  EXPECT_EQ(drive.at("id"), 9);
  EXPECT_EQ(berth({"history", "nobody", machine, "--store", store}).status, 2);
}

// Beside the master that runs the bus: those who were heard are asked by SDO, and nothing else is sent.
TEST_F(Live, AScanBesideAMasterListensAndAsksWhoWasHeard) {
  const std::string control = folder.file("first.sock");
  const std::string running = folder.write("running.toml", on_plant("running", "\ntolerate = [\"sdo\"]"));
  const std::string record = folder.file("frames.log");
  const Background first({"up", running, "--pace", "--control", control});
  ASSERT_TRUE(operational(running, control));
  Background ear({"up", folder.write("ear.toml", on_plant("ear", "\nrole = \"observer\"")), "--pace", "--record",
                  record, "--control", folder.file("ear.sock")});
  ASSERT_TRUE(wait_for(folder.file("ear.sock"))) << "its port is open by then";
  const Outcome scan = berth({"scan", "--port", "plant:" + socket, "--bus", "line", "--json"});
  ASSERT_EQ(scan.status, 0) << scan.out << scan.err;
  const Json reply = Json::parse(scan.out);
  EXPECT_EQ(reply.at("configured"), 3) << "the devices; 127 is the node-ID of this scan's own master: " << scan.out;
  for (const auto& node : reply.at("nodes")) EXPECT_EQ(node.at("state"), "operational") << node;
  ear.signal(SIGTERM);
  static_cast<void>(ear.end());
  const std::string heard = contents(record);
  EXPECT_NE(heard.find(" 609#40"), std::string::npos) << heard;
  EXPECT_EQ(heard.find(" 64D#"), std::string::npos) << "nobody was heard under 77, and it was asked\n" << heard;
  EXPECT_TRUE(operational(running, control)) << "nobody was disturbed";
}

// A port is enough for what needs no slots, and nothing about the machine that nobody wrote is kept.
TEST_F(Live, ABusWithoutAMachineFile) {
  ASSERT_EQ(berth({"bind", "--machine", machine, "--store", folder.file("slots.db")}).status, 0);
  const auto before = std::distance(std::filesystem::directory_iterator(folder.file("")), {});
  const Outcome scan = berth({"scan", "--all", "--port", "plant:" + socket, "--bus", "line", "--json"});
  ASSERT_EQ(scan.status, 0) << scan.out << scan.err;
  EXPECT_EQ(Json::parse(scan.out).at("configured"), 3) << scan.out;
  const Words bus{"--port", socket, "--bus", "line", "--json"};
  const auto ask = [&](Words words) {
    words.insert(words.end(), bus.begin(), bus.end());
    return berth(words);
  };
  const Outcome read = ask({"sdo", "read", "9", "Identity object/Serial number"});
  EXPECT_EQ(read.status, 0) << read.out << read.err;
  EXPECT_EQ(Json::parse(read.out).at("value"), 0x30) << "a socket is guessed to be a plant's";
  EXPECT_EQ(ask({"nmt", "preop", "9"}).status, 0);
  EXPECT_EQ(ask({"lss", "find"}).status, 0);
  EXPECT_EQ(ask({"emcy", "9"}).status, 0);
  EXPECT_EQ(ask({"sdo", "read", "drive", "1018h"}).status, 2) << "nothing has a name";
  for (const char* verb : {"bind", "status", "history", "configure"}) {
    const Outcome slots = ask({verb});
    EXPECT_EQ(slots.status, 2) << verb;
    EXPECT_NE(slots.out.find("machine file"), std::string::npos) << slots.out;
  }
  const Outcome doctor = ask({"doctor", "--for", "2 s"});
  EXPECT_LT(doctor.status, 2) << doctor.out << doctor.err;
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.file("")), {}), before) << "no file is made";
}

TEST_F(Live, SingleCommandsOpenThePortWhenNobodyRuns) {
  const Outcome scan = berth({"scan", "--all", "--machine", machine, "--json"});
  ASSERT_EQ(scan.status, 0) << scan.out << scan.err;
  EXPECT_EQ(Json::parse(scan.out).at("unconfigured"), 3) << scan.out;
  ASSERT_EQ(berth({"bind", "--machine", machine}).status, 0);
  const Outcome read = berth({"sdo", "read", "9", "0x1018", "4", "--type", "u32", "--machine", machine, "--json"});
  EXPECT_EQ(read.status, 0) << read.out << read.err;
  EXPECT_NE(read.out.find("48"), std::string::npos) << read.out;  // 30h
}

// A command that only looks takes no lock, and needs none. The `up` is at a control socket that `status` does
// not know: as one that is starting, it has its locks and does not answer.
TEST_F(Live, StatusIsNotHeldUpByAnUpThatStarts) {
  const std::string store = folder.file("slots.db");
  const std::string slow = folder.write(
      "slow.toml", replaced(on_plant("slow"), "listen            = \"1 s\"", "listen            = \"60 s\""));
  const Background up({"up", slow, "--pace", "--store", store, "--control", folder.file("slow.sock")});
  ASSERT_TRUE(eventually([&] { return !contents(store + ".lock").empty(); })) << "the slot table is its own by now";
  const Outcome status = berth({"status", "--machine", slow, "--store", store, "--json"});
  EXPECT_EQ(status.status, 1) << "no slot is operational: " << status.out << status.err;
  EXPECT_EQ(Json::parse(status.out).at("slots").size(), 3U) << status.out;
}

TEST_F(Live, StatusTellsTheSlotTableAndLeavesNoTraceOfIt) {
  const std::string store = folder.file("slots.db");
  ASSERT_EQ(berth({"bind", "--machine", machine, "--store", store}).status, 0);
  EXPECT_FALSE(exists(store + ".lock")) << "it goes with its owner";
  const std::string before = contents(store);
  const Outcome status = berth({"status", "--machine", machine, "--store", store, "--json"});
  EXPECT_EQ(status.status, 1) << "no slot is operational: " << status.out << status.err;
  EXPECT_NE(status.out.find("\"r_sn\": \"0x0000000300000030\""), std::string::npos) << status.out;
  EXPECT_FALSE(exists(store + ".lock")) << "an up that starts just now would be refused";
  EXPECT_EQ(contents(store), before);
  EXPECT_EQ(berth({"status", "--machine", machine, "--store", folder.file("none.db")}).status, 1);
  EXPECT_FALSE(exists(folder.file("none.db"))) << "it makes none either";
}

TEST_F(Live, ADryRunListensAndSendsNothing) {
  const std::string record = folder.file("frames.log");
  Background ear({"up", folder.write("ear.toml", on_plant("ear", "\nrole = \"observer\"")), "--pace", "--record",
                  record, "--control", folder.file("ear.sock")});
  ASSERT_TRUE(wait_for(folder.file("ear.sock"))) << "its port is open by then";
  const Outcome dry = berth({"up", machine, "--dry-run", "--json"});
  ASSERT_EQ(dry.status, 0) << dry.out << dry.err;
  const Json frames = Json::parse(dry.out).at("frames");
  ASSERT_FALSE(frames.empty()) << dry.out;
  EXPECT_EQ(frames[0].at("frame"), "7E5#0400000000000000") << "the opening: all devices to LSS waiting";
  EXPECT_EQ(berth({"scan", "--machine", machine, "--dry-run"}).status, 0);
  // What is asked after it and stands in the record tells that the record would have the dry run's frames, too.
  EXPECT_NE(berth({"sdo", "read", "77", "0x1018", "4", "--machine", machine}).status, 0) << "there is no node 77";
  ear.signal(SIGTERM);
  static_cast<void>(ear.end());
  const std::string frames_heard = contents(record);
  const auto marker = frames_heard.find(" 64D#");
  ASSERT_NE(marker, std::string::npos) << frames_heard;
  EXPECT_EQ(frames_heard.find(" 7E5#"), std::string::npos) << frames_heard;
  EXPECT_EQ(frames_heard.find(" 60"), std::string::npos) << frames_heard;
}

TEST_F(Live, OnExitTheDevicesAreMadePreOperational) {
  const std::string control = folder.file("up.sock");
  Background up({"up", machine, "--pace", "--control", control, "--on-exit", "preop"});
  ASSERT_TRUE(operational(machine, control));
  up.signal(SIGTERM);
  static_cast<void>(up.end());
  const Outcome scan = berth({"scan", "--machine", machine, "--json"});
  ASSERT_EQ(scan.status, 0) << scan.out << scan.err;
  const Json nodes = Json::parse(scan.out).at("nodes");
  ASSERT_EQ(nodes.size(), 3U);
  for (const auto& node : nodes) EXPECT_EQ(node.at("state"), "pre-operational") << node;
}

TEST_F(Live, TheSessionSurvivesThePortsGoingAndComingBack) {
  const std::string control = folder.file("up.sock");
  const Background up({"up", machine, "--pace", "--control", control});
  ASSERT_TRUE(operational(machine, control));
  plant.reset();
  std::string text;
  EXPECT_TRUE(eventually([&] {
    text = berth({"status", "--machine", machine, "--control", control}).out;
    return text.find("the port is down") != std::string::npos;
  })) << text;
  ::unlink(socket.c_str());
  start_plant();
  EXPECT_TRUE(operational(machine, control));
}

TEST_F(Live, OneBusOfAMachineInAProcessOfItsOwn) {
  const std::string two = on_plant("two") + "\n[bus.other]\nport = \"sim\"\nbitrate = 125_000\n";
  const std::string file = folder.write("two.toml", replaced(two, "[[slot]]", "\n[[slot]]"));
  EXPECT_EQ(berth({"up", file, "--until", "operational"}).status, 2) << "one bus is simulated and the other is not";
  const Outcome up = berth({"up", file, "--bus", "line", "--until", "operational", "--timeout", "100"});
  EXPECT_EQ(up.status, 0) << up.out << up.err;
  EXPECT_EQ(berth({"up", file, "--bus", "none"}).status, 2);
}

// The other master tolerates an SDO client, as most do.
TEST_F(Live, AdoptWritesAMachineFileThatUpRuns) {
  const std::string control = folder.file("first.sock");
  const std::string running =
      folder.write("running.toml", on_plant("running", "\ntolerate = [\"sdo\"]\nmaster_id = 100"));
  const Background first({"up", running, "--pace", "--control", control});
  ASSERT_TRUE(operational(running, control));
  EXPECT_TRUE(eventually([&] {
    const std::string log = folder.file("heard.log");
    static_cast<void>(berth({"trace", "--port", "plant:" + socket, "--bus", "line", "--timeout", "1 s", "-o", log}));
    const std::string heard = contents(log);
    return heard.find(" line 7") != std::string::npos && heard.find(" line 60") == std::string::npos;
  })) << "its SDO transfers are over";
  const std::string file = folder.file("adopted.toml");
  const Words words{"adopt",  file,       "--port", "plant:" + socket, "--bus", "line", "--bitrate",
                    "500000", "--master", "100",    "--json"};
  const Outcome adopt = berth(words);
  ASSERT_EQ(adopt.status, 0) << adopt.out << adopt.err;
  EXPECT_EQ(Json::parse(adopt.out).at("slots"), 3) << adopt.out;
  EXPECT_TRUE(operational(running, control)) << "nobody was disturbed";
  const std::string text = contents(file);
  EXPECT_NE(text.find("id   = 9"), std::string::npos) << text;
  EXPECT_NE(text.find("heartbeat_period = \"100 ms\""), std::string::npos) << text;
  EXPECT_EQ(berth(words).status, 1) << "nothing is overwritten";
  const Outcome up = berth({"up", file, "--sim", plant_file, "--store", folder.file("adopted.db"), "--fast", "--until",
                            "operational", "--json"});
  EXPECT_EQ(up.status, 0) << up.out << up.err;
}

TEST_F(Live, APassiveAdoptTellsWhatItHearsAndSendsNothing) {
  const std::string control = folder.file("first.sock");
  const Background first({"up", machine, "--pace", "--control", control});
  ASSERT_TRUE(operational(machine, control));
  const Outcome adopt = berth({"adopt", folder.file("adopted.toml"), "--port", "plant:" + socket, "--bus", "line",
                               "--bitrate", "500000", "--passive", "--for", "3", "--json"});
  EXPECT_EQ(adopt.status, 1) << adopt.out << adopt.err;
  const Json report = Json::parse(adopt.out);
  EXPECT_EQ(report.at("nodes").size(), 4U) << "three devices and the master: " << adopt.out;
  EXPECT_NE(report.at("master").at(0).get<std::string>().find("probably node 127"), std::string::npos) << adopt.out;
  EXPECT_FALSE(exists(folder.file("adopted.toml")));
  EXPECT_TRUE(operational(machine, control));
}

/// Beside the small plant's devices sits node 100, which sends nothing but a heartbeat, and node 5, a device as any.
class BesideAQuietNode : public Live {
 protected:
  void node_100(const std::string& startup) {
    const std::string eds = folder.write("master.eds", master_eds(startup));
    plant.reset();
    std::filesystem::remove(folder.file("state"));  // it belongs to the plant without node 100
    plant_file = folder.write("plant.toml", std::string(small_plant) +
                                                "\n[[device]]\nbus = \"line\"\nname = \"quiet\"\neds = \"" + eds +
                                                "\"\nserial = 0x77\nnode_id = 100\nheartbeat = \"100 ms\"\n" + worker);
    start_plant();
  }
  [[nodiscard]] Outcome up(const std::string& file, const Words& more = {}) const {
    Words words{"up", file, "--until", "operational", "--timeout", "100", "--control", folder.file("up.sock")};
    words.insert(words.end(), more.begin(), more.end());
    return berth(words);
  }
  static constexpr const char* worker =
      "[[device]]\nbus = \"line\"\nname = \"worker\"\ntype = { vendor = 1, product = 8 }\nserial = 0x50\n"
      "node_id = 5\nheartbeat = \"100 ms\"\n";
  const std::string named = "another master: node 100, its 1F80h bit 0 is set";
};

// A master with nothing but a heartbeat was taken for a device, and the bus was taken from it.
TEST_F(BesideAQuietNode, UpDoesNotTakeTheBusOfAMasterThatOnlyBeats) {
  node_100("0x9");
  const std::string record = folder.file("frames.log");
  const Outcome refused = up(machine, {"--record", record});
  EXPECT_EQ(refused.status, 1) << refused.out << refused.err;
  EXPECT_NE(refused.err.find(named), std::string::npos) << refused.err;
  EXPECT_NE(refused.err.find("1F81h"), std::string::npos) << refused.err;
  EXPECT_NE(refused.err.find("commissioner"), std::string::npos) << refused.err;
  std::ifstream in(record);
  std::size_t asked = 0;
  for (std::string line; std::getline(in, line);) {
    if (line.find(" 664#40801F00") != std::string::npos) ++asked;
    for (const char* const taken : {" 000#", " 7E5#", " 7C2#", " 1F94"}) {
      EXPECT_EQ(line.find(taken), std::string::npos) << line;
    }
  }
  EXPECT_EQ(asked, 1U) << "it was asked for 1F80h, and the bus was not taken";
  const Outcome scan = berth({"scan", "--all", "--machine", machine});
  EXPECT_EQ(scan.status, 1) << scan.out << scan.err;
  EXPECT_NE(scan.err.find(named), std::string::npos) << scan.err;
  const Outcome json = up(machine, {"--json"});
  EXPECT_EQ(json.status, 1);
  EXPECT_TRUE(Json::parse(json.out).contains("error")) << json.out;
}

TEST_F(BesideAQuietNode, ANodeThatIsNoMasterIsNoReasonToRefuse) {
  node_100("0x8");
  const Outcome done = up(machine);
  EXPECT_EQ(done.status, 0) << done.out << done.err;
  EXPECT_EQ(done.err.find("another master"), std::string::npos) << done.err;
}

/// The same behind a socketcand server: a port that counts as a real one, with a first start that is confirmed.
class FirstStart : public BesideAQuietNode {
 protected:
  FirstStart() {
    node_100("0x8");
    plant.reset();
    const int fd = io::listen_tcp({"127.0.0.1", 0}).value();
    where = io::to_string(*io::local_endpoint(fd));
    ::close(fd);
    plant =
        std::make_unique<Background>(Words{"serve", plant_file, "--listen", where, "--machine", sim_file, "--json"});
    served = plant->says("listening");
    file = folder.write("real.toml", replaced(on_plant("real"), "plant:" + socket, "socketcand://" + where + "/line"));
  }
  std::string where, file;
  bool served = false;
};

// Node 100 sends a heartbeat and has no 1F80h bit: it may be the master of the plant, whatever --yes says.
TEST_F(FirstStart, BesideWhatMayBeAMasterYesIsNotEnough) {
  ASSERT_TRUE(served);
  const std::string record = folder.file("frames.log");
  const Outcome refused = up(file, {"--yes", "--record", record});
  EXPECT_EQ(refused.status, 1) << refused.out << refused.err;
  EXPECT_NE(refused.err.find("node 100 (vendor-ID 00000002h, product code 00000009h"), std::string::npos)
      << refused.err;
  EXPECT_NE(refused.err.find("may be the master"), std::string::npos) << refused.err;
  EXPECT_NE(refused.err.find("--beside-master"), std::string::npos) << refused.err;
  const std::string frames = contents(record);
  EXPECT_NE(frames.find(" 664#40"), std::string::npos) << "it was asked what it is\n" << frames;
  for (const char* const taken : {" 000#", " 7E5#", " 7C2#", " 1F94"}) {
    EXPECT_EQ(frames.find(taken), std::string::npos) << taken << "\n" << frames;
  }
  const Outcome done = up(file, {"--yes", "--beside-master"});
  EXPECT_EQ(done.status, 0) << done.out << done.err;
  // It has run now: the next start asks for no second word.
  const Outcome again = up(file, {"--yes"});
  EXPECT_EQ(again.status, 0) << again.out << again.err;
}

// A device that has its slot is this machine's, whatever its 1F80h says; beside a master a commissioner may work.
TEST_F(BesideAQuietNode, ASlotsOwnDeviceAndACommissionerAreNotRefused) {
  node_100("0x9");
  const std::string slot =
      "\n[[slot]]\nbus = \"line\"\nid = 100\nname = \"quiet\"\ntype = { vendor = 2, product = 9, revision = 1 }\n";
  const Outcome done = up(folder.write("own.toml", on_plant("own") + slot));
  EXPECT_EQ(done.err.find("another master"), std::string::npos) << done.err;
  const std::string commissioner = folder.write("comm.toml", on_plant("comm", "\nrole = \"commissioner\""));
  const Outcome scan = berth({"scan", "--machine", commissioner, "--json"});
  EXPECT_EQ(scan.status, 0) << scan.out << scan.err;
}

TEST_F(BesideAQuietNode, AdoptWritesTheMasterDownAsWhatItIs) {
  node_100("0x9");
  const std::string file = folder.file("adopted.toml");
  const Outcome adopt = berth(
      {"adopt", file, "--port", "plant:" + socket, "--bus", "line", "--bitrate", "500000", "--for", "2", "--json"});
  ASSERT_EQ(adopt.status, 0) << adopt.out << adopt.err;
  EXPECT_NE(adopt.out.find("node 100 is an NMT master: bit 0 of its 1F80h is set"), std::string::npos) << adopt.out;
  const std::string text = contents(file);
  EXPECT_NE(text.find("\nmaster_id = 100\n"), std::string::npos) << text;
  EXPECT_NE(text.find("\nid   = 5\n"), std::string::npos) << text;
  EXPECT_EQ(text.find("id   = 100"), std::string::npos) << "it is no slot: " << text;
}

// What is half an adoption is none: the next one would be refused because of its files.
TEST_F(BesideAQuietNode, AnAdoptionThatIsEndedWritesNothing) {
  node_100("0x9");
  const std::string file = folder.file("adopted.toml");
  Background trace({"trace", "--port", "plant:" + socket, "--bus", "line", "-q", "-o", "-", "--to", "candump"});
  Background adopt(
      {"adopt", file, "--port", "plant:" + socket, "--bus", "line", "--bitrate", "500000", "--for", "3 s", "--all"});
  ASSERT_TRUE(trace.says(" 606#")) << "node 5 has told who it is, and 121 silent ones are still to be asked";
  adopt.signal(SIGTERM);
  const Outcome end = adopt.end();
  EXPECT_EQ(end.status, 1) << end.out;
  EXPECT_EQ(end.err, "berth: ended before all were asked; nothing was written\n");
  EXPECT_FALSE(exists(file));
  EXPECT_FALSE(exists(folder.file("adopted.db")));
}

// It asked before its port let a question out, and failed with "the port is listen-only".
TEST_F(BesideAQuietNode, AnAdoptionThatListensBrieflyWaitsForItsGate) {
  node_100("0x9");
  const Outcome adopt = berth({"adopt", folder.file("adopted.toml"), "--port", "plant:" + socket, "--bus", "line",
                               "--bitrate", "500000", "--for", "500 ms"});
  EXPECT_EQ(adopt.status, 0) << adopt.out << adopt.err;
}

TEST_F(BesideAQuietNode, AnAdoptionThatFailsLeavesNothing) {
  node_100("0x9");
  const std::string file = folder.file("adopted.toml");
  Words words{"adopt", file, "--port", "plant:" + socket, "--bus", "line", "--bitrate", "500000", "--for", "3 s"};
  Words nowhere = words;
  nowhere.insert(nowhere.end(), {"--store", folder.file("no folder/adopted.db")});
  EXPECT_EQ(berth(nowhere).status, 3);
  EXPECT_FALSE(exists(file));
  const Outcome adopt = berth(words);
  EXPECT_EQ(adopt.status, 0) << adopt.out << adopt.err;
}

TEST(Moving, ExportAndImportMoveAMachineWithItsBindings) {
  const Folder here;
  const Folder there;
  const std::string machine = here.write("small.toml", small_machine);
  const std::string plant = here.write("plant.toml", small_plant);
  const std::string state = here.file("state");
  ASSERT_EQ(berth({"up", machine, "--sim", plant, "--sim-state", state, "--store", here.file("small.db"), "--fast",
                   "--until", "operational"})
                .status,
            0);
  const std::string file = there.file("small.berth");
  const Outcome out = berth({"export", machine, file, "--json"});
  ASSERT_EQ(out.status, 0) << out.out << out.err;
  EXPECT_EQ(berth({"export", machine, file}).status, 1) << "nothing is overwritten";
  const Outcome in = berth({"import", file, there.file(".")});
  ASSERT_EQ(in.status, 0) << in.out << in.err;
  EXPECT_EQ(contents(there.file("small.toml")), contents(machine));
  EXPECT_EQ(berth({"import", file, there.file(".")}).status, 1) << "nor here";
  // Everybody is known at the new place: nobody is bound anew.
  const Outcome up = berth({"up", there.file("small.toml"), "--sim", plant, "--sim-state", state, "--store",
                            there.file("small.db"), "--fast", "--until", "operational", "--json"});
  ASSERT_EQ(up.status, 0) << up.out << up.err;
  EXPECT_EQ(up.out.find("\"kind\": \"bound\""), std::string::npos) << up.out;
}

TEST(Moving, WhatIsNoExportIsRefused) {
  const Folder folder;
  const auto import = [&](const std::string& text) {
    return berth({"import", folder.write("x.berth", text), folder.file("into")}).status;
  };
  EXPECT_EQ(import("nonsense"), 2);
  EXPECT_EQ(import("{}"), 2);
  EXPECT_EQ(import(R"({"berth_export": 2, "files": []})"), 2);
  EXPECT_EQ(import(R"({"berth_export": 1, "files": [{"name": "../evil", "base64": ""}]})"), 2);
  EXPECT_EQ(import(R"({"berth_export": 1, "files": [{"name": "/evil", "base64": ""}]})"), 2);
  EXPECT_EQ(import(R"({"berth_export": 1, "files": [{"name": "a", "base64": "A"}]})"), 2);
  EXPECT_EQ(import(R"({"berth_export": 1, "files": [{"name": "a", "base64": "=AAA"}]})"), 2);
  EXPECT_EQ(import(R"({"berth_export": 1, "files": [{"name": "a", "base64": ""}, {"name": "a", "base64": ""}]})"), 2);
  EXPECT_EQ(import(std::string(1'000'000, '[')), 2);
  const auto many =
      berth({"import", folder.write("y.berth", "{\"a\\\"[[[[[[[[[[\": [" + std::string(100'001, ',') + "]}")});
  EXPECT_NE(many.err.find("too many values, at byte 100017"), std::string::npos) << many.err;
  EXPECT_EQ(berth({"import", folder.file("none")}).status, 2);
  EXPECT_FALSE(exists(folder.file("into")));
}

TEST(Moving, AnExportFromElsewhereWritesNothingButPlainNewFiles) {
  const Folder folder;
  const auto import = [&](const std::string& name, const std::string& more = "") {
    const std::string text = R"({"berth_export": 1, "files": [{"name": "a/first", "base64": ""}, {"name": ")" + name +
                             R"(", "base64": ""}])" + more + "}";
    return berth({"import", folder.write("x.berth", text), folder.file("into")});
  };
  for (const char* const name : {".bashrc", ".config/x", "x/.hidden", "a/./b", "a//b", "x\\u001b[2J", "x\\ny", "x\\\\y",
                                 "\\u202egnp", "x/", "..", "a/first/under", "a"}) {
    const auto out = import(name);
    EXPECT_EQ(out.status, 2) << name << out.err;
    EXPECT_EQ(out.err.find('\x1b'), std::string::npos) << name;
    EXPECT_FALSE(exists(folder.file("into"))) << name;
  }
  const auto store = import("b", R"(, "store": {"name": "m.db", "base64": "bm8gc3RvcmU="})");
  EXPECT_EQ(store.status, 2) << store.err;
  EXPECT_NE(store.err.find("not a Berth store"), std::string::npos) << store.err;
  EXPECT_FALSE(exists(folder.file("into")));
}

// The folder that it is put into may be another person's work: links in it lead elsewhere.
TEST(Moving, AnImportFollowsNoLinks) {
  const Folder folder;
  const Folder elsewhere;
  const std::string file = folder.write(
      "x.berth",
      R"({"berth_export": 1, "files": [{"name": "m.toml", "base64": ""}, {"name": "sub/b", "base64": ""}]})");
  ASSERT_EQ(::symlink(elsewhere.file(".").c_str(), folder.file("sub").c_str()), 0);
  const auto out = berth({"import", file, folder.file(".")});
  EXPECT_EQ(out.status, 1) << out.err;
  EXPECT_FALSE(exists(elsewhere.file("b")));
  EXPECT_FALSE(exists(folder.file("m.toml")));
  ASSERT_EQ(::unlink(folder.file("sub").c_str()), 0);
  ASSERT_EQ(::symlink(elsewhere.file("new").c_str(), folder.file("m.toml").c_str()), 0);
  EXPECT_EQ(berth({"import", file, folder.file(".")}).status, 1);
  EXPECT_FALSE(exists(elsewhere.file("new")));
  EXPECT_FALSE(exists(folder.file("sub")));
}

TEST(Moving, AnImportThatFailsHalfWayTakesAwayWhatItMadeAndNothingElse) {
  const Folder folder;
  // The name of the last file fits into an export, and with its folder into no path of the system.
  std::string deep = "d";
  for (int i = 0; i < 40; ++i) deep += "/dd";
  const std::string into = folder.file(std::string(100, 'p') + "/" + std::string(200, 'q'));
  std::string base = into;
  while (base.size() < 4000) base += "/" + std::string(100, 'r');
  const std::string file =
      folder.write("x.berth", R"({"berth_export": 1, "files": [{"name": "a", "base64": ""}, {"name": ")" + deep +
                                  R"(", "base64": ""}]})");
  const auto out = berth({"import", file, base});
  EXPECT_NE(out.status, 0);
  EXPECT_FALSE(exists(folder.file(std::string(100, 'p'))));
  EXPECT_TRUE(exists(file));
}

}  // namespace
}  // namespace berth::test

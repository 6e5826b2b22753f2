// Single commands, wrong input, the control socket between two processes.
#include <gtest/gtest.h>
#include <poll.h>
#include <rapidcheck/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>
#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <functional>
#include <nlohmann/json.hpp>
#include <sstream>

#include "berth/can/frame.hpp"
#include "berth/command/control.hpp"
#include "berth/command/request.hpp"
#include "command_fixture.hpp"

namespace berth::test {
namespace {

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

TEST_F(Command, MemoryOfTheDevicesNeedsAPlaceForAFile) {
  for (const char* place : {"/tmp", "/no such folder/state"}) {
    const Outcome outcome = berth({"up", machine, "--sim", plant, "--sim-state", place});
    EXPECT_EQ(outcome.status, 3) << outcome.err;
    EXPECT_TRUE(contains(outcome.err, place)) << outcome.err;
  }
}

// ---- services ----

TEST_F(Command, ScanSeesBlankAndConfiguredDevices) {
  const Json blank = reply({"scan"}, 0);
  EXPECT_EQ(blank.at("configured"), 0);
  EXPECT_EQ(blank.at("unconfigured"), 3);
  for (const auto& node : blank.at("nodes")) EXPECT_TRUE(node.at("id").is_null());
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
  const std::string twins = folder.write("twins.toml", text);
  const Outcome outcome = berth({"scan", "--machine", machine, "--sim", twins, "--json"});
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
           {"sdo", "read", "3/5", "0x1000"},
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
  for (const Words& words : std::vector<Words>{{"up", folder.file("none.toml"), "--sim", plant},
                                               {"up", machine, "--sim", folder.file("none.toml")},
                                               {"scan", "--machine", folder.file("none.toml")},
                                               {"up", machine},
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

// ---- the running machine ----

class Running : public Command {
 protected:
  void begin(const std::string& plant_file) {
    up_ = std::make_unique<Background>(Words{"up", machine, "--sim", plant_file, "--pace", "--control", socket});
    ASSERT_TRUE(wait_for("left", "operational"));
  }
  [[nodiscard]] Outcome ask(Words words) const {
    words.insert(words.end(), {"--control", socket, "--json"});
    return berth(words);
  }
  [[nodiscard]] bool wait_for(const std::string& slot, const std::string& state) const {
    return eventually([&] {
      const Outcome outcome = ask({"status"});
      if (outcome.status > 1) return false;  // 1: a slot is not operational
      const Json slots = Json::parse(outcome.out).at("slots");
      return std::ranges::any_of(slots, [&](const Json& s) { return s.at("name") == slot && s.at("state") == state; });
    });
  }
  /// A connection of the control socket's own, without a process of Berth.
  [[nodiscard]] int connected() const {
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    socket.copy(address.sun_path, sizeof address.sun_path - 1);
    EXPECT_EQ(::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    const timeval patience{60, 0};  // for an answer that never comes; no figure of the product
    EXPECT_EQ(::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience), 0);
    return fd;
  }
  static void put(int fd, const std::string& text) {
    EXPECT_EQ(::send(fd, text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
  }
  /// Up to the end of the line, or of the connection.
  static std::string take(int fd) {
    std::string answer;
    char c = 0;
    while (!answer.ends_with('\n') && ::recv(fd, &c, 1, 0) == 1) answer += c;
    return answer;
  }
  /// That the running process has used.
  [[nodiscard]] double processor_seconds() const {
    std::istringstream words(contents("/proc/" + std::to_string(up_->pid()) + "/stat"));
    std::string word;
    for (int i = 0; i < 13; ++i) words >> word;
    double user = 0, system = 0;
    words >> user >> system;
    return (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  }
  std::string socket = folder.file("up.sock");
  std::unique_ptr<Background> up_;
};

TEST_F(Running, OtherCommandsJoinItsWorld) {
  begin(plant);
  ASSERT_TRUE(wait_for("drive", "operational"));
  struct stat status {};
  ASSERT_EQ(::stat(socket.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
  const Json value = Json::parse(ask({"sdo", "read", "9", "0x1018", "4", "-t", "u32"}).out);
  EXPECT_EQ(value.at("value"), 0x30);
  const Json scan = Json::parse(ask({"scan"}).out);
  EXPECT_EQ(scan.at("configured"), 3);
  EXPECT_EQ(ask({"sdo", "read", "9", "0x7777"}).status, 1);
  EXPECT_EQ(ask({"sdo", "read", "999", "0x7777"}).status, 2);
  EXPECT_EQ(ask({"lss", "inquire", left}).status, 0);
  EXPECT_EQ(ask({"replace", "left"}).status, 1) << "its device is there and answers";
  const Outcome second = berth({"up", machine, "--sim", plant, "--pace", "--control", socket});
  EXPECT_EQ(second.status, 3);
  EXPECT_TRUE(contains(second.err, std::to_string(up_->pid()))) << second.err;
  up_->signal(SIGINT);
  const Outcome end = up_->end();
  EXPECT_EQ(end.status, 0) << end.err;
  EXPECT_TRUE(contains(end.out, "operational"));
  EXPECT_FALSE(exists(socket)) << "it is taken away at the end";
  const Outcome late = ask({"status"});
  EXPECT_EQ(late.status, 3);
  EXPECT_TRUE(contains(late.out, "--sim PLANT")) << late.out;
}

// Which of two devices alike belongs in which slot is asked where the main job runs on a terminal, and what is typed
// there is taken when a question is open.
TEST_F(Running, OnATerminalAQuestionIsAnsweredByTyping) {
  std::string text = small_machine;
  const std::string ascending = "\"ascending\"";
  for (auto at = text.find(ascending); at != std::string::npos; at = text.find(ascending)) {
    text.replace(at, ascending.size(), "\"ask\"");
  }
  const std::string asks = folder.write("asks.toml", text);
  up_ = std::make_unique<Background>(Words{"up", asks, "--sim", plant, "--control", socket}, OnTerminal{});
  ASSERT_TRUE(up_->says("type a slot (left, right)"));
  up_->type("left\n");
  EXPECT_TRUE(up_->says("type a slot and the number of its device")) << "what is no answer is told";
  up_->type("left 2\n");
  EXPECT_TRUE(wait_for("left", "operational"));
  EXPECT_TRUE(wait_for("right", "operational"));
  const Json slots = Json::parse(ask({"status"}).out).at("slots");
  EXPECT_NE(slots.at(0).dump().find("00000021"), std::string::npos) << slots;
  up_->signal(SIGINT);
  EXPECT_EQ(up_->end().status, 0);
}

// Every frame of a machine that runs, by its control socket: a second process decodes what the first one holds.
TEST_F(Running, ATraceJoinsThroughTheControlSocket) {
  begin(plant);
  Background trace({"trace", "--machine", machine, "--control", socket});
  ASSERT_TRUE(trace.says("Heartbeat")) << trace.said();
  ASSERT_EQ(ask({"sdo", "read", "2", "0x1018", "4"}).status, 0);
  EXPECT_TRUE(trace.says("1018")) << trace.said();
  trace.signal(SIGINT);
  EXPECT_EQ(trace.end().status, 0);
}

// A client that takes nothing costs a bounded amount, and is told how much it missed; the machine goes on.
TEST_F(Running, AFollowerThatIsTooSlowMissesFramesAndIsTold) {
  begin(plant);
  const int slow = connected();
  const int little = 2048;
  ::setsockopt(slow, SOL_SOCKET, SO_RCVBUF, &little, sizeof little);
  put(slow, "{\"verb\": \"frames\", \"arguments\": {}}\n");
  const std::string first = take(slow);
  EXPECT_TRUE(first.starts_with("(")) << first;
  EXPECT_NE(first.find(") line "), std::string::npos) << first;
  // 1 MiB and what the system keeps: some 40,000 frames.
  const int flood = connected();
  for (int i = 0; i < 40; ++i) {
    put(flood, R"({"verb": "sdo probe", "arguments": {"node": "2", "objects": "1018:0-FF,1000:0-FF,1001:0-FF"}})"
               "\n");
    ASSERT_FALSE(take(flood).empty());
  }
  std::string line;
  std::size_t dropped = 0;
  for (int i = 0; i < 200'000 && dropped == 0; ++i) {
    line = take(slow);
    ASSERT_FALSE(line.empty());
    if (line.starts_with("dropped ")) dropped = std::stoul(line.substr(8));
  }
  EXPECT_GT(dropped, 0U);
  ::close(slow);
  ::close(flood);
  EXPECT_TRUE(wait_for("left", "operational"));
}

TEST_F(Running, ARecordIsWholeLinesWhileItGrowsAndWhenItIsKilled) {
  const std::string record = folder.file("frames.log");
  up_ = std::make_unique<Background>(
      Words{"up", machine, "--sim", plant, "--pace", "--control", socket, "--record", record});
  ASSERT_TRUE(wait_for("left", "operational"));
  ASSERT_TRUE(eventually([&] { return contents(record).find(" 702#05") != std::string::npos; }))
      << "it can be followed";
  up_->signal(SIGKILL);
  EXPECT_EQ(up_->end().status, 128 + SIGKILL);
  const std::string text = contents(record);
  EXPECT_TRUE(text.ends_with("\n"));
  const auto read = berth({"trace", record, "--stats", "--json"});
  EXPECT_EQ(read.status, 0) << read.out;
}

TEST_F(Running, ANodeThatWasStoppedByHandStaysStopped) {
  begin(plant);
  ASSERT_TRUE(wait_for("drive", "operational"));
  EXPECT_EQ(ask({"nmt", "stop", "9"}).status, 0);
  EXPECT_TRUE(wait_for("drive", "present"));
  EXPECT_EQ(ask({"nmt", "start", "9"}).status, 0);
  EXPECT_TRUE(wait_for("drive", "operational"));
}

// Who has left the bus is not shown, whatever it said last.
TEST_F(Running, ScanShowsWhoIsThereNow) {
  begin(folder.write("leaves.toml", std::string(small_plant) + R"(
[[event]]
after  = "operational"
delay  = "200 ms"
action = "unplug"
device = "c"
)"));
  ASSERT_TRUE(wait_for("drive", "absent"));
  EXPECT_EQ(ask({"status"}).status, 1) << "a slot is not operational";
  EXPECT_EQ(ask({"status", "--bus", "line"}).status, 1);
  const Json scan = Json::parse(ask({"scan"}).out);
  EXPECT_EQ(scan.at("configured"), 2) << scan;
}

// S1.35, S1.51: the drive dies, a person presses the button, the spare takes its place.
TEST_F(Running, ReplaceClearsAndSeatsTheNewDevice) {
  begin(folder.write("dies.toml", std::string(small_plant) + drive_dies));
  ASSERT_TRUE(wait_for("drive", "absent"));
  const Outcome replaced = ask({"replace", "drive"});
  EXPECT_EQ(replaced.status, 0) << replaced.out;
  EXPECT_EQ(Json::parse(replaced.out).at("r_sn"), "0x0000000300000031");
  EXPECT_TRUE(wait_for("drive", "operational"));
  up_->signal(SIGTERM);
  EXPECT_EQ(up_->end().status, 0);
}

// A client may send its next request before it has the answer to the one before: nothing else wakes the process for it.
TEST_F(Running, RequestsThatComeTogetherAreAnsweredOneAfterTheOther) {
  begin(plant);
  const int fd = connected();
  put(fd, "no request\n{\"verb\": \"report\"}\n{\"verb\": \"scan\"}\nno request either\n");
  std::vector<int> statuses;
  for (int i = 0; i < 4; ++i) {
    const Json answer = Json::parse(take(fd), nullptr, false);
    ASSERT_TRUE(answer.is_object()) << "answer " << i;
    statuses.push_back(answer.at("status").get<int>());
  }
  EXPECT_EQ(statuses, (std::vector<int>{2, 0, 0, 2}));
  ::close(fd);
}

// It takes sixteen clients. Whoever waits behind them is served when one leaves, and keeps nobody awake meanwhile.
TEST_F(Running, AClientTooManyWaitsWithoutKeepingTheProcessBusy) {
  begin(plant);
  std::vector<int> clients;
  for (int i = 0; i < 17; ++i) clients.push_back(connected());
  put(clients.back(), "{\"verb\": \"report\"}\n");
  for (int i = 0; i < 16; ++i) put(clients[static_cast<std::size_t>(i)], "no request\n");
  for (int i = 0; i < 16; ++i) EXPECT_FALSE(take(clients[static_cast<std::size_t>(i)]).empty());
  const double before = processor_seconds();
  pollfd answer{clients.back(), POLLIN, 0};
  EXPECT_EQ(::poll(&answer, 1, 1000), 0) << "there is no place for it yet";
  EXPECT_LT(processor_seconds() - before, 0.2);
  ::close(clients.front());
  EXPECT_FALSE(take(clients.back()).empty());
  for (int i = 1; i < 17; ++i) ::close(clients[static_cast<std::size_t>(i)]);
}

TEST_F(Running, TheSocketOfADeadProcessIsTakenOver) {
  begin(plant);
  up_->signal(SIGKILL);
  static_cast<void>(up_->end());
  EXPECT_TRUE(exists(socket));
  begin(plant);
  EXPECT_EQ(ask({"status"}).status, 0);
}

TEST_F(Running, GarbageOnTheSocketIsAnsweredAndHarmsNobody) {
  begin(plant);
  const auto say = [&](const std::string& text) {
    const int fd = connected();
    put(fd, text);
    const std::string answer = take(fd);
    ::close(fd);
    return answer;
  };
  for (const char* const text :
       {"\n", "hello\n", "{}\n", "[1]\n", "{\"verb\": 3}\n", "{\"verb\": \"x\", \"arguments\": {\"a\": 1}}\n",
        "{\"verb\": \"format disk\"}\n", "{\"verb\": \"scan\", \"arguments\": {\"bus\": \"\xff\"}}\n"}) {
    const Json answer = Json::parse(say(text), nullptr, false);
    ASSERT_TRUE(answer.is_object()) << text;
    EXPECT_EQ(answer.at("status"), 2) << text;
  }
  EXPECT_EQ(say(std::string(100'000, 'x')), "") << "an endless line is hung up on";
  EXPECT_EQ(ask({"status"}).status, 0);
}

TEST_F(Running, WhoHangsUpEndsHisCommand) {
  begin(plant);
  const int fd = connected();
  const int other = connected();
  put(fd, "{\"verb\":\"scan\",\"arguments\":{}}\n");
  put(other, "{\"verb\":\"status\",\"arguments\":{}}\n");
  EXPECT_NE(take(other), "") << "asked later and answered: the scan has begun";
  ::close(other);
  char c = 0;
  EXPECT_EQ(::recv(fd, &c, 1, MSG_DONTWAIT), -1) << "and is not over";
  ::close(fd);
  EXPECT_EQ(ask({"scan"}).status, 0) << "the bus is free again";
}

// ---- small things ----

TEST(Program, VersionHelpAndScenes) {
  EXPECT_EQ(berth({"version"}).out.substr(0, 6), "berth ");
  EXPECT_TRUE(Json::parse(berth({"version", "--json"}).out).at("version").is_string());
  EXPECT_EQ(berth({"--help"}).status, 0);
  EXPECT_EQ(berth({"up", "--help"}).status, 0);
  EXPECT_EQ(berth({}).status, 2);
  EXPECT_TRUE(contains(berth({"skan"}).err, "did you mean scan?"));
}

// docs/protocols/can-frames.md §Arbitration: the seventeenth collision; a lone node stays error passive and is never
// bus-off.
TEST(Program, Scenes) {
  const Json two = Json::parse(berth({"sim", "two-with-one-id", "--json"}).out);
  bool both_passive = false;
  for (const auto& step : two.at("steps")) {
    unsigned at_128 = 0;
    for (const auto& node : step.at("nodes")) at_128 += node.at("tec") == 128 ? 1U : 0U;
    both_passive = both_passive || at_128 == 2;
  }
  EXPECT_TRUE(both_passive);
  const Json lone = Json::parse(berth({"sim", "lone-node", "--json"}).out);
  const Json& last = lone.at("steps").back().at("nodes").at(0);
  EXPECT_EQ(last.at("tec"), 128);
  EXPECT_EQ(last.at("state"), "passive");
  EXPECT_TRUE(contains(berth({"sim", "lone-node"}).out, "TEC 128"));
  // S4.1: the two roads to bus-off.
  const Json again = Json::parse(berth({"sim", "again-with-one-id", "--json"}).out);
  EXPECT_EQ(again.at("steps").back().at("nodes").at(1).at("state"), "bus-off");
  EXPECT_EQ(again.at("steps").back().at("nodes").at(1).at("tec"), 262);
  const Json rate = Json::parse(berth({"sim", "wrong-bit-rate", "--json"}).out);
  EXPECT_EQ(rate.at("steps").back().at("nodes").at(0).at("state"), "bus-off");
  EXPECT_EQ(rate.at("steps").back().at("nodes").at(2).at("state"), "active");
  EXPECT_EQ(berth({"sim", "three-nodes"}).status, 2);
}

RC_GTEST_PROP(ControlLine, RequestsComeBack, ()) {
  command::Request request;
  request.verb = "v" + *rc::gen::container<std::string>(rc::gen::inRange<char>(1, 127));
  request.arguments = *rc::gen::container<std::map<std::string, std::string>>(
      rc::gen::container<std::string>(rc::gen::inRange<char>(1, 127)),
      rc::gen::container<std::string>(rc::gen::inRange<char>(1, 127)));
  const std::string line = command::to_json(request);
  RC_ASSERT(line.find('\n') == std::string::npos);
  std::string error;
  RC_ASSERT(command::parse_request(line, error) == request);
  RC_ASSERT(error.empty());
}

RC_GTEST_PROP(ControlLine, AnyBytesAreARequestOrAReason, (const std::string& bytes)) {
  std::string error;
  const auto request = command::parse_request(bytes, error);
  RC_ASSERT(request.verb.empty() == !error.empty());
  RC_ASSERT(command::parse_reply(bytes).status == 3);
}

RC_GTEST_PROP(ControlLine, RepliesComeBack, (int status, const std::vector<std::uint8_t>& bytes)) {
  command::Reply reply = command::refusal(status, "because");
  std::string text;
  for (const auto b : bytes) text += static_cast<char>(1 + b % 126);
  reply.lines = {text, ""};
  const std::string line = command::to_json(reply);
  RC_ASSERT(line.find('\n') == std::string::npos);
  const auto back = command::parse_reply(line);
  RC_ASSERT(back.status == status);
  RC_ASSERT(back.lines == reply.lines);
  RC_ASSERT(back.error == "because");
  RC_ASSERT(Json::parse(back.json) == Json::parse(reply.json));
}

TEST(ControlPath, LiesWithItsOwnerAndKnowsItsMachine) {
  ::unsetenv("XDG_RUNTIME_DIR");
  EXPECT_EQ(command::control_path("five slaves"), "/tmp/berth-" + std::to_string(::getuid()) + "/five_slaves.sock");
  EXPECT_EQ(command::control_path("../x"), "/tmp/berth-" + std::to_string(::getuid()) + "/.._x.sock");
  ::setenv("XDG_RUNTIME_DIR", "/tmp", 1);
  EXPECT_EQ(command::control_path("m"), "/tmp/berth-m.sock");
  ::setenv("XDG_RUNTIME_DIR", "/no/such/folder", 1);
  EXPECT_EQ(command::control_path("m"), "/tmp/berth-" + std::to_string(::getuid()) + "/m.sock");
  ::unsetenv("XDG_RUNTIME_DIR");
}

// /tmp/berth-UID is whoever's who made it first: a client asks nothing of what listens in a stranger's folder.
TEST(ControlPath, AFolderThatOthersCanWriteToIsNotBelieved) {
  const std::string folder = "/tmp/berth-" + std::to_string(::getuid());
  struct stat before {};
  const bool there = ::stat(folder.c_str(), &before) == 0;
  ASSERT_TRUE(there || ::mkdir(folder.c_str(), 0700) == 0);
  ASSERT_EQ(::chmod(folder.c_str(), 0777), 0);
  const auto reply = command::control_call(folder + "/m.sock", {"report", {}}, 100);
  ASSERT_EQ(::chmod(folder.c_str(), 0700), 0);
  if (!there) ::rmdir(folder.c_str());
  ASSERT_FALSE(reply);
  EXPECT_TRUE(contains(reply.error(), "not this user's alone")) << reply.error();
}

/// Listens as a stranger might, in a process of its own, and does `with` what it accepts.
class Listener {
 public:
  Listener(const std::string& path, uid_t as, const std::function<void(int)>& with) {
    const int fd = ::socket(AF_UNIX, SOCK_STREAM, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    EXPECT_EQ(::bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    ::chmod(path.c_str(), 0777);
    child_ = ::fork();
    if (child_ == 0) {
      // The credentials that a peer sees are those at the time of listen(2).
      if (as != ::geteuid() && ::setuid(as) != 0) ::_exit(1);
      ::listen(fd, 8);
      ::kill(::getpid(), SIGSTOP);
      for (int client = 0; (client = ::accept(fd, nullptr, nullptr)) >= 0; ::close(client)) with(client);
      ::_exit(0);
    }
    int status = 0;
    ::waitpid(child_, &status, WUNTRACED);
    ::kill(child_, SIGCONT);
    ::close(fd);
  }
  ~Listener() {
    ::kill(child_, SIGKILL);
    ::waitpid(child_, nullptr, 0);
  }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

 private:
  pid_t child_ = -1;
};

TEST(ControlPath, AnotherUsersProcessIsNotAsked) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can be a stranger to itself";
  const Folder folder;
  const std::string path = folder.file("s");
  constexpr uid_t stranger = 65534;
  const Listener listener(path, stranger, [](int fd) {
    constexpr std::string_view lie = "{\"status\": 0, \"reply\": {}, \"lines\": [\"all is well\"], \"error\": \"\"}\n";
    (void)::write(fd, lie.data(), lie.size());
  });
  const auto reply = command::control_call(path, {"report", {}}, 5000);
  ASSERT_FALSE(reply);
  EXPECT_TRUE(contains(reply.error(), "another user (65534)")) << reply.error();
}

TEST(ControlPath, AnAnswerWithoutEndIsGivenUp) {
  const Folder folder;
  const std::string path = folder.file("s");
  const Listener listener(path, ::geteuid(), [](int fd) {
    const std::string much(65536, 'x');
    for (int i = 0; i < 320 && ::send(fd, much.data(), much.size(), MSG_NOSIGNAL) > 0;
         ++i) {  // 20 MiB, and no line end
    }
  });
  const auto reply = command::control_call(path, {"report", {}}, 60'000);
  ASSERT_FALSE(reply);
  EXPECT_TRUE(contains(reply.error(), "more than 16777216 bytes")) << reply.error();
}

TEST(ControlPath, ALongOneIsRefusedInWords) {
  const auto reply = command::control_call("/tmp/" + std::string(200, 'x'), {"report", {}}, 100);
  ASSERT_FALSE(reply);
  EXPECT_TRUE(contains(reply.error(), "--control"));
}

}  // namespace
}  // namespace berth::test

// The control socket between two processes: what other commands ask of a running `berth up`.
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "../paths.hpp"
#include "running_fixture.hpp"

namespace berth::test {
namespace {

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

// 80 columns: no row breaks, and times count from the first one.
TEST_F(Running, ALiveTraceOnATerminalHasOneLineARow) {
  begin(plant);
  Background trace({"trace", "--machine", machine, "--control", socket}, OnTerminal{80, 24, "xterm", false});
  ASSERT_TRUE(trace.says("Heartbeat")) << trace.said();
  ASSERT_EQ(ask({"sdo", "dump", "2"}).status, 0);
  ASSERT_TRUE(trace.says("1018h")) << trace.said();
  trace.signal(SIGINT);
  std::istringstream rows(trace.end().out);
  std::string row;
  std::string first;
  while (std::getline(rows, row)) {
    if (row.ends_with('\r')) row.pop_back();
    if (first.empty()) first = row;
    EXPECT_LE(row.size(), 80U) << row;
  }
  EXPECT_TRUE(first.starts_with("    0.0000 ")) << first;
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
  EXPECT_TRUE(contains(ask({"status"}).out, "NMT stopped by command; `berth nmt start 9` starts it"))
      << "who asks behind the command is told what it now is";
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

// Without a spare it says at once what it waits for.
TEST_F(Running, ReplaceSaysWhatItWaitsForAndThePlantKnowsWhoSatThere) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  ASSERT_EQ(ask({"sim", "unplug", "left"}).status, 0);
  ASSERT_TRUE(wait_for("left", "absent"));
  const Outcome outcome = berth({"replace", "left", "--control", socket});
  EXPECT_EQ(outcome.status, 1) << outcome.out;
  // On a busy computer its device has been asked for in vain by now, and that is the reason.
  EXPECT_TRUE(contains(outcome.err, "left released (heartbeat lost)") ||
              contains(outcome.err, "left released (no heartbeat") ||
              contains(outcome.err, "left released (its identity cannot be read"))
      << outcome.err;
  EXPECT_TRUE(contains(outcome.err, "); waiting for a new device, ")) << outcome.err;
  EXPECT_EQ(ask({"sim", "plug", "left"}).status, 0) << "who sat there last";
}

// Ctrl-Z: `status` said nothing for two minutes.
TEST_F(Running, AProcessThatIsStoppedIsToldAtOnce) {
  begin(plant);
  ::kill(up_->pid(), SIGSTOP);
  const Outcome outcome = ask({"status"});
  ::kill(up_->pid(), SIGCONT);
  EXPECT_EQ(outcome.status, 3);
  EXPECT_TRUE(contains(outcome.out + outcome.err, "is stopped (Ctrl-Z)")) << outcome.out << outcome.err;
  EXPECT_FALSE(contains(outcome.out + outcome.err, "start one")) << "there is one: " << outcome.err;
}

TEST_F(Running, NmtTakesTheStatesToo) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  for (const auto& [word, meant] : {std::pair{"pre-operational", "preop"}, std::pair{"operational", "start"}}) {
    const Outcome outcome = ask({"nmt", word, "left"});
    ASSERT_EQ(outcome.status, 0) << outcome.out;
    EXPECT_EQ(Json::parse(outcome.out).at("command"), meant);
  }
  const Outcome wrong = berth({"nmt", "go", "left", "--control", folder.file("nobody")});
  EXPECT_EQ(wrong.status, 2) << "the word before the missing process: " << wrong.err;
  EXPECT_TRUE(contains(wrong.err, "\"go\" is not an NMT command")) << wrong.err;
}

TEST_F(Running, StatusOfOneSlotTellsAllThatIsKnown) {
  begin(folder.write("leaves.toml", std::string(small_plant) + R"(
[[event]]
after  = "operational"
delay  = "200 ms"
action = "unplug"
device = "c"
)"));
  ASSERT_TRUE(wait_for("drive", "absent"));
  const Outcome outcome = ask({"status", "drive"});
  EXPECT_EQ(outcome.status, 1) << "it is not operational";
  const Json drive = Json::parse(outcome.out);
  EXPECT_EQ(drive.at("name"), "drive");
  EXPECT_EQ(drive.at("state"), "absent");
  EXPECT_EQ(drive.at("address"), "00000001-00000007-00000003-00000030");
  // On a busy computer its device has been asked for in vain by now, and that is the reason.
  EXPECT_TRUE(contains(drive.at("reason"), "`berth replace` it")) << drive;
  ASSERT_FALSE(drive.at("events").empty()) << drive;
  EXPECT_TRUE(contains(drive.at("events").dump(), "heartbeat lost")) << drive;
  EXPECT_EQ(drive.at("events").back().at("slot"), "drive");
  EXPECT_TRUE(contains(drive.at("history").dump(), "confirmed")) << drive;
  EXPECT_EQ(ask({"status", "left"}).status, 0) << "the others are well";
  EXPECT_EQ(ask({"status", "line/left"}).status, 0);
  EXPECT_EQ(ask({"status", "nobody"}).status, 2);
  const Outcome words = berth({"status", "left", "--control", socket});
  EXPECT_TRUE(words.out.starts_with("line/left, node-ID 2: operational, since ")) << words.out;
  EXPECT_TRUE(contains(words.out, "\ndevice         00000001-00000001-00000000-00000020\n")) << words.out;
  EXPECT_TRUE(contains(words.out, "\nNMT state      operational, heard 0.")) << words.out;
  const Outcome coloured = berth({"status", "--control", socket, "--color", "always"});
  const auto begin = coloured.out.find("\x1b[33m");
  ASSERT_NE(begin, std::string::npos) << coloured.out;
  EXPECT_TRUE(contains(coloured.out.substr(begin, coloured.out.find("\x1b[0m") - begin), "drive  absent"));
  EXPECT_EQ(coloured.out.find("\x1b[33m", begin + 1), std::string::npos) << "the others are well: " << coloured.out;
}

// `... --watch "100 ms" | head -2` went on for ever.
TEST_F(Running, AWatchEndsWithItsReader) {
  begin(plant);
  const std::string script = "bash -c 'set -o pipefail; " + std::string("timeout 60 ") + binary() +
                             " status --watch \"50 ms\" --control " + socket +
                             " | head -2 >/dev/null; exit ${PIPESTATUS[0]}'";
  const int status = std::system(script.c_str());
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_NE(WEXITSTATUS(status), 124) << "it was ended from outside";
}

// A client may send its next request before it has the answer to the one before: nothing else wakes the process for it.
TEST_F(Running, RequestsThatComeTogetherAreAnsweredOneAfterTheOther) {
  begin(plant);
  ASSERT_TRUE(all_operational());
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

// It takes sixteen clients, none of which gives its seat before it was idle for 10 s. One more is told so at once, and
// served when one has left.
TEST_F(Running, AClientTooManyIsRefusedInWords) {
  begin(plant);
  std::vector<int> clients;
  for (int i = 0; i < 17; ++i) clients.push_back(connected());
  EXPECT_NE(take(clients.back()).find("try again when one is done"), std::string::npos);
  for (int i = 0; i < 16; ++i) put(clients[static_cast<std::size_t>(i)], "no request\n");
  for (int i = 0; i < 16; ++i) EXPECT_FALSE(take(clients[static_cast<std::size_t>(i)]).empty());
  const double before = processor_seconds();
  ::poll(nullptr, 0, 1000);
  EXPECT_LT(processor_seconds() - before, 0.2) << "nobody keeps it awake";
  ::close(clients.front());
  ::close(clients.back());
  std::string answer;
  for (int tries = 0; tries < 50 && answer.find("slots") == std::string::npos; ++tries) {
    ::poll(nullptr, 0, 100);  // until it has seen that one left
    clients.back() = connected();
    put(clients.back(), "{\"verb\": \"report\"}\n");
    answer = take(clients.back());
    if (answer.find("slots") == std::string::npos) ::close(clients.back());
  }
  EXPECT_NE(answer.find("slots"), std::string::npos) << answer;
  for (int i = 1; i < 17; ++i) ::close(clients[static_cast<std::size_t>(i)]);
}

TEST_F(Running, TheSocketOfADeadProcessIsTakenOver) {
  begin(plant);
  up_->signal(SIGKILL);
  static_cast<void>(up_->end());
  EXPECT_TRUE(exists(socket));
  begin(plant);
  EXPECT_TRUE(all_operational());
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
  EXPECT_TRUE(all_operational());
}

TEST_F(Running, WhoHangsUpEndsHisCommand) {
  begin(plant);
  const int fd = connected();
  const int other = connected();
  put(fd, "{\"verb\":\"scan\",\"arguments\":{\"all\":\"1\"}}\n");
  put(other, "{\"verb\":\"status\",\"arguments\":{}}\n");
  EXPECT_NE(take(other), "") << "asked later and answered: the scan has begun";
  ::close(other);
  char c = 0;
  EXPECT_EQ(::recv(fd, &c, 1, MSG_DONTWAIT), -1) << "and is not over";
  ::close(fd);
  EXPECT_EQ(ask({"scan", "--all"}).status, 0) << "the bus is free again";
}

}  // namespace
}  // namespace berth::test

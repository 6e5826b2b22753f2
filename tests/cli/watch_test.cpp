// `berth watch`, and the values in the live table of `berth up`.
#include <stdlib.h>
#include <sys/wait.h>

#include <map>
#include <set>
#include <sstream>

#include "../paths.hpp"
#include "running_fixture.hpp"
#include "terminal.hpp"

namespace berth::test {
namespace {

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

class Watch : public Running {
 protected:
  // In the process that runs the machine; its names come from the machine's file.
  [[nodiscard]] Outcome watch(Words words) const {
    words.insert(words.begin(), {"watch", "-m", machine, "--control", socket});
    return berth(words);
  }
};

TEST_F(Watch, EachReadingIsALineWhereNoTerminalIs) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  const Outcome outcome = watch({"left/1001h", "drive/1018h:04", "--count", "2", "--every", "50 ms"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  const auto lines = lines_of(outcome.out);
  ASSERT_EQ(lines.size(), 4U) << outcome.out;
  EXPECT_TRUE(lines[0].ends_with(" s  left/1001h  0")) << lines[0];
  EXPECT_TRUE(lines[1].ends_with(" s  drive/1018h:04  48")) << "30h: " << lines[1];
  EXPECT_TRUE(lines[3].ends_with(" s  drive/1018h:04  48")) << lines[3];
}

TEST_F(Watch, AsJsonEachReadingIsAnObject) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  const Outcome outcome = watch({"drive/1018h:04", "9/1017h", "--count", "2", "--every", "50 ms", "--json"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  const auto lines = lines_of(outcome.out);
  ASSERT_EQ(lines.size(), 4U) << outcome.out;
  const Json first = Json::parse(lines[0]);
  EXPECT_EQ(first.at("watched"), "drive/1018h:04");
  EXPECT_EQ(first.at("value"), 48);
  EXPECT_EQ(first.at("index"), "0x1018");
  const Json second = Json::parse(lines[1]);
  EXPECT_EQ(second.at("value"), 100) << "the machine file's heartbeat period";
  EXPECT_EQ(second.at("time"), "100 ms");
  EXPECT_GE(Json::parse(lines[2]).at("at_s").get<double>(), 0.05) << "a round every 50 ms, not more often";
}

// An SDO abort, and a device that has gone, are told in the row; the others are read on.
TEST_F(Watch, WhatIsWrongIsToldAndTheRestGoesOn) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  const Outcome aborted = watch({"left/7777h", "left/1001h", "--count", "2", "--every", "50 ms"});
  EXPECT_EQ(aborted.status, 1) << "an object was never read";
  const auto lines = lines_of(aborted.out);
  ASSERT_EQ(lines.size(), 4U) << aborted.out;
  EXPECT_TRUE(contains(lines[2], "left/7777h  06020000h")) << lines[2];
  EXPECT_TRUE(lines[3].ends_with("left/1001h  0")) << lines[3];
  ASSERT_EQ(ask({"sim", "unplug", "drive"}).status, 0);
  ASSERT_TRUE(wait_for("drive", "absent"));
  const Outcome gone = watch({"drive/1001h", "left/1001h", "--count", "2", "--every", "50 ms"});
  const auto rest = lines_of(gone.out);
  ASSERT_EQ(rest.size(), 4U) << gone.out;
  EXPECT_TRUE(rest[2].ends_with("drive/1001h  no answer")) << rest[2];
  EXPECT_TRUE(rest[3].ends_with("left/1001h  0")) << rest[3];
}

TEST_F(Watch, ItEndsWithItsPipe) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  const std::string script = "bash -c 'timeout 60 " + binary() + " watch 2/1001h --every \"50 ms\" --control " +
                             socket + " | head -2 >/dev/null; exit ${PIPESTATUS[0]}'";
  const int status = std::system(script.c_str());
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_NE(WEXITSTATUS(status), 124) << "it was ended from outside";
}

TEST_F(Watch, WhatIsNoSlotOrObjectIsToldBefore) {
  const auto refused = [&](const std::string& word) {
    const Outcome outcome = berth({"watch", "-m", machine, "--sim", plant, word});
    EXPECT_EQ(outcome.status, 2) << word;
    return outcome.err;
  };
  EXPECT_TRUE(contains(refused("1001h"), "no SLOT/OBJECT"));
  EXPECT_TRUE(contains(refused("lefd/1001h"), "did you mean left?"));
  EXPECT_TRUE(contains(refused("left/Nothing"), "left: "));
  const Outcome none = berth({"watch", "-m", machine, "--sim", plant});
  EXPECT_EQ(none.status, 2);
  EXPECT_TRUE(contains(none.err, "name what to watch")) << none.err;
}

// ---- on a terminal ----

class WatchOnScreen : public Watch {
 protected:
  void start(const Words& words, bool utf8) {
    ASSERT_EQ(::setenv("LC_ALL", utf8 ? "C.UTF-8" : "C", 1), 0);
    watching_ = std::make_unique<Background>(words, OnTerminal{.columns = 80, .rows = 24, .errors = true});
    ::unsetenv("LC_ALL");
  }
  [[nodiscard]] std::string screen() const {
    Terminal shown(80, 24);
    shown.feed(watching_->said());
    return shown.text();
  }
  [[nodiscard]] bool shows(const std::string& text) {
    return watching_->says([&](const std::string&) { return contains(screen(), text); });
  }
  std::unique_ptr<Background> watching_;
};

TEST_F(WatchOnScreen, ATableThatQEnds) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  start({"watch", "left/1001h", "drive/Nothing?", "-m", machine, "--control", socket}, false);
  EXPECT_EQ(watching_->end().status, 2) << "a wrong name ends it before";
  start({"watch", "left/1001h", "drive/7777h", "-m", machine, "--control", socket, "--every", "100 ms"}, false);
  ASSERT_TRUE(shows("cli test  every 100 ms  q ends it, ? helps")) << screen();
  ASSERT_TRUE(shows("  ....")) << "five readings: " << screen();
  EXPECT_TRUE(contains(screen(), "06020000h")) << screen();
  watching_->type("?");
  EXPECT_TRUE(shows("q or Ctrl-C ends it")) << screen();
  watching_->type("q");
  EXPECT_EQ(watching_->end().status, 1) << "an object was never read";
}

// Answers that take longer than the time from one reading to the next, and none at all: keys and signals count.
TEST_F(WatchOnScreen, QEndsItWhileAnswersAreSlow) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  ASSERT_EQ(ask({"sim", "fault", "slow", "drive", "latency=300 ms"}).status, 0);
  start({"watch", "drive/1001h", "drive/1018h:04", "-m", machine, "--control", socket, "--every", "50 ms"}, false);
  ASSERT_TRUE(shows("48")) << screen();
  watching_->type("?");
  EXPECT_TRUE(shows("q or Ctrl-C ends it;")) << screen();
  watching_->type("q");
  EXPECT_EQ(watching_->end().status, 0) << screen();
}

// Each answer comes at once, and all of them take longer than the time between two readings.
TEST_F(WatchOnScreen, QEndsItWhereNoTimeIsLeft) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  Words words{"watch", "-m", machine, "--control", socket, "--every", "1 ms"};
  for (int i = 0; i < 20; ++i) words.emplace_back("drive/1018h:04");
  start(words, false);
  ASSERT_TRUE(shows("48")) << screen();
  watching_->type("q");
  EXPECT_EQ(watching_->end().status, 0) << screen();
}

TEST_F(WatchOnScreen, StatusAgainAndAgainStandsInPlace) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  start({"status", "--watch", "100 ms", "--control", socket}, false);
  ASSERT_TRUE(shows("drive"));
  ASSERT_TRUE(watching_->says([](const std::string& said) { return said.find("\x1b[") != said.rfind("\x1b["); }))
      << "drawn anew";
  const std::string now = screen();
  EXPECT_NE(now.find(" id  slot"), std::string::npos) << now;
  EXPECT_EQ(now.find(" id  slot"), now.rfind(" id  slot")) << now;
  watching_->signal(SIGINT);
  static_cast<void>(watching_->end());
}

// The question is on its way already, and no other follows it.
TEST_F(WatchOnScreen, AWorldThatIsPausedMeanwhileIsTold) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  ASSERT_EQ(ask({"sim", "fault", "slow", "drive", "latency=400 ms"}).status, 0);
  start({"watch", "drive/1018h:04", "-m", machine, "--control", socket, "--every", "50 ms"}, false);
  ASSERT_TRUE(shows("48")) << screen();
  ASSERT_EQ(ask({"world", "pause"}).status, 0);
  EXPECT_TRUE(shows("the world is paused: `berth world run` lets it go on")) << screen();
  ASSERT_EQ(ask({"world", "run"}).status, 0);
  watching_->type("q");
  static_cast<void>(watching_->end());
}

TEST_F(WatchOnScreen, InAWorldThatStandsItTellsAndEnds) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  ASSERT_EQ(ask({"world", "pause"}).status, 0);
  start({"watch", "left/1001h", "-m", machine, "--control", socket}, false);
  ASSERT_TRUE(shows("slot")) << "the table is there before the first value";
  EXPECT_TRUE(shows("the world is paused: `berth world run` lets it go on")) << screen();
  watching_->type("?");
  EXPECT_TRUE(shows("q or Ctrl-C ends it;")) << screen();
  watching_->type("q");
  EXPECT_EQ(watching_->end().status, 1) << "never read";
  start({"watch", "left/1001h", "-m", machine, "--control", socket}, false);
  ASSERT_TRUE(shows("slot"));
  watching_->signal(SIGTERM);
  EXPECT_EQ(watching_->end().status, 1);
}

// Values that `watch =` names stand in the live table of `berth up`, and move there.
TEST_F(WatchOnScreen, TheLiveTableOfUpShowsThem) {
  std::string with = small_machine;
  with.insert(with.find("\n\n[bus.line]"), "\nwatch = [\"left/1001h\", \"drive/1018h:04\"]");
  const std::string watched = folder.write("watched.toml", with);
  start({"up", watched, "--sim", plant, "--control", socket}, false);
  ASSERT_TRUE(shows("drive  Identity object/Serial numb~        48")) << screen();
  EXPECT_TRUE(shows("line: 3 slots, 3 operational")) << screen();
  watching_->type("q");
  EXPECT_EQ(watching_->end().status, 0);
}

TEST_F(Watch, TheMachineFileNamesWhatIsWatched) {
  std::string with = small_machine;
  with.insert(with.find("\n\n[bus.line]"), "\nwatch = [\"left/1001h\", \"drive/1018h:04\"]");
  const std::string watched = folder.write("watched.toml", with);
  const Outcome outcome = berth({"watch", watched, "--sim", plant, "--up", "--count", "1"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_TRUE(contains(outcome.out, "left/1001h  0\n")) << outcome.out;
  EXPECT_TRUE(contains(outcome.out, "drive/1018h:04  48\n")) << outcome.out;
}

// What the examples' README shows: named there, and moving.
TEST(WatchExamples, TheConveyorsValuesMove) {
  const Outcome outcome = berth({"watch", example("conveyor/machine.toml"), "--sim", example("conveyor/plant.toml"),
                                 "--up", "--every", "20 s", "--count", "5", "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  std::map<std::string, std::set<std::string>> values;
  for (const auto& line : lines_of(outcome.out)) {
    const Json json = Json::parse(line);
    values[json.at("watched")].insert(json.at("value").dump());
  }
  EXPECT_GE(values.size(), 4U);
  for (const auto& [watched, seen] : values) EXPECT_GE(seen.size(), 2U) << watched << " stands still";
}

TEST(WatchExamples, TheHarvestersValuesMove) {
  const Outcome outcome = berth({"watch", example("harvester/machine.toml"), "--sim", example("harvester/plant.toml"),
                                 "--up", "--every", "2 s", "--count", "3", "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  std::map<std::string, std::set<std::string>> values;
  for (const auto& line : lines_of(outcome.out)) {
    const Json json = Json::parse(line);
    values[json.at("watched")].insert(json.at("value").dump());
  }
  EXPECT_GE(values.size(), 4U);
  for (const auto& [watched, seen] : values) EXPECT_GE(seen.size(), 2U) << watched << " stands still";
}

}  // namespace
}  // namespace berth::test

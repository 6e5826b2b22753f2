// What a program's standard streams may be: closed, full, a pipe whose reader has left; and how it is ended.
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>
#include <string>

#include <algorithm>

#include "../paths.hpp"
#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

/// `sh -c`: `$B` is the program, `$M` and `$P` a small machine and its plant.
class Shell : public ::testing::Test {
 protected:
  Outcome run(const std::string& command) {
    const std::string out = folder.file("out");
    const std::string err = folder.file("err");
    const std::string words = "B='" + binary() + "' M='" + machine + "' P='" + plant + "'; cd '" + folder.file("") +
                              "' && { " + command + "; } >'" + out + "' 2>'" + err + "'";
    const int status = std::system(words.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, contents(out), contents(err)};
  }
  Folder folder;
  std::string machine = folder.write("machine.toml", small_machine);
  std::string plant = folder.write("plant.toml", small_plant);
};

TEST_F(Shell, OutputThatCannotBeWrittenIsExitThree) {
  const auto full = run("$B demo --json >/dev/full");
  EXPECT_EQ(full.status, 3);
  EXPECT_EQ(full.err, "berth: standard output: No space left on device\n");
  EXPECT_EQ(run("$B --help >/dev/full").status, 3);
  EXPECT_EQ(run("$B eds show nothing.eds --json >/dev/full").status, 3) << "not the 2 that nobody could read";
}

// The reader knows that it left; the program ends and says nothing. It begins when the reader is gone: a pipe may hold
// all that a quick run has to say.
TEST_F(Shell, AReaderThatLeftEndsTheRun) {
  const auto left =
      run("{ until [ -e gone ]; do sleep 0.01; done; $B up $M --sim $P --fast; echo $? >status; } | { exec <&-; : "
          ">gone; }; "
          "cat status");
  EXPECT_EQ(left.err, "");
  EXPECT_EQ(left.out, "3\n");
}

// Wherever the reader leaves, within a line and within a character: no word about it, and no signal that kills. What
// fits into the pipe before the reader is gone counts as written.
TEST_F(Shell, APipeMayCloseAtAnyByte) {
  folder.write("run.log", "(0000000001.000000) can0 705#00\n(0000000001.001000) can0 605#4018100100000000\n");
  for (const std::string command :
       {"up $M --sim $P --fast", "up $M --sim $P --fast --json --events", "scan $M --sim $P --up --json",
        "trace run.log", "trace run.log -o -", "sdo --help", "sdo dump 9 $M --sim $P --up"}) {
    for (const int bytes : {0, 1, 7, 64, 333}) {
      const auto left =
          run("{ $B " + command + "; echo $? >status; } | head -c " + std::to_string(bytes) + " >head; cat status");
      EXPECT_TRUE(left.out == "0\n" || left.out == "3\n") << command << ", " << bytes << ": " << left.out;
      EXPECT_EQ(left.err, "") << command << ", " << bytes;
      EXPECT_LE(contents(folder.file("head")).size(), static_cast<std::size_t>(bytes));
    }
  }
  // More than a pipe holds: there the end of the reader must be noticed.
  std::string log;
  for (int i = 0; i < 20000; ++i) log += fmt::format("({:010}.000000) can0 705#05\n", i);
  folder.write("long.log", log);
  for (const std::string command : {"trace long.log", "trace long.log --json", "trace long.log -o - --to asc"}) {
    for (const int bytes : {1, 4097, 70000}) {
      const auto left =
          run("{ $B " + command + "; echo $? >status; } | head -c " + std::to_string(bytes) + " >head; cat status");
      EXPECT_EQ(left.out, "3\n") << command << ", " << bytes;
      EXPECT_EQ(left.err, "") << command << ", " << bytes;
      EXPECT_EQ(contents(folder.file("head")).size(), static_cast<std::size_t>(bytes));
    }
  }
}

// A paced run stays up until it is ended: the closed pipe ends it.
TEST_F(Shell, AReaderThatLeavesEndsAPacedRunToo) {
  const auto left = run("{ $B up $M --sim $P --pace --control ctl; echo $? >status; } | head -n 1; cat status");
  EXPECT_TRUE(left.out.ends_with("\n3\n")) << left.out;
}

// Without a descriptor of its own the text would land in the first file that is opened.
TEST_F(Shell, ClosedStreamsTakeNoFilesNumber) {
  const auto closed =
      run("$B up $M --sim $P --store slots.db --record frames.log --fast >&- 2>&- <&-; echo $?; cat frames.log");
  EXPECT_EQ(closed.out.substr(0, 2), "0\n") << closed.out;
  EXPECT_EQ(closed.out.find("bound to"), std::string::npos) << closed.out;
  EXPECT_NE(closed.out.find("#"), std::string::npos) << "frames are in it";
}

// A terminal that is closed hangs up: the devices are left as --on-exit says, as by SIGTERM.
TEST(HangUp, EndsAsATerminationDoes) {
  for (const int signal : {SIGTERM, SIGHUP}) {
    const Folder folder;
    Background up({"up", folder.write("machine.toml", small_machine), "--sim", folder.write("plant.toml", small_plant),
                   "--pace", "--control", folder.file("s"), "--on-exit", "stop", "--record",
                   folder.file("frames.log")});
    ASSERT_TRUE(up.says("drive: operational"));
    up.signal(signal);
    EXPECT_EQ(up.end().status, 0) << signal;
    EXPECT_NE(contents(folder.file("frames.log")).find(" 000#0200"), std::string::npos)
        << signal << ": all are stopped";
  }
}

TEST(Suggestions, OfCommandsAndOptionsAtEveryDepth) {
  EXPECT_NE(berth({"sdo", "raed", "1", "0x1018"}).err.find("did you mean read?"), std::string::npos)
      << berth({"sdo", "raed", "1", "0x1018"}).err;
  EXPECT_NE(berth({"up", "--bitrat", "5"}).err.find("see berth up --help"), std::string::npos);
  const auto option = berth({"up", "m.toml", "--recrod", "x"}).err;
  EXPECT_NE(option.find("did you mean --record?"), std::string::npos) << option;
  const auto deep = berth({"lss", "set-node-id", "--jsno"}).err;
  EXPECT_NE(deep.find("see berth lss set-node-id --help"), std::string::npos) << deep;
}

// A file with a hundred thousand mistakes is told in a hundred lines, in words and in JSON.
TEST_F(Shell, MistakesWithoutEndAreCounted) {
  std::string text = small_machine;
  for (int i = 0; i < 20'000; ++i) text += "[[slot]]\nbus = \"nowhere\"\n";
  const std::string bad = folder.write("bad.toml", text);
  const auto words = berth({"up", bad, "--sim", plant, "--fast"});
  EXPECT_EQ(words.status, 2);
  EXPECT_EQ(std::ranges::count(words.err, '\n'), 101);
  EXPECT_NE(words.err.find(" more errors are not shown"), std::string::npos);
  EXPECT_LT(berth({"up", bad, "--sim", plant, "--fast", "--json"}).out.size(), 100'000U);
}

TEST_F(Shell, ASlotWithOneBracketTwice) {
  const std::string bad = folder.write("bad.toml", "[machine]\nname = \"x\"\n[slot]\nid = 1\n[slot]\nid = 2\n");
  const auto said = berth({"up", bad, "--sim", plant, "--fast"}).err;
  EXPECT_NE(said.find("bad.toml:5:1"), std::string::npos) << said;
  EXPECT_NE(said.find("[[slot]]"), std::string::npos) << said;
}

TEST_F(Shell, AFolderForTheControlSocketIsNotMade) {
  const auto none = berth({"up", machine, "--sim", plant, "--pace", "--listen", folder.file("none/x.sock")});
  EXPECT_EQ(none.status, 3);
  EXPECT_NE(none.err.find("there is no such folder"), std::string::npos) << none.err;
  EXPECT_FALSE(exists(folder.file("none")));
}

TEST(Help, OfAVerbByName) {
  EXPECT_EQ(berth({"help", "sdo", "read"}).out, berth({"sdo", "read", "--help"}).out);
  EXPECT_EQ(berth({"help"}).out, berth({"--help"}).out);
  EXPECT_EQ(berth({"help", "sdo", "read"}).status, 0);
}

}  // namespace
}  // namespace berth::test

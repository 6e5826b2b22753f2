// What a command writes destroys nothing that it reads, and nothing that is there unasked (docs/security.md).
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "command_fixture.hpp"

namespace berth::test {
namespace {

namespace fs = std::filesystem;

class Outputs : public Command {
 protected:
  void expect_refused(const std::string& file, const Words& words) const {
    const std::string before = contents(file);
    const Outcome run = berth(words);
    EXPECT_EQ(run.status, 2) << run.out << run.err;
    EXPECT_TRUE(contains(run.err, "this command reads it")) << run.err;
    EXPECT_TRUE(contents(file) == before) << file;
  }
  // By a usage error, and the file is as it was, also with --force.
  void expect_spared(const std::string& file, Words words) const {
    expect_refused(file, words);
    words.emplace_back("--force");
    expect_refused(file, words);
  }
  std::string store = folder.file("slots.db");
  std::string state = folder.file("plant.state");
};

}  // namespace

TEST_F(Outputs, ARecordOverAnInputIsRefused) {
  const Words up{"up", machine, "--sim", plant, "--store", store, "--sim-state", state, "--until", "operational"};
  ASSERT_EQ(berth(up).status, 0);
  ASSERT_TRUE(fs::exists(store) && fs::exists(state));
  for (const std::string& file : {machine, plant, store, state}) {
    SCOPED_TRACE(file);
    Words words = up;
    words.insert(words.end(), {"--record", file});
    expect_spared(file, words);
  }
  // By another name, too.
  const std::string link = folder.file("link.log");
  fs::create_symlink(machine, link);
  Words words = up;
  words.insert(words.end(), {"--record", link});
  expect_spared(machine, words);
  const std::string second = folder.file("second.log");
  fs::create_hard_link(plant, second);
  words.back() = second;
  expect_spared(plant, words);
}

// Also where the output is asked for before the inputs are read, and for what is named and read late.
TEST_F(Outputs, NoOtherOutputGoesOverAnInputEither) {
  const std::string eds = folder.write("booster.eds", contents(example("eds/booster.eds")));
  const std::string concise = folder.file("booster.cdcf");
  ASSERT_EQ(berth({"eds", "convert", example("eds/booster.dcf"), concise, "--to", "cdcf", "--node", "5"}).status, 0);
  const std::string program = folder.write("drive.bprg", contents(example("programs/controller-1.bprg")));
  const std::string programmed = folder.write(
      "programmed.toml", std::string(small_machine) + "programs = [{ file = \"drive.bprg\", identification = 1 }]\n");
  expect_refused(machine, {"analyze", machine, "--plot", machine, "--force"});
  expect_refused(machine, {"sdo", "dump", "left", "-m", machine, "--sim", plant, "--up", "-o", machine, "--force"});
  expect_refused(
      plant, {"sdo", "read", "left", "1018h:01", "-m", machine, "--sim", plant, "--up", "--file", plant, "--force"});
  expect_refused(eds, {"eds", "convert", concise, eds, "--eds", eds, "--to", "dcf", "--node", "5", "--force"});
  expect_refused(program, {"up", programmed, "--sim", plant, "--until", "operational", "--record", program, "--force"});
}

TEST_F(Outputs, TwoOptionsOfOneFileAreRefused) {
  const std::string one = folder.file("one");
  for (const auto& two : std::vector<Words>{{"--store", one, "--sim-state", one},
                                            {"--record", one, "--sim-state", one},
                                            {"--record", one, "--store", one}}) {
    Words words{"up", machine, "--sim", plant, "--until", "operational"};
    words.insert(words.end(), two.begin(), two.end());
    const Outcome run = berth(words);
    EXPECT_EQ(run.status, 2) << run.out << run.err;
    EXPECT_TRUE(contains(run.err, "both name it") || contains(run.err, "this command reads it")) << run.err;
    fs::remove(one);
  }
}

TEST_F(Outputs, AStateOrAStoreOverAnInputIsRefused) {
  for (const std::string& file : {machine, plant}) {
    for (const char* const option : {"--store", "--sim-state"}) {
      SCOPED_TRACE(file + option);
      const std::string before = contents(file);
      const Outcome run = berth({"up", machine, "--sim", plant, option, file, "--until", "operational"});
      EXPECT_NE(run.status, 0) << run.out;
      EXPECT_TRUE(contents(file) == before);
    }
  }
}

TEST_F(Outputs, WhatIsThereIsReplacedWhenAsked) {
  const std::string note = folder.write("notes.txt", "what a person wrote\n");
  const std::string eds = folder.write("a.eds", contents(example("eds/pump.eds")));
  const std::vector<Words> all{
      {"up", machine, "--sim", plant, "--until", "operational", "--record", note},
      {"plant", plant, "-m", machine, "--for", "10 ms", "--record", note},
      {"eds", "convert", eds, note, "--to", "xdd"},
      {"analyze", machine, "--plot", note},
      {"sdo", "read", "left", "1018h:01", "-m", machine, "--sim", plant, "--up", "--file", note},
      {"sdo", "dump", "left", "-m", machine, "--sim", plant, "--up", "-o", note},
      {"trace", folder.write("run.log", "(0.001000) can0 701#05\n"), "-o", note, "--to", "asc"},
      {"program", "image", eds, note},
  };
  for (const auto& words : all) {
    SCOPED_TRACE(words.at(0) + " " + words.at(1));
    const Outcome refused = berth(words);
    if (refused.status == 2 && contains(refused.err, "--help")) ADD_FAILURE() << refused.err;
    EXPECT_EQ(refused.status, 1) << refused.out << refused.err;
    EXPECT_TRUE(contains(refused.err, "is there already; --force replaces it")) << refused.err;
    EXPECT_EQ(contents(note), "what a person wrote\n");
    Words forced = words;
    forced.emplace_back("--force");
    const Outcome done = berth(forced);
    EXPECT_LE(done.status, 1) << "a plant alone has no node-IDs" << done.out << done.err;
    EXPECT_NE(contents(note), "what a person wrote\n");
    std::ofstream(note, std::ios::trunc) << "what a person wrote\n";
  }
}

TEST_F(Outputs, WhatIsNoPlainFileIsWritten) {
  const Outcome run = berth({"up", machine, "--sim", plant, "--until", "operational", "--record", "/dev/null"});
  EXPECT_EQ(run.status, 0) << run.err;
  const Outcome shown =
      berth({"sdo", "read", "left", "1018h:01", "-m", machine, "--sim", plant, "--up", "--file", "/dev/null"});
  EXPECT_EQ(shown.status, 0) << shown.err;
}

TEST_F(Outputs, NamesOutsideNeedAPerson) {
  const Folder elsewhere;
  const std::string eds = elsewhere.write("pump.eds", contents(example("eds/pump.eds")));
  const std::string named =
      folder.write("named.toml", std::string(small_machine) +
                                     "\n[[slot]]\nbus = \"line\"\nid = 77\nname = \"pump\"\neds = \"" + eds + "\"\n");
  const Outcome refused = berth({"analyze", named});
  EXPECT_EQ(refused.status, 2) << refused.out << refused.err;
  EXPECT_TRUE(contains(refused.err, "leads out of")) << refused.err;
  EXPECT_TRUE(contains(refused.err, "--allow-outside")) << refused.err;
  const Outcome allowed = berth({"analyze", named, "--allow-outside", fs::path(eds).parent_path().string()});
  EXPECT_FALSE(contains(allowed.err, "leads out of")) << allowed.err;
}

}  // namespace berth::test

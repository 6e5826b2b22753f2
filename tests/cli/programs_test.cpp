// `berth program`, and what `berth up` does with a slot's programs.
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <string>

#include "process.hpp"
#include "tests/pch.hpp"

namespace berth::test {
namespace {

using Json = nlohmann::json;

constexpr const char* right_one = "0x80A98A5D";

class ProgramCommand : public ::testing::Test {
 protected:
  [[nodiscard]] Outcome run(Words words) const {
    words.insert(words.begin(), "program");
    words.insert(words.end(), {"--machine", machine, "--sim", plant});
    return berth(words);
  }
  [[nodiscard]] Json reply(Words words, int status) const {
    words.emplace_back("--json");
    const Outcome done = run(words);
    EXPECT_EQ(done.status, status) << done.out << done.err;
    return Json::parse(done.out);
  }
  std::string machine = example("programmed.toml");
  std::string plant = example("programmed.plant.toml");
};

}  // namespace

// A blank controller and one with an older program get the slot's; the one that has it is left as it is.
TEST_F(ProgramCommand, UpBringsThemInBeforeItStartsTheDevices) {
  const Outcome up = berth({"up", machine, "--sim", plant, "--fast"});
  EXPECT_EQ(up.status, 0) << up.out << up.err;
  EXPECT_NE(up.out.find("controller 1: configuring: downloading program 1"), std::string::npos) << up.out;
  EXPECT_NE(up.out.find("controller 2: configuring: downloading program 1"), std::string::npos) << up.out;
  EXPECT_EQ(up.out.find("controller 3: configuring: downloading"), std::string::npos) << up.out;
  EXPECT_NE(up.out.find("controller 3: operational"), std::string::npos) << up.out;
  const Json status = reply({"status", "controller 1", "--up"}, 0);
  ASSERT_EQ(status.at("programs").size(), 1U);
  const auto& program = status.at("programs").at(0);
  EXPECT_EQ(program.at("state"), "started");
  EXPECT_EQ(program.at("identification"), right_one);
  EXPECT_EQ(program.at("expected"), right_one);
  EXPECT_EQ(status.at("date"), "2026-03-01 09:00:00.000");
}

// update = "by-hand": the device is not started, and its slot says why.
TEST_F(ProgramCommand, ByHandItIsOnlyTold) {
  const Folder folder;
  const std::string by_hand =
      folder.write("by-hand.toml",
                   "[machine]\nname = \"m\"\n[bus.line]\nport = \"sim\"\nbitrate = 250_000\nmaster_id = 127\n"
                   "[[slot]]\nbus = \"line\"\nids = \"1..3\"\nname = \"c{id}\"\n"
                   "type = { vendor = 0x0000_0001, product = 0x0000_0060 }\nupdate = \"by-hand\"\n"
                   "programs = [{ file = \"" +
                       folder.bring("programs/controller-2.bprg") + "\" }]\n");
  const Outcome up = berth({"up", by_hand, "--sim", plant, "--fast", "--timeout", "20 s"});
  EXPECT_NE(up.status, 0);
  EXPECT_NE(up.out.find("c2: failed: H: its software is not the expected one"), std::string::npos) << up.out;
  EXPECT_NE(up.out.find("c3: operational"), std::string::npos) << up.out;
}

// A file that is not there is named by the slot; the others go on.
TEST_F(ProgramCommand, AProgramThatCannotBeReadIsNamed) {
  const Folder folder;
  const std::string missing =
      folder.write("missing.toml",
                   "[machine]\nname = \"m\"\n[bus.line]\nport = \"sim\"\nbitrate = 250_000\nmaster_id = 127\n"
                   "[[slot]]\nbus = \"line\"\nids = \"1..3\"\nname = \"c{id}\"\n"
                   "type = { vendor = 0x0000_0001, product = 0x0000_0060 }\n"
                   "programs = [{ file = \"nowhere.bprg\" }]\n");
  const Outcome up = berth({"up", missing, "--sim", plant, "--fast", "--timeout", "20 s"});
  EXPECT_NE(up.status, 0);
  EXPECT_NE(up.out.find("nowhere.bprg: there is no such file"), std::string::npos) << up.out;
  EXPECT_NE(
      up.err.find("missing.toml:12:22: warning: slot[1].programs[1].file: \"nowhere.bprg\": there is no such file"),
      std::string::npos)
      << "with its place, before a device is asked: " << up.err;
}

// A device whose slot names no programs, and that has none: why it does not become operational.
TEST_F(ProgramCommand, ABlankDeviceSaysThatItHasNoProgram) {
  const Folder folder;
  const std::string without =
      folder.write("without.toml",
                   "[machine]\nname = \"m\"\n[bus.line]\nport = \"sim\"\nbitrate = 250_000\nmaster_id = 127\n"
                   "[[slot]]\nbus = \"line\"\nids = \"1..3\"\nname = \"c{id}\"\n"
                   "type = { vendor = 0x0000_0001, product = 0x0000_0060 }\n");
  const Outcome up = berth({"up", without, "--sim", plant, "--fast", "--timeout", "20 s"});
  EXPECT_NE(up.out.find("it has no valid program (1F57h:01): `berth program download` gives it one"), std::string::npos)
      << up.out;
  EXPECT_NE(up.out.find("c3: operational"), std::string::npos) << up.out;
}

// S5.22: program download and control, of the network access interface.
TEST_F(ProgramCommand, S5_22_DownloadStopStartAndClear) {
  const Json done = reply({"download", "controller 2", "--up"}, 0);
  EXPECT_EQ(done.at("bytes"), 4032);
  EXPECT_EQ(done.at("programs").at(0).at("identification"), right_one);
  EXPECT_EQ(reply({"stop", "controller 3", "--up"}, 0).at("result"), "stopped");
  EXPECT_EQ(reply({"start", "controller 3", "--up"}, 0).at("result"), "started");
  const Outcome runs = run({"clear", "controller 3", "--up"});
  EXPECT_EQ(runs.status, 1);
  EXPECT_NE(runs.err.find("berth program stop"), std::string::npos) << runs.err;
}

// What 1F56h shall tell when the program is in: the device is believed, not the file.
TEST_F(ProgramCommand, TheIdentificationIsThatOfTheCommand) {
  const Json good = reply({"download", "controller 2", "--identification", right_one, "--up"}, 0);
  EXPECT_EQ(good.at("programs").at(0).at("identification"), right_one);
  const Outcome other = run({"download", "controller 2", "--identification", "5", "--up"});
  EXPECT_EQ(other.status, 1);
  EXPECT_NE(other.err.find("another identification than the expected one"), std::string::npos) << other.err;
  EXPECT_EQ(run({"download", "controller 2", "--identification", "0", "--up"}).status, 2);
  const Folder folder;
  const std::string two =
      folder.write("two.toml",
                   "[machine]\nname = \"m\"\n[bus.line]\nport = \"sim\"\nbitrate = 250_000\nmaster_id = 127\n"
                   "[[slot]]\nbus = \"line\"\nids = \"1..3\"\nname = \"c{id}\"\n"
                   "type = { vendor = 0x0000_0001, product = 0x0000_0060 }\nupdate = \"by-hand\"\n"
                   "programs = [{ file = \"" +
                       folder.bring("programs/controller-2.bprg") + "\" }, { number = 2, file = \"" +
                       folder.bring("programs/controller-1.bprg") + "\" }]\n");
  const Outcome which = berth({"program", "download", "c2", "--identification", "5", "--machine", two, "--sim", plant});
  EXPECT_EQ(which.status, 2);
  EXPECT_NE(which.err.find("--identification is of one program"), std::string::npos) << which.err;
}

// It refused the image: flash memory wears out, and another attempt would end as the first.
TEST_F(ProgramCommand, ARefusedProgramIsNotWrittenAgain) {
  const Folder folder;
  const std::string image = folder.write("p.bin", "a program without a head, which this device does not take");
  const std::string refused =
      folder.write("refused.toml",
                   "[machine]\nname = \"m\"\n[bus.line]\nport = \"sim\"\nbitrate = 250_000\nmaster_id = 127\n"
                   "[[slot]]\nbus = \"line\"\nids = \"1..3\"\nname = \"c{id}\"\n"
                   "type = { vendor = 0x0000_0001, product = 0x0000_0060 }\n"
                   "programs = [{ file = \"" +
                       image + "\" }]\n");
  const Outcome up = berth({"up", refused, "--sim", plant, "--fast", "--timeout", "120 s"});
  EXPECT_NE(up.status, 0);
  std::size_t clearings = 0;
  const std::string line = "c2: configuring: clearing program 1";
  for (auto at = up.out.find(line); at != std::string::npos; at = up.out.find(line, at + 1)) ++clearings;
  EXPECT_EQ(clearings, 1U) << up.out;
  EXPECT_NE(up.out.find("c2: failed: I: "), std::string::npos) << up.out;
}

// What a user downloaded to stay is the slot's program from then on: else its next boot-up would bring the old one
// back.
TEST_F(ProgramCommand, AKeptProgramIsTheSlots) {
  const Folder folder;
  const std::string kept = folder.bring("programs/controller-2.bprg");
  const std::string old = contents(kept);
  const std::string file =
      folder.write("own.toml",
                   "[machine]\nname = \"m\"\n[bus.line]\nport = \"sim\"\nbitrate = 250_000\nmaster_id = 127\n"
                   "[[slot]]\nbus = \"line\"\nids = \"1..3\"\nname = \"c{id}\"\n"
                   "type = { vendor = 0x0000_0001, product = 0x0000_0060 }\nprograms = [{ file = \"" +
                       kept + "\" }]\n");
  const std::string image = folder.file("new.bprg");
  ASSERT_EQ(
      berth({"program", "image", folder.write("p.bin", "version three"), image, "--vendor", "1", "--product", "96"})
          .status,
      0);
  const std::string socket = folder.file("control");
  const Background up({"up", file, "--sim", plant, "--pace", "--store", folder.file("a.db"), "--control", socket});
  const auto ask = [&](Words words) {
    words.insert(words.end(), {"--control", socket, "--json"});
    return berth(words);
  };
  ASSERT_TRUE(eventually([&] { return ask({"status"}).status == 0; }));
  EXPECT_EQ(ask({"program", "download", "c3", "--keep"}).status, 2) << "what?";
  EXPECT_EQ(ask({"program", "download", "c3", "--program", "2", "--file", image, "--keep"}).status, 2)
      << "the slot has no program 2";
  EXPECT_EQ(contents(kept), old);
  const Outcome done = ask({"program", "download", "c3", "--file", image, "--keep"});
  ASSERT_EQ(done.status, 0) << done.out << done.err;
  EXPECT_EQ(contents(kept), contents(image));
  EXPECT_EQ(contents(kept + ".before"), old);
  const auto status = [&] { return Json::parse(ask({"program", "status", "c3"}).out, nullptr, false); };
  ASSERT_TRUE(eventually([&] { return ask({"status", "c3"}).status == 0; }));
  const auto program = status().at("programs").at(0);
  EXPECT_EQ(program.at("identification"), program.at("expected"));
  EXPECT_NE(program.at("identification"), right_one);
  // It boots, and keeps it.
  ASSERT_EQ(ask({"nmt", "reset-node", "c3"}).status, 0);
  ASSERT_TRUE(eventually([&] { return ask({"status", "c3"}).status == 0; }));
  EXPECT_EQ(status().at("programs").at(0).at("identification"), program.at("identification"));
}

// A device that refuses an image has no program any more: what can be known before is asked before.
TEST_F(ProgramCommand, AnImageOfAnotherProductLeavesTheProgramAlone) {
  const Folder folder;
  const std::string image = folder.file("p.bprg");
  ASSERT_EQ(berth({"program", "image", folder.write("p.bin", "of another"), image, "--vendor", "1", "--product", "97"})
                .status,
            0);
  const std::string file =
      folder.write("other.toml",
                   "[machine]\nname = \"m\"\n[bus.line]\nport = \"sim\"\nbitrate = 250_000\nmaster_id = 127\n"
                   "[[slot]]\nbus = \"line\"\nids = \"1..3\"\nname = \"c{id}\"\n"
                   "type = { vendor = 0x0000_0001, product = 0x0000_0060 }\nprograms = [{ file = \"" +
                       image + "\" }]\n");
  const Outcome up = berth({"up", file, "--sim", plant, "--fast", "--timeout", "60 s"});
  EXPECT_NE(up.status, 0);
  EXPECT_NE(up.out.find("the image is of another product than the device"), std::string::npos) << up.out;
  EXPECT_EQ(up.out.find("clearing program"), std::string::npos) << up.out;
  EXPECT_EQ(up.out.find("stopping program"), std::string::npos) << up.out;
  std::string damaged = contents(image);
  damaged.back() = static_cast<char>(damaged.back() ^ 1);
  const Outcome broken = run({"download", "controller 3", "--file", folder.write("d.bprg", damaged), "--up"});
  EXPECT_EQ(broken.status, 2);
  EXPECT_NE(broken.err.find("is damaged"), std::string::npos) << broken.err;
}

TEST_F(ProgramCommand, ADeviceThatDoesNotAnswerIsNotSaidToBeInItsBootLoader) {
  const Outcome none = run({"download", "controller 3"});
  EXPECT_EQ(none.status, 1);
  EXPECT_NE(none.err.find("no answer"), std::string::npos) << none.err;
  EXPECT_EQ(none.err.find("boot loader"), std::string::npos) << none.err;
}

TEST_F(ProgramCommand, AnotherFileIsRefusedBeforeTheProgramIsStopped) {
  const Folder folder;
  const std::string content = folder.write("p.bin", "a program of another product");
  const std::string image = folder.file("p.bprg");
  const Outcome made = berth({"program", "image", content, image, "--vendor", "1", "--product", "97", "--json"});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_EQ(Json::parse(made.out).at("bytes"), 60);
  const Outcome refused = run({"download", "controller 3", "--file", image, "--up"});
  EXPECT_EQ(refused.status, 1);
  EXPECT_NE(refused.err.find("of another product"), std::string::npos) << refused.err;
  EXPECT_EQ(refused.err.find("boot loader"), std::string::npos) << refused.err;
  const Outcome wrong = run({"download", "controller 3", "--file", folder.file("none"), "--up"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_NE(wrong.err.find("there is no such file"), std::string::npos) << wrong.err;
}

TEST_F(ProgramCommand, ADeviceWithoutProgramsSaysSo) {
  const Outcome none = berth({"program", "status", "1", "--machine", example("five-slaves.toml"), "--sim",
                              example("five-slaves.plant.toml"), "--up"});
  EXPECT_EQ(none.status, 1);
  EXPECT_NE(none.err.find("1F51h"), std::string::npos) << none.err;
}

// What a dry run prints are the frames that would be sent, and nothing is.
TEST_F(ProgramCommand, ADryRunPrintsTheFrames) {
  const Outcome dry = run({"download", "controller 3", "--up", "--dry-run"});
  EXPECT_EQ(dry.status, 0) << dry.err;
  EXPECT_NE(dry.out.find("603#"), std::string::npos) << dry.out.substr(0, 500);
}

}  // namespace berth::test

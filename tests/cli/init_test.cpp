// `berth init`: from descriptions, from a bus, by questions; what it refuses; and that what it wrote runs.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>
#include <string>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

namespace fs = std::filesystem;
using InitJson = nlohmann::json;

class Init : public ::testing::Test {
 protected:
  [[nodiscard]] static bool has(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  }
  void SetUp() override {
    fs::create_directories(folder.file("eds"));
    for (const auto* const name : {"drive.eds", "io.eds", "pump.eds"}) {
      fs::copy_file(example(std::string("eds/") + name), folder.file(std::string("eds/") + name));
    }
  }
  [[nodiscard]] Outcome init(Words words) const {
    words.insert(words.begin(), {"init", file});
    return berth(words);
  }
  [[nodiscard]] std::string eds(const std::string& name) const { return folder.file("eds/" + name); }
  /// What was written runs, and every slot becomes operational.
  void runs(std::size_t slots) const {
    const Outcome up = berth({"up", file, "--sim", plant, "--json", "--timeout", "120 s"});
    ASSERT_EQ(up.status, 0) << up.out << up.err << contents(file) << contents(plant);
    const auto report = InitJson::parse(up.out);
    EXPECT_EQ(report.at("slots").size(), slots);
  }
  [[nodiscard]] std::size_t files() const {
    std::size_t count = 0;
    for (const auto& entry : fs::directory_iterator(fs::path(file).parent_path())) count += entry.is_regular_file();
    return count;
  }

  Folder folder;
  std::string file = folder.file("conveyor.toml");
  std::string plant = folder.file("conveyor.plant.toml");
};

TEST_F(Init, DescriptionsBecomeAMachineThatRuns) {
  const Outcome made = init({"--eds", eds("drive.eds"), "--eds", eds("io.eds") + ":4", "--name", "conveyor"});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_TRUE(has(made.out, "conveyor.toml: machine \"conveyor\", 5 slots, bus field at 125000 bit/s")) << made.out;
  EXPECT_TRUE(has(made.out, "berth up " + file + " --sim " + plant)) << made.out;
  const std::string text = contents(file);
  for (const auto* const line :
       {"name = \"conveyor\"", "[bus.\"field\"]", "port      = \"sim\"", "bitrate   = 125000", "discovery = \"auto\"",
        "id   = 1\nname = \"Berth drive\"", "eds  = \"eds/drive.eds\"",
        "ids  = \"2..5\"\nname = \"Berth I-O module {id}\"", "# Berth drive, Example vendor"}) {
    EXPECT_TRUE(has(text, line)) << line << "\n" << text;
  }
  EXPECT_TRUE(has(contents(plant), "name   = \"Berth I-O module {n}\"")) << contents(plant);
  EXPECT_TRUE(has(contents(plant), "n_first = 2 ")) << "slot and device have one name\n" << contents(plant);
  runs(5);
}

TEST_F(Init, TheWholeBusIsFull) {
  ASSERT_EQ(init({"--eds", eds("drive.eds") + ":126", "--bitrate", "1000000"}).status, 0);
  runs(126);
  const Outcome over = init({"--eds", eds("drive.eds") + ":126", "--eds", eds("io.eds"), "--force"});
  EXPECT_EQ(over.status, 2);
  EXPECT_TRUE(has(over.err, "more than 126 devices")) << over.err;
  for (const auto* const count : {":127", ":0", ":99999999999"}) {
    const Outcome wrong = init({"--eds", eds("drive.eds") + count, "--force"});
    EXPECT_EQ(wrong.status, 2);
    EXPECT_TRUE(has(wrong.err, "a bus has 1 to 126 devices")) << wrong.err;
  }
}

TEST_F(Init, TheSameFileTwiceIsTwoDevices) {
  const Outcome made = init({"--eds", eds("drive.eds"), "--eds", folder.file("eds/../eds/drive.eds")});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_TRUE(has(made.out, "named more than once: 2 devices of it")) << made.out;
  EXPECT_TRUE(has(contents(file), "ids  = \"1..2\""));
  runs(2);
}

TEST_F(Init, NothingIsOverwrittenWithoutForce) {
  ASSERT_EQ(init({"--eds", eds("drive.eds")}).status, 0);
  const std::string before = contents(file);
  const Outcome again = init({"--eds", eds("io.eds")});
  EXPECT_EQ(again.status, 1);
  EXPECT_TRUE(has(again.err, "is there already") && has(again.err, "--force")) << again.err;
  EXPECT_EQ(contents(file), before);
  fs::remove(file);  // the plant file alone is in the way, too
  EXPECT_EQ(init({"--eds", eds("io.eds")}).status, 1);
  EXPECT_FALSE(exists(file));
  EXPECT_EQ(init({"--eds", eds("io.eds"), "--force"}).status, 0);
  EXPECT_TRUE(has(contents(file), "io.eds"));
  EXPECT_EQ(files(), 2U);
  runs(1);
}

// A machine file names files of its own folder; descriptions lie where they were downloaded to.
TEST_F(Init, ADescriptionFromElsewhereComesAlong) {
  const Folder elsewhere;
  const std::string drive = elsewhere.write("drive.eds", contents(eds("drive.eds")));
  const std::string named = drive + ":2";
  const Outcome dry = init({"--eds", named, "--dry-run"});
  EXPECT_EQ(dry.status, 0) << dry.err;
  EXPECT_EQ(files(), 0U);
  const Outcome made = init({"--eds", named, "--eds", drive});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_TRUE(has(made.out, "drive.eds comes along: copied to " + folder.file("drive.eds"))) << made.out;
  EXPECT_EQ(contents(folder.file("drive.eds")), contents(drive));
  EXPECT_TRUE(has(contents(file), "eds  = \"drive.eds\"")) << contents(file);
  runs(3);
  // The same once more is the same file.
  EXPECT_EQ(berth({"init", folder.file("once_more.toml"), "--eds", drive}).status, 0);
  elsewhere.write("drive.eds", contents(eds("io.eds")));
  const std::string before = contents(folder.file("drive.eds"));
  const Outcome other = berth({"init", folder.file("other.toml"), "--eds", drive});
  EXPECT_EQ(other.status, 1);
  EXPECT_TRUE(has(other.err, "another file is there already")) << other.err;
  EXPECT_EQ(contents(folder.file("drive.eds")), before);
  EXPECT_FALSE(exists(folder.file("other.toml")));
}

TEST_F(Init, TwoDescriptionsOfOneNameDoNotComeAlong) {
  const Folder one;
  const Folder other;
  const std::string first = one.write("d.eds", contents(eds("drive.eds")));
  const Outcome made = init({"--eds", first, "--eds", other.write("d.eds", contents(eds("io.eds")))});
  EXPECT_EQ(made.status, 1);
  EXPECT_TRUE(has(made.err, "and so is " + first)) << made.err;
  EXPECT_EQ(files(), 0U);
}

TEST_F(Init, BothFilesOrNone) {
  fs::create_directories(folder.file("taken.plant.toml"));
  const Outcome folder_there = berth({"init", folder.file("taken.toml"), "--eds", eds("drive.eds"), "--force"});
  EXPECT_EQ(folder_there.status, 3);
  EXPECT_TRUE(has(folder_there.err, "taken.plant.toml: Is a directory")) << folder_there.err;
  EXPECT_FALSE(exists(folder.file("taken.toml")));
  const Outcome nowhere = berth({"init", folder.file("none/m.toml"), "--eds", eds("drive.eds")});
  EXPECT_EQ(nowhere.status, 3);
  EXPECT_TRUE(has(nowhere.err, "/none: there is no such folder")) << nowhere.err;
  EXPECT_EQ(files(), 0U) << "no part is left";
}

TEST_F(Init, AFolderThatCannotBeWrittenIsNamed) {
  // No user may write there, root neither.
  const Outcome made = berth({"init", "/proc/berth.toml", "--eds", eds("drive.eds"), "--allow-outside", "/"});
  EXPECT_EQ(made.status, 3);
  EXPECT_TRUE(has(made.err, "/proc/berth.plant.toml: ")) << made.err;
}

TEST_F(Init, DryRunWritesNothing) {
  const Outcome dry = init({"--eds", eds("drive.eds"), "--dry-run"});
  EXPECT_EQ(dry.status, 0) << dry.err;
  EXPECT_TRUE(has(dry.out, "[[slot]]") && has(dry.out, "[[device]]")) << dry.out;
  const auto json = InitJson::parse(init({"--eds", eds("drive.eds"), "--dry-run", "--json"}).out);
  EXPECT_FALSE(json.at("written").get<bool>());
  EXPECT_TRUE(has(json.at("machine"), "[[slot]]"));
  EXPECT_EQ(files(), 0U);
}

TEST_F(Init, JsonSaysWhatWasWritten) {
  const Outcome made = init({"--eds", eds("drive.eds") + ":2", "--json"});
  ASSERT_EQ(made.status, 0);
  const auto json = InitJson::parse(made.out);
  EXPECT_TRUE(json.at("written").get<bool>());
  EXPECT_EQ(json.at("machine_file"), file);
  EXPECT_EQ(json.at("devices"), 2);
  EXPECT_EQ(json.at("buses").at(0).at("slots").at(1).at("name"), "Berth drive 2");
}

TEST_F(Init, ADescriptionThatCannotBeReadIsNamed) {
  const Outcome none = init({"--eds", eds("none.eds")});
  EXPECT_EQ(none.status, 2);
  EXPECT_TRUE(has(none.err, "none.eds")) << none.err;
  const Outcome broken = init({"--eds", folder.write("broken.eds", "[DeviceInfo]\nVendorNumber=x\n")});
  EXPECT_EQ(broken.status, 2);
  EXPECT_TRUE(has(broken.err, "broken.eds:")) << broken.err;
  EXPECT_FALSE(exists(file));
}

TEST_F(Init, NamesOfEveryKind) {
  const std::string names = "a \"b\" \xF0\x9F\x9A\x80 'c'";
  std::string text = contents(eds("drive.eds"));
  const std::string product = "ProductName=Berth drive";
  text.replace(text.find(product), product.size(), "ProductName=1/2\\ {id} \"q\" \xF0\x9F\x9A\x80 \x1b[31m");
  folder.write("eds/" + names + ".eds", text);
  const Outcome made = init({"--eds", eds(names + ".eds") + ":2", "--name", names, "--bus", names});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_EQ(made.out.find('\x1b'), std::string::npos);
  EXPECT_EQ(contents(file).find('\x1b'), std::string::npos);
  EXPECT_TRUE(has(contents(file), "\\\"b\\\"")) << contents(file);
  runs(2);
  for (const auto* const name : {"a/b", " a", "a\nb"}) {
    const Outcome wrong = init({"--eds", eds("drive.eds"), "--force", "--name", name});
    EXPECT_EQ(wrong.status, 2);
    EXPECT_TRUE(has(wrong.err, "this is not a name; use 1 to 100 characters")) << wrong.err;
    EXPECT_EQ(init({"--eds", eds("drive.eds"), "--force", "--bus", name}).status, 2);
  }
}

// Two products of one name, and one that is called as another with its number.
TEST_F(Init, SlotsHaveNamesOfTheirOwn) {
  std::string text = contents(eds("io.eds"));
  const std::string product = "ProductName=Berth I/O module";
  text.replace(text.find(product), product.size(), "ProductName=berth DRIVE");
  folder.write("eds/other.eds", text);
  text.replace(text.find("berth DRIVE"), 11, "Berth drive 2");
  folder.write("eds/third.eds", text);
  ASSERT_EQ(
      init({"--eds", eds("drive.eds") + ":3", "--eds", eds("other.eds") + ":2", "--eds", eds("third.eds")}).status, 0);
  runs(6);
}

TEST_F(Init, ADeviceWithoutLssIsFixed) {
  std::string text = contents(eds("drive.eds"));
  text.replace(text.find("LSS_Supported=1"), 15, "LSS_Supported=0");
  folder.write("eds/fixed.eds", text);
  ASSERT_EQ(init({"--eds", eds("fixed.eds") + ":2", "--eds", eds("io.eds")}).status, 0);
  EXPECT_TRUE(has(contents(file), "assign = \"fixed\"")) << contents(file);
  runs(3);
}

// Two well-known descriptions are so; a device of them is known by its node-ID.
TEST_F(Init, ADescriptionWithoutVendorAndProductMakesSlotsByNodeId) {
  const std::string text = contents(eds("drive.eds"));
  std::string nobody = text;
  for (const auto* const key : {"VendorNumber=0x00000001", "ProductNumber=0x00000002"}) {
    if (const auto at = nobody.find(key); at != std::string::npos) nobody.erase(at, std::string(key).size());
  }
  for (auto at = nobody.find("[1018"); at != std::string::npos; at = nobody.find("[1018")) nobody[at + 1] = '2';
  for (auto at = nobody.find("0x1018"); at != std::string::npos; at = nobody.find("0x1018")) nobody[at + 2] = '2';
  folder.write("eds/any.eds", nobody);
  const auto made = init({"--eds", eds("any.eds") + ":2"});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_TRUE(has(made.out, "gives neither vendor-ID nor product code")) << made.out;
  EXPECT_TRUE(has(contents(file), "type = \"any\"")) << contents(file);
  EXPECT_TRUE(has(contents(file), "assign = \"fixed\"")) << contents(file);
  runs(2);
}

TEST_F(Init, TheBitRateIsOneThatAllSupport) {
  std::string text = contents(eds("drive.eds"));
  for (const auto* const rate : {"125", "500", "800", "1000"}) {
    const std::string key = std::string("BaudRate_") + rate + "=1";
    text.replace(text.find(key), key.size(), std::string("BaudRate_") + rate + "=0");
  }
  folder.write("eds/slow.eds", text);
  ASSERT_EQ(init({"--eds", eds("slow.eds"), "--eds", eds("io.eds")}).status, 0);
  EXPECT_TRUE(has(contents(file), "bitrate   = 250000")) << contents(file);
  const Outcome told = init({"--eds", eds("slow.eds"), "--bitrate", "500000", "--force"});
  EXPECT_EQ(told.status, 0);
  EXPECT_TRUE(has(told.out, "slow.eds does not support 500000 bit/s")) << told.out;
  EXPECT_EQ(init({"--eds", eds("slow.eds"), "--bitrate", "123456", "--force"}).status, 2);
}

TEST_F(Init, WithoutASourceAndATerminalItSaysWhatToGive) {
  const Outcome nothing = init({});
  EXPECT_EQ(nothing.status, 2);
  EXPECT_TRUE(has(nothing.err, "--eds drive.eds") && has(nothing.err, "--port can0")) << nothing.err;
  EXPECT_EQ(files(), 0U);
}

// ---- from a bus ----

TEST_F(Init, ABusThatIsThereBecomesAMachine) {
  const std::string socket = folder.file("p.sock");
  const std::string world = folder.write("world.toml", R"([bus.line]
bitrate = 250_000
[[device]]
bus = "line"
name = "left pump"
type = { vendor = 1, product = 7, revision = 3 }
serial = 0x30
node_id = 5
[[device]]
bus = "line"
name = "at Berth's place"
type = { vendor = 1, product = 8 }
serial = 0x31
node_id = 127
[[device]]
bus = "line"
name = "new"
type = { vendor = 1, product = 7, revision = 3 }
serial = 0x32
[[device]]
bus = "line"
name = "only LSS"
type = { vendor = 1, product = 9 }
serial = 0x33
speaks = ["fastscan"]
)");
  Background devices({"plant", world, "--listen", socket});
  ASSERT_TRUE(devices.says("Ctrl-C"));
  const Outcome made = init({"--port", socket, "--bus", "line"});
  ASSERT_EQ(made.status, 0) << made.err;
  const std::string text = contents(file);
  for (const auto* const part :
       {"port      = \"plant:", "bitrate   = 250000", "master_id = 126", "id   = 5\nname = \"left pump\"",
        "id   = 127\n", "product = 0x0000_0009", "# serial number 0x00000032; it had no node-ID",
        "type = { vendor = 0x0000_0001, product = 0x0000_0007, revision = 0x0000_0003 }"}) {
    EXPECT_TRUE(has(text, part)) << part << "\n" << text;
  }
  EXPECT_TRUE(has(contents(plant), "serial = 0x33")) << contents(plant);
  runs(4);
  const Outcome on_bus = berth({"up", file, "--until", "operational", "--timeout", "60 s", "--yes"});
  EXPECT_EQ(on_bus.status, 0) << on_bus.out << on_bus.err;
}

TEST_F(Init, DevicesOfARunningMachineAndTheirDescriptions) {
  ASSERT_EQ(init({"--eds", eds("drive.eds") + ":2"}).status, 0);
  const std::string socket = folder.file("up.sock");
  Background up({"up", file, "--sim", plant, "--pace", "--control", socket});
  ASSERT_TRUE(up.says("field  operational"));
  const std::string again = folder.file("again.toml");
  const Outcome made = berth({"init", again, "--port", socket, "--eds", eds("drive.eds")});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_TRUE(has(contents(again), "name = \"Berth drive 1\"\neds  = \"eds/drive.eds\"")) << contents(again);
  const Outcome runs_too = berth({"up", again, "--sim", folder.file("again.plant.toml"), "--json"});
  EXPECT_EQ(runs_too.status, 0) << runs_too.out << runs_too.err;
}

TEST_F(Init, AnEmptyBusMakesNoFile) {
  const std::string socket = folder.file("p.sock");
  Background devices({"plant", folder.write("world.toml", "[bus.field]\nbitrate = 125_000\n"), "--listen", socket});
  ASSERT_TRUE(devices.says("Ctrl-C"));
  const Outcome made = init({"--port", socket});
  EXPECT_EQ(made.status, 3);
  EXPECT_TRUE(has(made.err, "no device acknowledges what Berth sends")) << made.err;
  EXPECT_FALSE(exists(file) || exists(plant));
  EXPECT_EQ(init({"--port", folder.file("none.sock")}).status, 3);
  EXPECT_EQ(init({"--port", "nonsense!"}).status, 2);
}

// ---- by questions ----

// "~" is the shell's: where Berth asks itself, it is the home folder, too.
TEST_F(Init, AQuestionKnowsTheHomeFolder) {
  const std::string home = std::getenv("HOME") != nullptr ? std::getenv("HOME") : "";
  ASSERT_EQ(::setenv("HOME", folder.file("").c_str(), 1), 0);
  folder.write("mine.eds", contents(eds("drive.eds")));
  Background asks({"init"}, OnTerminal{80, 24});
  static_cast<void>(home.empty() ? ::unsetenv("HOME") : ::setenv("HOME", home.c_str(), 1));
  ASSERT_TRUE(asks.says("Description, or port:"));
  asks.type("~/mine.eds\n");
  EXPECT_TRUE(asks.says("how many of it [1]:")) << asks.said();
}

TEST_F(Init, QuestionsOnATerminal) {
  Background asks({"init"}, OnTerminal{80, 24});
  ASSERT_TRUE(asks.says("Description, or port:"));
  asks.type("nothing.eds\n");
  ASSERT_TRUE(asks.says("there is no such file, and this is not a port"));
  asks.type(eds("drive.eds") + "\n");
  ASSERT_TRUE(asks.says("how many of it [1]:"));
  asks.type("many\n");
  ASSERT_TRUE(asks.says("a number from 1 to 126"));
  asks.type("2\n");
  ASSERT_TRUE(asks.says("Another description (Enter: no more):"));
  asks.type(eds("io.eds") + ":2\n");  // as --eds takes it: then "how many" is no question
  ASSERT_TRUE(asks.says([](const std::string& said) { return said.rfind("no more):") > said.find("no more):"); }));
  asks.type("\n");
  ASSERT_TRUE(asks.says("Machine file to write [berth.toml]:"));
  asks.type("conveyor\n");
  ASSERT_TRUE(asks.says("NAME.toml"));
  asks.type(file + "\n");
  ASSERT_TRUE(asks.says("Name of the machine ["));
  asks.type("a/b\n");
  ASSERT_TRUE(asks.says("this is not a name"));
  asks.type("by hand\n");
  const Outcome made = asks.end();
  EXPECT_EQ(made.status, 0) << made.out << made.err;
  EXPECT_TRUE(has(contents(file), "name = \"by hand\"")) << contents(file);
  runs(4);
}

// The questions find out what is wrong when it is typed, and replace nothing that they did not name.
TEST_F(Init, QuestionsRefuseWhatCouldNotBeWritten) {
  folder.write("no.eds", "[FileInfo]\nnothing\n");
  folder.write("conveyor.plant.toml", "# mine\n");
  Background asks({"init"}, OnTerminal{100, 24});
  ASSERT_TRUE(asks.says("Description, or port:"));
  asks.type(folder.file("no.eds") + "\n");
  ASSERT_TRUE(asks.says("this cannot be used"));
  asks.type(eds("drive.eds") + "\n\n\n");
  ASSERT_TRUE(asks.says("Machine file to write [berth.toml]:"));
  asks.type(folder.file("nowhere/conveyor.toml") + "\n");
  ASSERT_TRUE(asks.says("there is no such folder"));
  asks.type(file + "\n");
  ASSERT_TRUE(asks.says("Name of the machine ["));
  asks.type("⚙ \"left\" 'line'\n");
  ASSERT_TRUE(asks.says("conveyor.plant.toml is there already. Replace it? [y/N]"));
  asks.type("n\n");
  EXPECT_EQ(asks.end().status, 1);
  EXPECT_FALSE(exists(file));
  EXPECT_EQ(contents(plant), "# mine\n");
}

// A wrong name is told before anything is asked.
TEST_F(Init, NamesAreCheckedBeforeTheQuestions) {
  Background asks({"init", "--name", "a/b"}, OnTerminal{80, 24});
  const Outcome ended = asks.end();
  EXPECT_EQ(ended.status, 2) << ended.out;
  EXPECT_FALSE(has(ended.out, "Description, or port")) << ended.out;
}

// The end of the input at each of the questions.
TEST_F(Init, TheInputMayEndAtAnyQuestion) {
  const std::vector<std::pair<std::string, std::string>> steps{{"Description, or port:", eds("drive.eds") + "\n"},
                                                               {"how many of it [1]:", "2\n"},
                                                               {"no more):", "\n"},
                                                               {"Machine file to write [berth.toml]:", file + "\n"},
                                                               {"Name of the machine [", ""}};
  for (std::size_t last = 0; last < steps.size(); ++last) {
    Background asks({"init"}, OnTerminal{100, 24});
    for (std::size_t step = 0; step <= last; ++step) {
      ASSERT_TRUE(asks.says(steps[step].first)) << last;
      asks.type(step == last ? "\x04" : steps[step].second);
    }
    const Outcome ended = asks.end();
    EXPECT_EQ(ended.status, 1) << last << ended.out;
    EXPECT_TRUE(has(ended.err, "nothing was written")) << last << ended.err;
    EXPECT_EQ(files(), 0U) << last;
  }
}

// `berth init drive.eds` names the file to write: a description must not be what is replaced.
TEST_F(Init, ADescriptionIsNoMachineFile) {
  const std::string before = contents(eds("io.eds"));
  for (const Words& words :
       std::vector<Words>{{"init", eds("io.eds"), "--eds", eds("drive.eds"), "--force"},
                          {"init", file, "--plant", eds("io.eds"), "--eds", eds("drive.eds"), "--force"}}) {
    const Outcome refused = berth(words);
    EXPECT_EQ(refused.status, 2) << refused.out;
    EXPECT_TRUE(has(refused.err, "this is a description: give it as --eds " + eds("io.eds"))) << refused.err;
  }
  EXPECT_EQ(contents(eds("io.eds")), before);
  EXPECT_EQ(files(), 0U);
  const Outcome ending = berth({"init", folder.file("conveyor"), "--eds", eds("drive.eds")});
  EXPECT_EQ(ending.status, 2);
  EXPECT_TRUE(has(ending.err, "end in .toml")) << ending.err;
}

TEST_F(Init, QuestionsEndWithoutAFile) {
  ASSERT_EQ(init({"--eds", eds("drive.eds"), "--name", "first"}).status, 0);
  {
    Background asks({"init", file, "--name", "second"}, OnTerminal{80, 24});
    ASSERT_TRUE(asks.says("Description, or port:"));
    asks.type(eds("io.eds") + "\n1\n\n");
    ASSERT_TRUE(asks.says("are there already. Replace them? [y/N]"));
    asks.type("n\n");
    EXPECT_EQ(asks.end().status, 1);
  }
  for (const auto* const keys : {"\x04", "\x03"}) {  // the input's end, Ctrl-C
    Background asks({"init", file}, OnTerminal{80, 24});
    ASSERT_TRUE(asks.says("Description, or port:"));
    asks.type(keys);
    const Outcome ended = asks.end();
    EXPECT_EQ(ended.status, 1) << ended.out << ended.err;
    EXPECT_TRUE(has(ended.err, "nothing was written")) << ended.err;
  }
  EXPECT_TRUE(has(contents(file), "name = \"first\""));
}

// A slot waits for the one, the device answers the other.
TEST_F(Init, ADescriptionWithTwoVendorIdsIsTold) {
  std::string text = contents(eds("io.eds"));
  const auto at = text.find("VendorNumber=");
  ASSERT_NE(at, std::string::npos);
  text.replace(at, text.find('\n', at) - at, "VendorNumber=0x123");
  folder.write("eds/io.eds", text);
  const Outcome made = init({"--eds", eds("io.eds"), "--eds", eds("drive.eds")});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_TRUE(has(made.out, "note: " + eds("io.eds") + ": the vendor-ID is ")) << made.out;
  EXPECT_TRUE(has(made.out, "00000123h in VendorNumber")) << made.out;
  EXPECT_FALSE(has(made.out, "note: " + eds("drive.eds"))) << made.out;
}

}  // namespace
}  // namespace berth::test

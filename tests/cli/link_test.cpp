// `berth link` as a person uses it.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "berth/text/columns.hpp"
#include "machines.hpp"
#include "process.hpp"
#include "tests/paths.hpp"

namespace berth::test {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

/// The example in a folder of its own, with its links or others.
class Link : public ::testing::Test {
 protected:
  Link() : folder_(fs::temp_directory_path() / ("berth-link-" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "eds");
    for (const char* const name : {"controller.eds", "io.eds"})
      fs::copy(example("eds/") + name, folder_ / "eds" / name);
    machine_ = read(example("linked.toml"));
    write("linked.toml", machine_);
  }
  ~Link() override { fs::remove_all(folder_); }
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  static std::string read(const fs::path& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
  }
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  [[nodiscard]] std::string file(const std::string& name) const { return (folder_ / name).string(); }

  fs::path folder_;
  std::string machine_;
};

}  // namespace

TEST_F(Link, ThePlanFitsATerminal) {
  const Outcome run = berth({"link", file("linked.toml"), "--links"});
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.out.find("field: 250 kbit/s, 4 objects in 3 PDOs"), std::string::npos) << run.out;
  EXPECT_NE(run.out.find(" 181h  press"), std::string::npos) << run.out;
  EXPECT_NE(run.out.find("left io/6000h:01 -> belt/A4C0h:02"), std::string::npos) << run.out;
  std::istringstream lines(run.out);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(text::columns(line), 80U) << line;
  EXPECT_FALSE(fs::exists(folder_ / "plan.toml"));
}

// S5.20: devices, node-IDs and bit rate, then variables, then PDOs: all of it stands in the DCFs.
TEST_F(Link, S5_20_S5_22_FilesOfAllSteps) {
  const Outcome dry = berth({"link", file("linked.toml"), "--output", file("out"), "--dry-run"});
  EXPECT_EQ(dry.status, 0) << dry.err;
  EXPECT_NE(dry.out.find("would write " + file("out/press.dcf")), std::string::npos) << dry.out;
  EXPECT_FALSE(fs::exists(file("out")));
  const Outcome run = berth({"link", file("linked.toml"), "--output", file("out")});
  EXPECT_EQ(run.status, 0) << run.err;
  const std::string dcf = read(file("out/press.dcf"));
  for (const char* const line : {"NodeID=0x01", "Baudrate=250", "NodeName=press", "ParameterName=speed",
                                 "Denotation=speed", "ModifiedBy=berth link"}) {
    EXPECT_NE(dcf.find(line), std::string::npos) << line;
  }
  const Outcome checked = berth({"eds", "check", file("out/press.dcf")});
  EXPECT_EQ(checked.status, 0) << checked.out;
  EXPECT_NE(checked.out.find("0 errors, 0 warnings"), std::string::npos) << checked.out;
  const Outcome again = berth({"link", file("linked.toml"), "--output", file("out")});
  EXPECT_NE(again.out.find("all files are as they shall be"), std::string::npos) << again.out;
}

TEST_F(Link, TheNextPlanGoesOnFromTheLast) {
  ASSERT_EQ(berth({"link", file("linked.toml"), "--output", file("out")}).status, 0);
  const std::string before = read(file("out/plan.toml"));
  // The first link goes; what the second one has stays, and the linked DCFs are the slots' configurations now.
  const auto first = machine_.find("[[link]]");
  const auto second = machine_.find("[[link]]", first + 1);
  std::string changed = machine_.substr(0, first) + machine_.substr(second);
  for (const auto& [slot, eds] : {std::pair("press", "eds/controller.eds"), std::pair("belt", "eds/controller.eds")}) {
    const auto at = changed.find("name = \"" + std::string(slot) + "\"");
    const auto line = changed.find(eds, at);
    changed.insert(changed.find('\n', line) + 1, "config = \"out/" + std::string(slot) + ".dcf\"\n");
  }
  write("linked.toml", changed);
  const Outcome run = berth({"link", file("linked.toml"), "--output", file("out"), "--json"});
  ASSERT_EQ(run.status, 0) << run.out << run.err;
  const json said = json::parse(run.out);
  EXPECT_TRUE(said.at("good"));
  EXPECT_TRUE(said.at("written"));
  bool running = false;
  for (const auto& pdo : said.at("pdos")) {
    if (pdo.at("producer") != "press") continue;
    running = true;
    EXPECT_EQ(pdo.at("can_id"), 0x181);
    EXPECT_EQ(pdo.at("objects").size(), 1U);
    EXPECT_EQ(pdo.at("objects").at(0).at("object"), "A040h:01");
  }
  EXPECT_TRUE(running) << run.out;
  EXPECT_EQ(read(file("out/press.dcf")).find("speed"), std::string::npos) << "the variable is gone";
  EXPECT_NE(read(file("out/plan.toml")), before);
}

TEST_F(Link, ALinkThatCannotBeIsExitOneAndNoFiles) {
  write("linked.toml", machine_ + "\n[[link]]\nfrom = \"left io/6005h:00\"\nto = [\"press/x\"]\n");
  const Outcome run = berth({"link", file("linked.toml"), "--output", file("out")});
  EXPECT_EQ(run.status, 1);
  EXPECT_NE(run.err.find("linked.toml:59:1: error: link[5]: left io/6005h:00: "), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("cannot be mapped into a TPDO"), std::string::npos) << run.err;
  EXPECT_FALSE(fs::exists(file("out")));
}

namespace {

// The devices of linked.toml. The programs of the two controllers have the variables that the linker makes.
constexpr const char* plant_head = R"([plant]
seed = 3
[bus.field]
)";
constexpr const char* press = R"(
[[device]]
bus = "field"
name = "press"
eds = "eds/controller.eds"
serial = 1
script = "press.lua"
variables = [
  { name = "running", type = "UNSIGNED8", object = "A040h:01" },
  { name = "speed", type = "UNSIGNED16", object = "A100h:01" },
  { name = "stop_buttons", type = "UNSIGNED8", object = "A4C0h:01" },
]
)";
constexpr const char* belt = R"(
[[device]]
bus = "field"
name = "belt"
eds = "eds/controller.eds"
serial = 2
script = "belt.lua"
variables = [
  { name = "lamps", type = "UNSIGNED8", object = "A040h:01" },
  { name = "press_running", type = "UNSIGNED8", object = "A4C0h:01" },
  { name = "stop_buttons", type = "UNSIGNED8", object = "A4C0h:02" },
  { name = "press_speed", type = "UNSIGNED16", object = "A580h:01" },
]
)";
constexpr const char* modules = R"(
[[device]]
bus = "field"
name = "io {n}"
eds = "eds/io.eds"
count = 2
serial_first = 3
)";
constexpr const char* press_script = R"(
local speed = 100
device.every(10, function()
  speed = speed + 1
  device.write("speed", speed)
  device.write("running", 1)
end)
)";
constexpr const char* belt_script = R"(
local told = false
device.on_write("press_speed", function(value)
  if not told then print("the press runs at", value > 100, device.read("press_running")) end
  told = true
end)
)";

}  // namespace

// What links need is part of a device's configuration: nothing but the machine file is written by hand.
TEST_F(Link, UpLaysTheLinks) {
  write("plant.toml", std::string(plant_head) + press + belt + modules);
  write("press.lua", press_script);
  write("belt.lua", belt_script);
  const Outcome run = berth({"up", file("linked.toml"), "--sim", file("plant.toml"), "--json"});
  ASSERT_EQ(run.status, 0) << run.err << run.out;
  EXPECT_NE(run.err.find("the press runs at true 1\n"), std::string::npos) << run.err;
  const json said = json::parse(run.out);
  std::size_t configured = 0;
  for (const auto& event : said.at("events")) {
    const bool written = event.at("kind") == "configured" &&
                         event.at("text").get<std::string>().find("of linked.toml written") != std::string::npos;
    if (written) ++configured;
  }
  EXPECT_EQ(configured, 4U) << run.out;
}

// A device's program without a variable that a link needs: the device is not started, and the report says what it
// refused.
TEST_F(Link, S5_4_AProgramWithoutTheVariable) {
  std::string without = belt;
  const std::string line = "  { name = \"press_speed\", type = \"UNSIGNED16\", object = \"A580h:01\" },\n";
  ASSERT_NE(without.find(line), std::string::npos);
  without.erase(without.find(line), line.size());
  write("plant.toml", std::string(plant_head) + press + without + modules);
  write("press.lua", press_script);
  write("belt.lua", "");
  const Outcome run = berth({"up", file("linked.toml"), "--sim", file("plant.toml"), "--timeout", "30 s"});
  EXPECT_EQ(run.status, 1) << run.out;
  EXPECT_NE(run.err.find("slot belt (node-ID 2)"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("its configuration failed: "), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("linked.toml"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("object does not exist"), std::string::npos) << run.err;
  EXPECT_EQ(run.err.find("slot press"), std::string::npos) << "the others run: " << run.err;
}

// A link to an object that is gone, and links in a circle: nothing is sent, and the report says which link it is.
TEST_F(Link, UpRefusesLinksThatCannotBe) {
  write("plant.toml", std::string(plant_head) + modules);
  const auto refused = [&](const std::string& links) {
    write("linked.toml", machine_ + links);
    const Outcome run = berth({"up", file("linked.toml"), "--sim", file("plant.toml"), "--record", file("sent.log")});
    EXPECT_EQ(run.status, 2) << run.out;
    EXPECT_FALSE(fs::exists(file("sent.log")) && fs::file_size(file("sent.log")) > 0);
    return run.err;
  };
  const auto gone = refused("\n[[link]]\nfrom = \"left io/6401h:01\"\nto = [\"press/level\"]\n");
  EXPECT_NE(gone.find("linked.toml:59:1: error: link[5]: left io/6401h:01"), std::string::npos) << gone;
  const auto circle = refused(
      "\n[[link]]\nfrom = \"press/a\"\nto = [\"belt/b\"]\ntype = \"UNSIGNED8\"\n"
      "[[link]]\nfrom = \"belt/b\"\nto = [\"press/a\"]\n");
  EXPECT_NE(circle.find("linked.toml:"), std::string::npos) << circle;
  EXPECT_NE(circle.find("error: link["), std::string::npos) << circle;
  write("linked.toml", machine_);
  EXPECT_EQ(berth({"link", file("linked.toml")}).status, 0) << "a repeat with the links put right heals it";
}

// The plan of the machine file is what `berth up` and `berth link` go on from.
TEST_F(Link, ThePlanOfTheMachineFile) {
  const auto key = machine_.find("name = \"linked\"\n");
  machine_.insert(key, "link_plan = \"kept/plan.toml\"\n");
  write("linked.toml", machine_);
  ASSERT_EQ(berth({"link", file("linked.toml"), "--output", file("kept")}).status, 0);
  // Another variable comes, whose name is before the others': what was there stays where it is.
  write("linked.toml",
        machine_ + "\n[[link]]\nfrom = \"press/before\"\nto = [\"belt/press_before\"]\ntype = \"UNSIGNED16\"\n");
  const Outcome links = berth({"link", file("linked.toml"), "--links"});
  EXPECT_NE(links.out.find("press/speed: UNSIGNED16 input, A100h:01"), std::string::npos) << links.out;
  EXPECT_NE(links.out.find("press/before: UNSIGNED16 input, A100h:02"), std::string::npos) << links.out;
  const Outcome anew = berth({"link", file("linked.toml"), "--links", "--anew"});
  EXPECT_NE(anew.out.find("press/before: UNSIGNED16 input, A100h:01"), std::string::npos) << anew.out;
  write("kept/plan.toml", "format = 2\n");
  EXPECT_EQ(berth({"link", file("linked.toml")}).status, 2);
}

TEST_F(Link, WrongUse) {
  EXPECT_EQ(berth({"link", "/no/such.toml"}).status, 2);
  EXPECT_EQ(berth({"link", example("by-eds.toml")}).status, 2) << "it has no link";
  EXPECT_EQ(berth({"link", file("linked.toml"), "--plan", "/no/plan.toml"}).status, 2);
  write("plan.toml", "format = 2\n");
  const Outcome run = berth({"link", file("linked.toml"), "--plan", file("plan.toml")});
  EXPECT_EQ(run.status, 2);
  EXPECT_NE(run.err.find("plan.toml:1:10: error: format"), std::string::npos) << run.err;
  EXPECT_EQ(berth({"link", file("linked.toml"), "--output", "/proc/no/such"}).status, 3);
}

}  // namespace berth::test

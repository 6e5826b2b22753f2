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
TEST_F(Link, S5_20_FilesOfAllSteps) {
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

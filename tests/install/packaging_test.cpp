// What packages hold besides the program and the library (packaging/): judged by the tools of those who read it.
#include <gtest/gtest.h>
#include <unistd.h>
#include <string>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "../paths.hpp"
#include "../pch.hpp"
#include "../shell.hpp"

namespace {

namespace fs = std::filesystem;

using berth::test::has;
using berth::test::Ran;

/// Both streams.
Ran run(const std::string& command) { return berth::test::shell("{ " + command + "; } 2>&1"); }

std::string packaging(const std::string& name) { return berth::test::source_dir() + "/packaging/" + name; }

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(Packaging, TheDesktopEntryIsValid) {
  if (!has("desktop-file-validate")) GTEST_SKIP() << "needs shells: desktop-file-validate is not installed";
  const Ran ran = run("desktop-file-validate " + packaging("desktop/org.berth_canopen.Studio.desktop"));
  EXPECT_EQ(ran.status, 0);
  EXPECT_EQ(ran.out, "");
}

TEST(Packaging, TheAppStreamFileIsValid) {
  if (!has("appstreamcli")) GTEST_SKIP() << "needs shells: appstreamcli is not installed";
  const Ran ran = run("appstreamcli validate --no-net " + packaging("desktop/org.berth_canopen.Studio.metainfo.xml"));
  EXPECT_EQ(ran.status, 0) << ran.out;
}

// One version, wherever it is written.
TEST(Packaging, TheVersionIsThatOfTheProject) {
  const std::string cmake = text_of(berth::test::source_dir() + "/CMakeLists.txt");
  const auto at = cmake.find("VERSION ", cmake.find("project(")) + 8;
  const std::string version = cmake.substr(at, cmake.find(' ', at) - at);
  EXPECT_TRUE(text_of(packaging("debian/changelog")).starts_with("berth (" + version + ")")) << version;
  EXPECT_NE(text_of(packaging("desktop/org.berth_canopen.Studio.metainfo.xml")).find("version=\"" + version + "\""),
            std::string::npos)
      << version;
}

// systemd 254 and later can judge a rule; before, what each line begins with and its quotes are looked at.
TEST(Packaging, TheRulesOfUdevAreWellFormed) {
  const std::string path = packaging("udev/78-berth.rules");
  if (run("udevadm verify --help").status == 0) {
    const Ran ran = run("udevadm verify --resolve-names=never " + path);
    EXPECT_EQ(ran.status, 0) << ran.out;
  }
  std::istringstream lines(text_of(path));
  int rules = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line.front() == '#') continue;
    ++rules;
    EXPECT_EQ(std::count(line.begin(), line.end(), '"') % 2, 0) << line;
    EXPECT_EQ(line.back(), '"') << "no comment behind a rule: udev ignores the whole line: " << line;
    EXPECT_TRUE(line.starts_with("ACTION") || line.starts_with("SUBSYSTEM") || line.starts_with("ENV{") ||
                line.starts_with("LABEL"))
        << line;
  }
  EXPECT_GT(rules, 8);
}

// The desktop entry's program, with a berth and an opener that write down what they get.
class StudioDesktop : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "berth-desktop-XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder = name;
    program("berth", "echo \"$@\" >" + file("words") + "; echo starting; echo \"Studio: http://127.0.0.1:1/#token\"");
    program("open", "echo \"$@\" >" + file("opened.part") + "; mv " + file("opened.part") + " " + file("opened"));
  }
  void TearDown() override { fs::remove_all(folder); }
  [[nodiscard]] std::string file(const std::string& name) const { return (folder / name).string(); }
  void program(const std::string& name, const std::string& does) const {
    std::ofstream(file(name)) << "#!/bin/sh\n" << does << "\n";
    fs::permissions(file(name), fs::perms::owner_all);
  }
  [[nodiscard]] Ran start(const std::string& words) const {
    return run("BERTH=" + file("berth") + " BROWSER_OPENER=" + file("open") + " " +
               packaging("desktop/studio-desktop") + " " + words + " </dev/null; for i in $(seq 100); do [ -e " +
               file("opened") + " ] && break; sleep 0.05; done");
  }
  fs::path folder;
};

TEST_F(StudioDesktop, OpensTheAddressThatBerthPrints) {
  const Ran ran = start("'a machine.toml'");
  EXPECT_NE(ran.out.find("starting"), std::string::npos) << ran.out;
  EXPECT_EQ(text_of(file("words")), "studio a machine.toml\n");
  EXPECT_EQ(text_of(file("opened")), "http://127.0.0.1:1/#token\n");
}

TEST_F(StudioDesktop, WithoutAFileItIsTheBuiltInMachine) {
  (void)start("");
  EXPECT_TRUE(text_of(file("words")).starts_with("demo --studio")) << text_of(file("words"));
}

}  // namespace

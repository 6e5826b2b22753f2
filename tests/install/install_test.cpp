// The package that `cmake --install` gives, and a project outside that uses it: this build is installed to a folder of
// its own, and configured, built and run against from there.
#include <gtest/gtest.h>
#include <unistd.h>
#include <string>
#include <vector>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "../paths.hpp"
#include "../pch.hpp"
#include "../shell.hpp"

namespace {

namespace fs = std::filesystem;

/// CMake breaks lines where it likes.
std::string on_one_line(const std::string& text) {
  std::istringstream words(text);
  std::string line;
  for (std::string word; words >> word;) line += word + ' ';
  return line;
}

/// Both streams of a command. It must not see how this build was called.
berth::test::Ran run_apart(const std::string& command) {
  return berth::test::shell("env -u CXXFLAGS -u LDFLAGS -u CXX " + command + " 2>&1");
}

std::string contents(const fs::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

std::vector<std::string> rooms(const char* names) {
  std::istringstream words(names);
  return {std::istream_iterator<std::string>(words), {}};
}

class Install : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    std::string name = (fs::temp_directory_path() / "berth-install-XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder = name;
    const auto installed =
        run_apart(std::string(BERTH_CMAKE) + " --install " BERTH_BUILD " --prefix " + name + "/prefix");
    ASSERT_EQ(installed.status, 0) << installed.out;
  }
  static void TearDownTestSuite() {
    if (!folder.empty()) fs::remove_all(folder);
  }
  /// Configures tests/install/outside against the package. `packages` that the machine may well have are hidden.
  static berth::test::Ran configure(const std::string& build, const std::string& rooms,
                                    const std::vector<std::string>& hidden) {
    std::string command = std::string(BERTH_CMAKE) + " -S " + berth::test::source_dir() + "/tests/install/outside -B " +
                          (folder / build).string() + " -G '" BERTH_GENERATOR "' -DCMAKE_CXX_COMPILER=" BERTH_CXX +
                          " -DCMAKE_BUILD_TYPE=None -DCMAKE_PREFIX_PATH=" + (folder / "prefix").string() +
                          " -DROOMS='" + rooms + "'" + " -DCMAKE_EXE_LINKER_FLAGS='" BERTH_LINK_FLAGS "'";
    for (const auto& package : hidden) command += " -DCMAKE_DISABLE_FIND_PACKAGE_" + package + "=TRUE";
    return run_apart(command);
  }
  static fs::path package() {
    for (const auto& entry : fs::recursive_directory_iterator(folder / "prefix")) {
      if (entry.path().filename() == "BerthTargets.cmake") return entry.path().parent_path();
    }
    return {};
  }
  static inline fs::path folder;
};

// HU.29: the packages of the distribution, and only those that the rooms asked for need.
TEST_F(Install, AnOutsideProjectFindsBuildsAndRuns) {
  const auto configured =
      configure("outside", "co;device;sim", {"SQLiteCpp", "SQLite3", "pugixml", "tomlplusplus", "nlohmann_json"});
  ASSERT_EQ(configured.status, 0) << configured.out;
  const auto built = run_apart(std::string(BERTH_CMAKE) + " --build " + (folder / "outside").string());
  ASSERT_EQ(built.status, 0) << built.out;
  EXPECT_NE(built.out.find("unused"), std::string::npos) << "its own -Wall warns, and no -Werror of ours stops it";
  const auto ran = run_apart((folder / "outside" / "outside").string());
  EXPECT_EQ(ran.status, 0);
  EXPECT_EQ(ran.out, "node 5 has vendor-ID 0000002A\n");
}

// A run-time system in C links with the process image (berth/process/process.h).
TEST_F(Install, AProgramInCHasTheProcessImage) {
  const auto configured =
      configure("in_c", "co;device;sim;process", {"SQLiteCpp", "SQLite3", "tomlplusplus", "nlohmann_json"});
  ASSERT_EQ(configured.status, 0) << configured.out;
  const auto built = run_apart(std::string(BERTH_CMAKE) + " --build " + (folder / "in_c").string());
  ASSERT_EQ(built.status, 0) << built.out;
  const auto ran = run_apart((folder / "in_c" / "outside_c").string());
  EXPECT_EQ(ran.status, 0);
  EXPECT_EQ(ran.out, "process image \"test-outside\": it is not there; start the program of the device first\n");
}

// A room brings what it uses and no more: SQLite is the store's, and the main job knows only `places::SlotStore`.
TEST_F(Install, OnlyTheStoreBringsSqlite) {
  const auto without_store = configure("operate", "operate;command;serve", {"SQLiteCpp", "SQLite3"});
  EXPECT_EQ(without_store.status, 0) << without_store.out;
}

TEST_F(Install, WhatIsMissingIsNamed) {
  const auto without_sqlite = configure("store", "store", {"SQLiteCpp"});
  EXPECT_NE(without_sqlite.status, 0);
  EXPECT_NE(without_sqlite.out.find("SQLiteCpp"), std::string::npos) << without_sqlite.out;
  const auto no_room = configure("attic", "attic", {});
  EXPECT_NE(no_room.status, 0);
  EXPECT_NE(on_one_line(no_room.out).find("Berth has no room attic; its rooms: base, rt,"), std::string::npos)
      << no_room.out;
}

TEST_F(Install, EveryRoomHasItsTargetLibraryAndHeaders) {
  const std::string targets = contents(package() / "BerthTargets.cmake");
  for (const auto& room : rooms(BERTH_ROOMS)) {
    EXPECT_NE(targets.find("add_library(Berth::" + room + " STATIC IMPORTED)"), std::string::npos) << room;
    EXPECT_TRUE(fs::exists(package() / ".." / ".." / ("libberth_" + room + ".a"))) << room;
    for (const auto& entry : fs::directory_iterator(fs::path(berth::test::source_dir()) / "berth" / room)) {
      if (entry.path().extension() != ".hpp") continue;
      const auto name = fs::path("berth") / room / entry.path().filename();
      EXPECT_EQ(contents(folder / "prefix" / "include" / name), contents(entry.path())) << name;
    }
  }
  EXPECT_TRUE(fs::exists(package() / "BerthConfigVersion.cmake"));
}

// The random worlds are for `berth study` and the tests (docs/architecture.md): the library has none of them.
TEST_F(Install, WhatOnlyTheProgramUsesIsNotInstalled) {
  const std::string targets = contents(package() / "BerthTargets.cmake");
  const auto inside = rooms(BERTH_ROOMS_INSIDE);
  EXPECT_EQ(inside.size(), 2U);
  for (const auto& room : inside) {
    EXPECT_TRUE(fs::exists(fs::path(berth::test::source_dir()) / "berth" / room)) << room;
    EXPECT_EQ(targets.find("berth_" + room), std::string::npos) << room;
    EXPECT_EQ(targets.find("Berth::" + room), std::string::npos) << room;
    EXPECT_FALSE(fs::exists(package() / ".." / ".." / ("libberth_" + room + ".a"))) << room;
    EXPECT_FALSE(fs::exists(folder / "prefix" / "include" / "berth" / room)) << room;
  }
}

TEST_F(Install, NothingOfThisBuildLeaks) {
  for (const auto& entry : fs::directory_iterator(package())) {
    const std::string text = contents(entry.path());
    EXPECT_EQ(text.find("-Werror"), std::string::npos) << entry.path();
    EXPECT_EQ(text.find("-fsanitize"), std::string::npos) << entry.path();
    EXPECT_EQ(text.find("berth_options"), std::string::npos) << entry.path();
    EXPECT_EQ(text.find(berth::test::source_dir()), std::string::npos) << entry.path();
  }
  for (const auto& entry : fs::recursive_directory_iterator(folder / "prefix" / "include")) {
    if (entry.is_regular_file()) {
      EXPECT_TRUE(entry.path().extension() == ".hpp" || entry.path().filename() == "process.h") << entry.path();
    }
  }
}

TEST_F(Install, TheProgramRuns) {
  const auto ran = run_apart((folder / "prefix" / "bin" / "berth").string() + " --version");
  EXPECT_EQ(ran.status, 0) << ran.out;
  EXPECT_NE(ran.out.find("0.2.0"), std::string::npos) << ran.out;
}

}  // namespace

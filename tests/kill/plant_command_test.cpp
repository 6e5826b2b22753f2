// `berth plant`, and what `berth up` says when the plant is not as it should be. In one process after the other.
#include <gtest/gtest.h>
#include <unistd.h>
#include <string>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "../paths.hpp"
#include "../shell.hpp"

namespace berth {
namespace {

// Both streams together.
test::Ran berth(const std::string& words) {
  return test::shell("timeout 120 " + test::binary() + " " + words + " 2>&1");
}

class PlantCommand : public ::testing::Test {
 protected:
  PlantCommand() {
    std::string pattern = (std::filesystem::temp_directory_path() / "berth-plant-XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr) std::abort();
    folder_ = pattern + "/";
    std::ofstream(folder_ + "m.toml") << "[machine]\nname = \"m\"\n\n[bus.field]\nport = \"plant:" << folder_
                                      << "s\"\nbitrate = 125_000\n\n[[slot]]\nbus = \"field\"\nid = 1\nname = \"s1\"\n"
                                      << "type = { vendor = 1, product = 1 }\n";
    std::ofstream(folder_ + "p.toml") << "[bus.field]\n\n[[device]]\nbus = \"field\"\nname = \"d\"\n"
                                      << "type = { vendor = 1, product = 1, revision = 0 }\nserial = 5\n";
  }
  ~PlantCommand() override {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  std::string folder_;
};

TEST_F(PlantCommand, UpWithoutThePlantSaysHowToStartOne) {
  const auto o = berth("up " + folder_ + "m.toml");
  EXPECT_EQ(o.status, 3) << o.out;
  EXPECT_NE(o.out.find("no plant listens there"), std::string::npos) << o.out;
  EXPECT_NE(o.out.find("berth plant PLANT --listen " + folder_ + "s"), std::string::npos) << o.out;
}

TEST_F(PlantCommand, WhatNeedsAWorldOfItsOwnIsRefused) {
  const auto o = berth("up " + folder_ + "m.toml --fast");
  EXPECT_EQ(o.status, 2) << o.out;
  EXPECT_NE(o.out.find("--sim PLANT"), std::string::npos) << o.out;
}

TEST_F(PlantCommand, ABusWithoutABitRateAndAMissingFileAreRefused) {
  auto o = berth("plant " + folder_ + "p.toml --listen " + folder_ + "s");
  EXPECT_EQ(o.status, 2) << o.out;
  EXPECT_NE(o.out.find("bit rate"), std::string::npos) << o.out;
  o = berth("plant " + folder_ + "none.toml --listen " + folder_ + "s");
  EXPECT_EQ(o.status, 2) << o.out;
  o = berth("plant " + folder_ + "p.toml --machine " + folder_ + "m.toml --listen " + folder_ + "no/such/folder");
  EXPECT_EQ(o.status, 3) << o.out;
  EXPECT_FALSE(std::filesystem::exists(folder_ + "s"));
}

// A machine of plant ports runs on a simulated world of this process too.
TEST_F(PlantCommand, SimIsStrongerThanThePort) {
  const auto o = berth("up " + folder_ + "m.toml --sim " + folder_ + "p.toml --until operational");
  EXPECT_EQ(o.status, 0) << o.out;
}

TEST_F(PlantCommand, ThePlantRunsInRealTimeForAProcessAfterAnother) {
  const std::string plant = "(timeout 400 " + berth::test::binary() + " plant " + folder_ + "p.toml --machine " +
                            folder_ + "m.toml --listen " + folder_ + "s >" + folder_ + "log 2>&1 & echo $! >" +
                            folder_ + "pid)";
  ASSERT_EQ(std::system(plant.c_str()), 0);
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(2);
  const auto listens = [&] {
    std::ostringstream log;
    log << std::ifstream(folder_ + "log").rdbuf();
    return log.str().find("Ctrl-C ends it") != std::string::npos;
  };
  while (!listens() && std::chrono::steady_clock::now() < end) ::usleep(5'000);  // between two looks
  ASSERT_TRUE(listens());
  const std::string up = "up " + folder_ + "m.toml --control " + folder_ + "c --until operational --timeout 100";
  auto o = berth(up);
  EXPECT_EQ(o.status, 0) << o.out;
  EXPECT_NE(o.out.find("s1: bound to 00000001-00000001-00000000-00000005 as node-ID 1"), std::string::npos) << o.out;
  // The next knows nothing: it has no store, and finds a device with a node-ID of its own.
  o = berth(up);
  EXPECT_EQ(o.status, 0) << o.out;
  // Another rate than the plant's.
  ASSERT_EQ(std::system(("sed -i 's/125_000/250_000/' " + folder_ + "m.toml").c_str()), 0);
  o = berth(up);
  EXPECT_EQ(o.status, 3) << o.out;
  EXPECT_NE(o.out.find("is configured for 250000 bit/s, but plant:" + folder_ + "s runs at 125000"), std::string::npos)
      << o.out;
  ASSERT_EQ(std::system(("kill $(cat " + folder_ + "pid)").c_str()), 0);
}

}  // namespace
}  // namespace berth

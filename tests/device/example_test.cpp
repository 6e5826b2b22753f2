// The device of examples/device, as a program: what it does on its bus, frame by frame.
#include <gtest/gtest.h>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "../paths.hpp"
#include "../pch.hpp"
#include "../shell.hpp"

namespace {

berth::test::Ran run_example() { return berth::test::shell(berth::test::example_program("device")); }

// HU.28: a dictionary built at run time, in the example's code.
TEST(ExampleDevice, DoesWhatItsMakerWrote) {
  const auto run = run_example();
  ASSERT_EQ(run.status, 0) << run.out;
  std::vector<std::string> frames;
  std::istringstream lines(run.out);
  for (std::string line; std::getline(lines, line);) {
    if (const auto at = line.find("ms  "); at != std::string::npos) frames.push_back(line.substr(at + 4));
  }
  EXPECT_EQ(frames, (std::vector<std::string>{
                        "705#00",                // boot-up
                        "000#0105",              // start
                        "185#0000",              // TPDO 1: sent when operational is entered
                        "205#50",                // RPDO 1
                        "605#2B0120005E010000",  // limit 35.0
                        "585#6001200000000000",
                        "605#2310100173617665",  // save
                        "585#6010100100000000",
                        "185#D700",              // 21.5; not sent again for the same value
                        "185#2201",              // 29.0
                        "185#6801",              // 36.0: above the limit
                        "085#1042090000000000",  // EMCY 4210h, register: temperature and generic
                        "185#5401",              // 34.0
                        "085#0000000000000000",  // error reset
                    }));
  EXPECT_NE(run.out.find("fan at 80 %\n"), std::string::npos);
  EXPECT_EQ(run_example().out, run.out) << "deterministic";
}

// The issue: a device in about 40 lines of code.
TEST(ExampleDevice, IsShort) {
  std::ifstream file(berth::test::source_dir() + "/examples/device/thermometer.hpp");
  int lines = 0;
  for (std::string line; std::getline(file, line);) {
    const auto first = line.find_first_not_of(' ');
    if (first != std::string::npos && !line.substr(first).starts_with("//") && line[first] != '#') ++lines;
  }
  EXPECT_GT(lines, 20);
  EXPECT_LE(lines, 45);
}

}  // namespace

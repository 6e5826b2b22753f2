/// Single commands on the small machine, each in a world of its own.
#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "machines.hpp"
#include "process.hpp"

namespace berth::test {

using Json = nlohmann::json;

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

class Command : public ::testing::Test {
 protected:
  // In a world of its own, brought up first when `up`.
  [[nodiscard]] Outcome run(Words words, bool up = false) const {
    words.insert(words.end(), {"--machine", machine, "--sim", plant, "--json"});
    if (up) words.emplace_back("--up");
    return berth(words);
  }
  [[nodiscard]] Json reply(const Words& words, int status, bool up = false) const {
    const Outcome outcome = run(words, up);
    EXPECT_EQ(outcome.status, status) << outcome.out << outcome.err;
    EXPECT_TRUE(outcome.err.empty()) << "with --json everything is in the object: " << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }

  Folder folder;
  std::string machine = folder.write("machine.toml", small_machine);
  std::string plant = folder.write("plant.toml", small_plant);
  std::string left = "00000001-00000001-00000000-00000020";
};

}  // namespace berth::test

// The reader of Berth's output stops reading: a person presses Ctrl-S, a pager waits, a journal hangs. The buses go on.
#include <gtest/gtest.h>

#include <csignal>
#include <nlohmann/json.hpp>
#include <string>

#include "../pch.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

Words paced(const std::string& machine, const std::string& control) {
  return {"up", example(machine + ".toml"), "--sim", example(machine + ".plant.toml"), "--pace", "--control", control};
}

// The slots that it says are operational.
int operational(const std::string& control) {
  const auto answer = berth({"status", "--json", "--control", control});
  const auto json = nlohmann::json::parse(answer.out, nullptr, false);
  if (!json.is_object() || !json.contains("slots")) return -1;
  return static_cast<int>(
      std::ranges::count_if(json["slots"], [](const auto& slot) { return slot["state"] == "operational"; }));
}

// A pipe holds 64 KiB and the terminal 4 KiB: the events of 120 devices are more than both.
TEST(StoppedReader, OfAPipeDoesNotStopTheBus) {
  const Folder folder;
  auto words = paced("hundred-twenty", folder.file("s"));
  words.insert(words.end(), {"--json", "--events"});
  Background up(words);
  ASSERT_TRUE(eventually([&] { return operational(folder.file("s")) == 120; }));
  up.signal(SIGTERM);
  const auto ended = up.end();
  EXPECT_EQ(ended.status, 0);
  EXPECT_GT(ended.out.size(), 65536U) << "too little for this test";
  std::istringstream lines(ended.out);
  int read = 0;
  for (std::string line; std::getline(lines, line); ++read) EXPECT_TRUE(nlohmann::json::accept(line)) << line;
  EXPECT_EQ(ended.err, "");
}

TEST(StoppedReader, OfATerminalDoesNotStopTheBus) {
  const Folder folder;
  auto words = paced("five-slaves", folder.file("s"));
  Background up(words, OnTerminal{});
  ASSERT_TRUE(eventually([&] { return operational(folder.file("s")) == 5; }));
  ASSERT_EQ(berth({"sim", "unplug", "s2", "--control", folder.file("s")}).status, 0);
  EXPECT_TRUE(eventually([&] { return operational(folder.file("s")) == 4; }));
}

}  // namespace
}  // namespace berth::test

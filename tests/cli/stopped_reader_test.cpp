// The reader of Berth's output stops reading: a person presses Ctrl-S, a pager waits, a journal hangs. The buses go on.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
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

// A page in place of 64 KiB, so that it is full at once.
bool shrink_pipe_of(pid_t process) {
  namespace fs = std::filesystem;
  const std::string folder = "/proc/" + std::to_string(process);
  // Before it is berth, its output is this test's.
  const auto is_berth = [&] { return fs::read_symlink(folder + "/exe") != fs::read_symlink("/proc/self/exe"); };
  if (!eventually(is_berth)) return false;
  const int pipe = ::open((folder + "/fd/1").c_str(), O_WRONLY | O_CLOEXEC);
  const int size = ::fcntl(pipe, F_SETPIPE_SZ, 4096);
  ::close(pipe);
  return size == 4096;
}

TEST(StoppedReader, OfAPipeDoesNotStopTheBus) {
  const Folder folder;
  auto words = paced("hundred-twenty", folder.file("s"));
  words.insert(words.end(), {"--json", "--events"});
  Background up(words);
  ASSERT_TRUE(shrink_pipe_of(up.pid()));
  ASSERT_TRUE(eventually([&] { return operational(folder.file("s")) == 120; }));
  up.signal(SIGTERM);
  const auto ended = up.end();
  EXPECT_EQ(ended.status, 0);
  EXPECT_GT(ended.out.size(), 40'000U) << "too little for this test";
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
  up.type("\x13");  // Ctrl-S
  ASSERT_EQ(berth({"sim", "unplug", "s2", "--control", folder.file("s")}).status, 0);
  EXPECT_TRUE(eventually([&] { return operational(folder.file("s")) == 4; }));
}

}  // namespace
}  // namespace berth::test

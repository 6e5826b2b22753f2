// SIGTERM and SIGINT before a command's own work: it ends in words, with its own exit status.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>
#include <string>

#include <chrono>
#include <filesystem>
#include <sstream>

#include "../pch.hpp"
#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

namespace fs = std::filesystem;

bool has_open(pid_t process, const std::string& path) {
  std::error_code gone;
  for (fs::directory_iterator each("/proc/" + std::to_string(process) + "/fd", gone), end; !gone && each != end;
       each.increment(gone)) {
    std::error_code closed;
    if (fs::read_symlink(each->path(), closed) == path) return true;
  }
  return false;
}

bool lives(pid_t process) {
  const std::string stat = contents("/proc/" + std::to_string(process) + "/stat");
  const auto state = stat.rfind(") ");
  return state != std::string::npos && stat[state + 2] != 'Z';
}

/// A store that cannot be opened to its end before `go_on`: SQLite looks for a journal, and this one is a pipe without
/// a writer.
class HeldStore {
 public:
  explicit HeldStore(const Folder& folder) : path_(fs::canonical(folder.write("slots.db", "")).string()) {}
  void hold() const {
    if (::mkfifo((path_ + "-journal").c_str(), 0600) != 0) throw std::runtime_error("mkfifo");
  }
  /// True once the process stands at the pipe and goes on; false: it is no more.
  [[nodiscard]] bool go_on(pid_t process) const {
    int pipe = -1;
    const bool came = eventually([&] {
      pipe = ::open((path_ + "-journal").c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
      return pipe >= 0 || !lives(process);
    });
    if (pipe >= 0) ::close(pipe);
    return came && pipe >= 0;
  }
  [[nodiscard]] const std::string& path() const noexcept { return path_; }

 private:
  std::string path_;
};

class Ended : public ::testing::TestWithParam<std::pair<std::string, int>> {};
INSTANTIATE_TEST_SUITE_P(Each, Ended,
                         ::testing::Values(std::pair("up", SIGTERM), std::pair("up", SIGINT),
                                           std::pair("bind", SIGTERM), std::pair("export", SIGTERM)),
                         [](const auto& each) {
                           return each.param.first + (each.param.second == SIGTERM ? "_SIGTERM" : "_SIGINT");
                         });

TEST_P(Ended, WhileItsStoreIsOpened) {
  const auto& [verb, signal] = GetParam();
  const Folder folder;
  const auto machine = folder.write("machine.toml", small_machine);
  const auto plant = folder.write("plant.toml", small_plant);
  const HeldStore store(folder);
  const Words words = verb == "export" ? Words{verb, machine, folder.file("out.json"), "--store", store.path()}
                      : verb == "up"   ? Words{verb, machine, "--sim", plant, "--store", store.path()}
                                       : Words{verb, "--machine", machine, "--sim", plant, "--store", store.path()};
  ASSERT_EQ(berth({"up", machine, "--sim", plant, "--store", store.path()}).status, 0) << "a store of its own making";
  store.hold();
  Background run(words);
  ASSERT_TRUE(eventually([&] { return has_open(run.pid(), store.path()); }));
  run.signal(signal);
  EXPECT_TRUE(store.go_on(run.pid())) << "the signal ended the process by itself";
  const Outcome end = run.end();
  EXPECT_EQ(end.status, 3) << end.out << end.err;
  EXPECT_EQ(end.err, "berth: " + store.path() + ": ended before the store was read; it was left as it is.\n");
  fs::remove(store.path() + "-journal");
  EXPECT_EQ(berth({"up", machine, "--sim", plant, "--store", store.path()}).status, 0) << "the store is whole";
}

// Of another process's plant, where Berth listens for a minute before it may send.
TEST(EndedBeforeItsBus, WhileItListens) {
  const Folder folder;
  const std::string socket = folder.file("plant.sock");
  Background plant({"plant", folder.write("plant.toml", small_plant), "--listen", socket, "--machine",
                    folder.write("sim.toml", small_machine)});
  ASSERT_TRUE(plant.says("Ctrl-C ends it")) << "it listens";
  std::string machine = small_machine;
  machine.replace(machine.find("\"sim\""), 5, "\"plant:" + socket + "\"");
  machine.replace(machine.find("probe_period"), 0, "listen = \"1 min\"\n");
  Background run({"up", folder.write("machine.toml", machine), "--control", folder.file("control.sock")});
  ASSERT_TRUE(eventually([&] { return has_open(run.pid(), "anon_inode:[signalfd]"); }));
  run.signal(SIGTERM);
  const Outcome end = run.end();
  EXPECT_EQ(end.status, 1) << end.out << end.err;
  EXPECT_EQ(end.err, "berth: ended before its work on a bus began\n");
}

// One instant of such scripts takes many minutes: each of 250 timers goes through a chain of 1,900 tables 90,000 times.
TEST(EndedInAScript, WhileItRuns) {
  const Folder folder;
  std::string fields;
  for (int i = 0; i < 150; ++i) fields += "t.x = 1 ";
  folder.write("busy.lua",
               "local t = {} for i = 1, 1900 do t = setmetatable({}, {__newindex = t}) end\n"
               "for i = 1, 250 do device.every(100, function() for j = 1, 600 do " +
                   fields + "end end) end");
  std::string plant = small_plant;
  plant.replace(plant.find("serial = 0x21"), 0, "script = \"busy.lua\"\n");
  Background run({"up", folder.write("machine.toml", small_machine), "--sim", folder.write("plant.toml", plant)});
  const auto processor_ticks = [&] {
    const std::string stat = contents("/proc/" + std::to_string(run.pid()) + "/stat");
    std::istringstream words(stat.substr(std::min(stat.size(), stat.rfind(") ") + 2)));
    std::string word;
    for (int i = 0; i < 12 && words >> word;) ++i;  // from the state, the third, to utime, the fourteenth
    return std::atol(word.c_str());
  };
  ASSERT_TRUE(eventually([&] { return processor_ticks() > 200 || !lives(run.pid()); }));
  run.signal(SIGTERM);
  const Outcome end = run.end();
  EXPECT_EQ(end.status, 1) << end.out << end.err;
  EXPECT_NE(end.err.find("busy.lua:2: it was ended with the run"), std::string::npos) << end.err;
}

// A signal is no answer: nothing is done, and what is known is told.
TEST(EndedAtAQuestion, BeforeItIsConfirmed) {
  const Folder folder;
  Background run({"bind", "--from-scratch", "--machine", folder.write("machine.toml", small_machine), "--sim",
                  folder.write("plant.toml", small_plant)},
                 OnTerminal{});
  ASSERT_TRUE(run.says("Do it? [y/N]"));
  run.signal(SIGINT);
  const Outcome end = run.end();
  EXPECT_EQ(end.status, 1) << end.out << end.err;
  EXPECT_EQ(end.out.find("present"), std::string::npos) << end.out;
}

TEST(EndedAtAQuestion, WhichDeviceBelongsWhere) {
  const Folder folder;
  std::string machine = small_machine;
  machine.replace(machine.find("\"ascending\""), 11, "\"ask\"");
  Background run(
      {"bind", "--machine", folder.write("machine.toml", machine), "--sim", folder.write("plant.toml", small_plant)},
      OnTerminal{});
  ASSERT_TRUE(run.says("type a slot"));
  run.signal(SIGTERM);
  const Outcome end = run.end();
  EXPECT_EQ(end.status, 1) << end.out << end.err;
  EXPECT_NE(end.out.rfind("present"), std::string::npos) << "the table as it stands: " << end.out;
}

}  // namespace
}  // namespace berth::test

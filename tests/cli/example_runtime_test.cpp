// examples/runtime as its README says: the controller of the conveyor's last belt is a process of its own, its program,
// in C, another one; both are killed and started anew while all 55 devices run.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "../paths.hpp"
#include "../pch.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

namespace fs = std::filesystem;

/// A program of examples/, both of whose streams go to a file. Killed with its object.
class ExampleProcess {
 public:
  ExampleProcess(const std::string& program, Words words, std::string log) : log_(std::move(log)) {
    const std::string built = binary();
    words.insert(words.begin(), built.substr(0, built.rfind('/')) + "/examples/example_" + program);
    std::vector<char*> arguments;
    for (auto& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    pid_ = ::fork();
    if (pid_ != 0) return;
    FILE* const file = std::freopen(log_.c_str(), "w", stdout);
    if (file == nullptr || ::dup2(STDOUT_FILENO, STDERR_FILENO) < 0) ::_exit(126);
    ::execv(arguments.front(), arguments.data());
    ::_exit(127);
  }
  ~ExampleProcess() { end(SIGKILL); }
  ExampleProcess(const ExampleProcess&) = delete;
  ExampleProcess& operator=(const ExampleProcess&) = delete;

  /// Its exit status, or minus the signal that ended it.
  int end(int signal) {
    if (pid_ <= 0) return 0;
    ::kill(pid_, signal);
    int status = 0;
    ::waitpid(std::exchange(pid_, -1), &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }
  [[nodiscard]] std::string said() const { return contents(log_); }

 private:
  pid_t pid_ = -1;
  std::string log_;
};

/// A copy of examples/conveyor whose plant lacks one device: the one that the example is.
struct Coal {
  explicit Coal(const std::string& without) {
    fs::copy(example("conveyor"), at, fs::copy_options::recursive);
    auto plant = contents(at + "/plant.toml");
    const std::string begin = "[[device]]\n";
    const auto name = plant.find("name   = \"" + without + "\"\n");
    const auto from = plant.rfind(begin, name);
    plant.erase(from, plant.find(begin, name) - from);
    std::ofstream(at + "/plant.toml") << plant;
  }
  [[nodiscard]] std::string file(const std::string& name) const { return at + "/" + name; }
  [[nodiscard]] std::string value(const std::string& slot, const std::string& object) const {
    const auto read = berth({"sdo", "read", slot, object, machine, "--json"});
    const auto begin = read.out.find("\"value\": ");
    return begin == std::string::npos ? read.err
                                      : read.out.substr(begin + 9, read.out.find_first_of(",\n}", begin) - begin - 9);
  }
  Folder folder;
  std::string at = folder.file("coal");
  std::string machine = at + "/machine.toml";
};

bool operational(const Coal& coal, const std::string& slot) {
  const auto status = berth({"status", coal.machine});
  std::istringstream lines(status.out);
  for (std::string line; std::getline(lines, line);) {
    if (line.find(" " + slot + " ") != std::string::npos) return line.find("operational") != std::string::npos;
  }
  return false;
}

TEST(ExampleRuntime, ItsControllerRunsABeltAndBothItsProcessesMayBeKilled) {
  const Coal coal("bunker");
  const auto socket = coal.folder.file("coal.sock");
  const auto image = "test-coal-" + std::to_string(::getpid());
  const Words controller{
      image, "10", "plant:" + socket, "field", coal.file("eds/controller.eds"), coal.file("plan.toml"), "bunker"};
  Background plant({"plant", coal.file("plant.toml"), "-m", coal.machine, "--listen", socket});
  ASSERT_TRUE(plant.says("Ctrl-C ends it"));
  ExampleProcess device("runtime", controller, coal.file("device.log"));
  Background up({"up", coal.machine, "--port", "plant:" + socket});
  ExampleProcess plc("runtime_plc", {image}, coal.file("plc.log"));

  // The desk's start button is pressed every 14 s; its lamp and the belt's drive say that the program runs.
  const auto runs = [&] {
    return coal.value("bunker", "state") == "2" && coal.value("bunker drive", "6200h:01") == "1";
  };
  EXPECT_TRUE(eventually(runs)) << device.said() << plc.said();
  EXPECT_TRUE(eventually([&] { return coal.value("desk", "b10_running") == "1"; }))
      << coal.value("desk", "b10_running");

  // Without its program a belt stands.
  EXPECT_EQ(plc.end(SIGKILL), -SIGKILL);
  EXPECT_TRUE(up.says("bunker: EMCY 6100h"));
  EXPECT_TRUE(eventually([&] { return coal.value("bunker drive", "6200h:01") == "0"; }));
  EXPECT_TRUE(eventually([&] { return coal.value("desk", "b10_running") == "0"; }));
  EXPECT_TRUE(operational(coal, "bunker")) << "the device itself goes on";
  ExampleProcess again("runtime_plc", {image}, coal.file("again.log"));
  EXPECT_TRUE(eventually(runs)) << again.said();

  // The device's process: Berth finds that it is gone, and boots the one that comes; the program waits for it.
  EXPECT_EQ(device.end(SIGKILL), -SIGKILL);
  EXPECT_TRUE(eventually([&] { return !operational(coal, "bunker"); }));
  EXPECT_TRUE(eventually([&] { return again.said().find("the device's process has ended") != std::string::npos; }));
  ExampleProcess anew("runtime", controller, coal.file("anew.log"));
  EXPECT_TRUE(eventually([&] { return operational(coal, "bunker"); })) << anew.said();
  EXPECT_TRUE(eventually(runs)) << again.said() << anew.said();
  EXPECT_EQ(anew.end(SIGTERM), 0);
  EXPECT_NE(anew.said().find("from an RPDO to the TPDOs of what the program made of it: "), std::string::npos)
      << anew.said();
  EXPECT_EQ(again.end(SIGTERM), 0);
  EXPECT_NE(again.said().find(" cycles of 5 ms, "), std::string::npos) << again.said();
}

TEST(ExampleRuntime, SaysWhatIsWrong) {
  const Folder folder;
  ExampleProcess nothing("runtime_plc", {"test-none", "0.2"}, folder.file("log"));
  EXPECT_TRUE(eventually([&] {
    return nothing.said().find("process image \"test-none\": it is not there; start the program of the device first") !=
           std::string::npos;
  })) << nothing.said();
  ExampleProcess slot("runtime",
                      {"test-none", "1", "plant:/nowhere", "field", example("conveyor/eds/controller.eds"),
                       example("conveyor/plan.toml"), "bunkr"},
                      folder.file("slot.log"));
  EXPECT_TRUE(eventually([&] { return slot.said().find("no variables of slot \"bunkr\"") != std::string::npos; }))
      << slot.said();
}

}  // namespace
}  // namespace berth::test

// berth@.service under a real systemd, which is the first process of namespaces of its own: what it hears, what it does
// when the service is killed or hangs, and what a changed machine file does (docs/service.md).
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "../paths.hpp"
#include "../shell.hpp"

namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

berth::test::Ran run(const std::string& command) { return berth::test::shell(command + " 2>&1"); }

bool has_systemd() { return fs::exists("/lib/systemd/systemd") || fs::exists("/usr/lib/systemd/systemd"); }

// The namespaces with systemd; they end with it.
class Systemd {
 public:
  Systemd() : unshare_(::fork()) {
    const std::string boot = berth::test::source_dir() + "/tests/service/boot.sh";
    const std::string source = berth::test::source_dir();
    const std::string binary = berth::test::binary();
    if (unshare_ != 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    static_cast<void>(std::freopen("/dev/null", "r", stdin) == nullptr);
    static_cast<void>(std::freopen("/dev/null", "w", stdout) == nullptr);
    ::execlp("unshare", "unshare", "--mount", "--pid", "--fork", "--kill-child", "--cgroup", "--ipc", "--uts", "bash",
             boot.c_str(), source.c_str(), binary.c_str(), nullptr);
    ::_exit(127);
  }
  ~Systemd() {
    ::kill(unshare_, SIGKILL);
    ::waitpid(unshare_, nullptr, 0);
  }
  Systemd(const Systemd&) = delete;
  Systemd& operator=(const Systemd&) = delete;
  // In the namespaces.
  [[nodiscard]] berth::test::Ran in(const std::string& script) const {
    std::string quoted;
    for (const char c : script) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return run("nsenter --target " + first_process() + " --mount --pid --ipc --uts bash -c '" + quoted + "'");
  }
  [[nodiscard]] bool comes_up() const {
    for (int i = 0; i < 150; ++i) {
      if (!first_process().empty() && in("systemctl is-active begin.target").out == "active\n") return true;
      std::this_thread::sleep_for(200ms);
    }
    return false;
  }

 private:
  [[nodiscard]] std::string first_process() const {
    std::ifstream children("/proc/" + std::to_string(unshare_) + "/task/" + std::to_string(unshare_) + "/children");
    std::string first;
    children >> first;
    return first;
  }
  pid_t unshare_;
};

class Service : public testing::Test {
 protected:
  void SetUp() override {
    if (::geteuid() != 0) GTEST_SKIP() << "needs root";
    if (!has_systemd()) GTEST_SKIP() << "needs systemd";
    systemd.emplace();
    if (!systemd->comes_up()) GTEST_SKIP() << "needs systemd, which does not start in namespaces here";
  }
  [[nodiscard]] std::string property(const std::string& name, const std::string& machine = "five-slaves") const {
    std::string value = systemd->in("systemctl show berth@" + machine + " --value -p " + name).out;
    if (!value.empty()) value.pop_back();
    return value;
  }
  static bool eventually(const std::function<bool()>& so, std::chrono::seconds most) {
    const auto end = std::chrono::steady_clock::now() + most;
    while (std::chrono::steady_clock::now() < end) {
      if (so()) return true;
      std::this_thread::sleep_for(200ms);
    }
    return false;
  }
  bool comes(const std::string& name, const std::string& value, const std::string& machine = "five-slaves") const {
    if (eventually([&] { return property(name, machine) == value; }, 120s)) return true;
    ADD_FAILURE() << name << " is " << property(name, machine) << "\n" << log();
    return false;
  }
  // A command at the running service.
  [[nodiscard]] berth::test::Ran command(const std::string& words) const {
    return systemd->in("export ASAN_OPTIONS=detect_leaks=0; /run/berth-program " + words +
                       " --control /run/berth/berth-*.sock");
  }
  bool logs(const std::string& text) const {
    if (eventually([&] { return log().find(text) != std::string::npos; }, 60s)) return true;
    ADD_FAILURE() << "the log does not say " << text << "\n" << log();
    return false;
  }
  [[nodiscard]] std::string log() const { return systemd->in("cat /run/log-five-slaves").out; }
  [[nodiscard]] bool begins() const {
    return systemd->in("systemctl start --no-block berth@five-slaves").status == 0 && comes("ActiveState", "active");
  }
  // Never 0 or 1: a signal to these would reach others.
  [[nodiscard]] std::string process() const {
    const std::string number = property("MainPID");
    return number.size() > 1 ? number : "none";
  }
  [[nodiscard]] std::string reloaded() const {
    static_cast<void>(systemd->in(": > /run/log-five-slaves"));
    const auto reload = systemd->in("systemctl reload berth@five-slaves");
    EXPECT_EQ(reload.status, 0) << reload.out;
    EXPECT_TRUE(comes("ActiveState", "active"));
    return log();
  }

  std::optional<Systemd> systemd;
};

}  // namespace

TEST_F(Service, IsReadyWhenEverySlotIsOperationalAndEndsWell) {
  ASSERT_TRUE(begins());
  EXPECT_EQ(property("StatusText"), "5 of 5 slots operational");
  EXPECT_EQ(property("NRestarts"), "0");
  EXPECT_EQ(systemd->in("systemctl stop berth@five-slaves").status, 0);
  EXPECT_TRUE(comes("ActiveState", "inactive"));
  EXPECT_EQ(property("Result"), "success");
}

// Before it is ready, too: a stop that was asked for is no failure.
TEST_F(Service, SaysWhatItWaitsForAndIsStoppedWell) {
  ASSERT_EQ(systemd
                ->in("sed -i '/^plugged/d; s/^\\[\\[device\\]\\]/[[device]]\\nplugged = false/' "
                     "/run/machines/five-slaves.plant.toml")
                .status,
            0);
  ASSERT_EQ(systemd->in("systemctl start --no-block berth@five-slaves").status, 0);
  ASSERT_TRUE(comes("StatusText", "0 of 5 slots operational; s1 empty, s2 empty, s3 empty and 2 more"));
  EXPECT_EQ(property("ActiveState"), "activating");
  EXPECT_EQ(systemd->in("systemctl stop berth@five-slaves").status, 0);
  EXPECT_TRUE(comes("ActiveState", "inactive"));
  EXPECT_EQ(property("Result"), "success");
}

TEST_F(Service, IsStartedAgainWhenItIsKilledAndWhenItHangs) {
  ASSERT_TRUE(begins());
  const std::string first = process();
  ASSERT_EQ(systemd->in("kill -KILL " + first).status, 0);
  ASSERT_TRUE(comes("NRestarts", "1"));
  ASSERT_TRUE(comes("ActiveState", "active"));
  const std::string second = process();
  EXPECT_NE(second, first);
  ASSERT_EQ(systemd->in("kill -STOP " + second).status, 0);
  ASSERT_TRUE(comes("NRestarts", "2"));
  ASSERT_TRUE(comes("ActiveState", "active"));
}

TEST_F(Service, TakesOverWhatNeedsNoRestartAndRefusesTheRestInWords) {
  ASSERT_TRUE(begins());
  const std::string before = process();
  const std::string file = "/run/machines/five-slaves.toml";
  EXPECT_EQ(reloaded(), file + ": nothing has changed\n");
  ASSERT_EQ(systemd->in("sed -i '0,/\\[\\[slot\\]\\]/s//[[slot]]\\nspares = [77]/' " + file).status, 0);
  EXPECT_EQ(reloaded(), file + ": taken over: slot s1: spares is new\n");
  ASSERT_EQ(systemd->in("cp " + file + " /run/good; echo nonsense >> " + file).status, 0);
  const std::string wrong = reloaded();
  EXPECT_NE(wrong.find(": error: "), std::string::npos) << wrong;
  EXPECT_NE(wrong.find(file + ": nothing is taken over; the machine runs on as it was started\n"), std::string::npos)
      << wrong;
  ASSERT_EQ(systemd->in("sed 's/^bitrate .*/bitrate = 500_000/' /run/good > " + file).status, 0);
  const std::string refused = reloaded();
  EXPECT_NE(refused.find(": bus.field: bitrate: takes effect when Berth is started again\n"), std::string::npos)
      << refused;
  EXPECT_EQ(process(), before);
  EXPECT_EQ(property("NRestarts"), "0");
}

TEST_F(Service, AFileThatIsWrongIsNotTriedForEver) {
  ASSERT_EQ(systemd->in("echo nonsense >> /run/machines/five-slaves.toml").status, 0);
  ASSERT_EQ(systemd->in("systemctl start --no-block berth@five-slaves").status, 0);
  ASSERT_TRUE(comes("ActiveState", "failed"));
  EXPECT_EQ(property("ExecMainStatus"), "2");
  EXPECT_EQ(property("NRestarts"), "0");
}

TEST_F(Service, ASecondOneOnTheSameStoreIsRefused) {
  ASSERT_TRUE(begins());
  const auto second = systemd->in(
      "export ASAN_OPTIONS=detect_leaks=0; /run/berth-program up /run/machines/five-slaves.toml --sim "
      "/run/machines/five-slaves.plant.toml --store /var/lib/berth/five-slaves.db --pace");
  EXPECT_EQ(second.status, 3) << second.out;
  EXPECT_NE(second.out.find("/var/lib/berth/five-slaves.db: process "), std::string::npos) << second.out;
  EXPECT_EQ(property("NRestarts"), "0");
}

TEST_F(Service, AUnitWithoutItsMachineFileSaysSoOnce) {
  ASSERT_EQ(systemd->in("systemctl start --no-block berth@nowhere").status, 0);
  EXPECT_TRUE(comes("ActiveState", "failed", "nowhere"));
  EXPECT_EQ(property("NRestarts", "nowhere"), "0");
  EXPECT_EQ(systemd->in("cat /run/log-nowhere").out,
            "berth: /run/machines/nowhere.toml: error: cannot be read: No such file or directory\n");
}

// An older Berth was installed again. The store stays as it is, and the service does not try for ever.
TEST_F(Service, AStoreOfANewerBerthIsLeftAsItIs) {
  ASSERT_TRUE(begins());
  ASSERT_EQ(systemd->in("systemctl stop berth@five-slaves").status, 0);
  const std::string store = "/var/lib/berth/five-slaves.db";
  ASSERT_EQ(systemd
                ->in("python3 -c 'import sqlite3; c = sqlite3.connect(\"" + store +
                     "\"); c.execute(\"pragma user_version = 99\"); c.commit()'")
                .status,
            0);
  const std::string before = systemd->in("sha256sum " + store).out;
  ASSERT_EQ(systemd->in("systemctl start --no-block berth@five-slaves").status, 0);
  ASSERT_TRUE(comes("ActiveState", "failed"));
  EXPECT_EQ(property("NRestarts"), "10");
  EXPECT_NE(log().find("this store has schema version 99"), std::string::npos) << log();
  EXPECT_EQ(systemd->in("sha256sum " + store).out, before);
}

// The bus goes on, a start succeeds, and what could not be written is written when there is room again.
TEST_F(Service, AFullDiskEndsNeitherTheServiceNorItsStart) {
  ASSERT_TRUE(begins());
  ASSERT_EQ(systemd->in("mount -o remount,size=4m /var/lib").status, 0);
  static_cast<void>(systemd->in("dd if=/dev/zero of=/var/lib/fill bs=4k"));
  ASSERT_EQ(command("sim unplug s2").status, 0);
  ASSERT_TRUE(logs("the disk is full; make room on it"));
  ASSERT_TRUE(comes("StatusText", "4 of 5 slots operational; s2 absent"));
  EXPECT_EQ(property("NRestarts"), "0");
  ASSERT_EQ(systemd->in("rm /var/lib/fill").status, 0);
  ASSERT_EQ(command("sim plug device:s2").status, 0);
  ASSERT_TRUE(comes("StatusText", "5 of 5 slots operational"));
  // It starts, too, and waits for room: the simulated devices are blank again, and where each belongs is written first.
  static_cast<void>(systemd->in("dd if=/dev/zero of=/var/lib/fill bs=4k; : > /run/log-five-slaves"));
  ASSERT_EQ(systemd->in("kill -KILL " + process()).status, 0);
  ASSERT_TRUE(comes("NRestarts", "1"));
  ASSERT_TRUE(logs("the disk is full; make room on it"));
  ASSERT_EQ(systemd->in("rm /var/lib/fill").status, 0);
  ASSERT_TRUE(comes("ActiveState", "active"));
  EXPECT_EQ(property("StatusText"), "5 of 5 slots operational");
  EXPECT_EQ(property("NRestarts"), "1");
}

// The package puts a new file where the program was. The one that runs does not notice; the next start takes the new
// one.
TEST_F(Service, AnUpgradeIsTakenAtTheNextStart) {
  const std::string put = "cp " + berth::test::binary() + " /run/new && mv /run/new /run/berth-program";
  ASSERT_EQ(systemd->in("umount /run/berth-program && rm /run/berth-program && " + put).status, 0);
  ASSERT_TRUE(begins());
  const std::string old = process();
  const auto runs = [this] { return systemd->in("readlink /proc/" + process() + "/exe").out; };
  EXPECT_EQ(runs(), "/run/berth-program\n");
  ASSERT_EQ(systemd->in(put).status, 0);
  EXPECT_EQ(runs(), "/run/berth-program (deleted)\n");
  EXPECT_EQ(reloaded(), "/run/machines/five-slaves.toml: nothing has changed\n");
  EXPECT_EQ(command("status").status, 0) << "the new program asks the old one";
  EXPECT_EQ(command("sdo read s3 1018h:04").status, 0);
  EXPECT_EQ(property("NRestarts") + " " + process(), "0 " + old);
  ASSERT_EQ(systemd->in("systemctl restart berth@five-slaves").status, 0);
  EXPECT_EQ(runs(), "/run/berth-program\n");
  EXPECT_NE(process(), old);
  EXPECT_EQ(property("StatusText"), "5 of 5 slots operational");
}

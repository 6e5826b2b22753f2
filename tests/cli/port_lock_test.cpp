// One process owns a real port, whatever its environment and its user.
#include "apps/berth/port_lock.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "environment.hpp"
#include "process.hpp"

namespace berth::cli {
namespace {

can::PortSpec port(const std::string& word) { return *can::parse_port(word); }

// Of this process, so that tests that run side by side have their own.
std::string interface_name() { return "lk" + std::to_string(::getpid() % 10'000'000); }

constexpr const char* runtime_folder = "XDG_RUNTIME_DIR";

TEST(PortLock, DoesNotDependOnTheEnvironmentAndLeavesNoFile) {
  const test::Folder one;
  const test::Folder other;
  const std::string name = "socketcan:" + interface_name();
  {
    const auto lock = [&] {
      const test::EnvironmentVariable here(runtime_folder, one.file(""));
      return PortLock::take(port(name));
    }();
    ASSERT_TRUE(lock) << lock.error().message;
    const test::EnvironmentVariable there(runtime_folder, other.file(""));
    const auto again = PortLock::take(port(name));
    ASSERT_FALSE(again);
    EXPECT_EQ(again.error().status, 3);
    EXPECT_NE(again.error().message.find(name + " belongs to process " + std::to_string(::getpid()) + " already"),
              std::string::npos)
        << again.error().message;
    EXPECT_TRUE(PortLock::take(port(name + "x"))) << "another port";
    const auto run = test::berth({"scan", "--port", name});
    EXPECT_EQ(run.status, 3);
    EXPECT_NE(run.err.find("belongs to process " + std::to_string(::getpid())), std::string::npos) << run.err;
  }
  for (const auto* const folder : {&one, &other}) {
    EXPECT_TRUE(std::filesystem::is_empty(folder->file(""))) << "no file is left over";
  }
  EXPECT_TRUE(PortLock::take(port(name))) << "it goes with its owner";
}

TEST(PortLock, TwoWordsForOneSerialDeviceAreOnePort) {
  const test::Folder folder;
  const std::string device = folder.write("tty", "");
  std::filesystem::create_symlink(device, folder.file("by-id"));
  const auto lock = PortLock::take(port("slcan:" + device));
  ASSERT_TRUE(lock);
  EXPECT_FALSE(PortLock::take(port("slcan:" + folder.file("by-id"))));
}

TEST(PortLock, ALongNameIsTheWholeName) {
  const std::string host(150, 'h');
  const auto lock = PortLock::take(port("socketcand://" + host + ":1/a"));
  ASSERT_TRUE(lock);
  EXPECT_FALSE(PortLock::take(port("socketcand://" + host + ":1/a")));
  EXPECT_TRUE(PortLock::take(port("socketcand://" + host + ":1/b")));
}

// Any user can take a name of the kernel's.
TEST(PortLock, AnotherUsersProcessIsNamedAndHoldsNoSerialAdapter) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root: only root becomes another user";
  const std::string can = "socketcan:" + interface_name();
  const std::string serial = "slcan:/dev/no-such-" + interface_name();
  const auto of_root = PortLock::take(port(can));
  ASSERT_TRUE(of_root);
  int ready[2];
  int end[2];
  ASSERT_EQ(::pipe(ready), 0);
  ASSERT_EQ(::pipe(end), 0);
  const auto child = ::fork();
  if (child == 0) {
    ::close(end[1]);
    char byte = ::setgid(65534) == 0 && ::setuid(65534) == 0 && !PortLock::take(port(can)) ? 'y' : 'n';
    const auto own = PortLock::take(port(can + "u"));
    const auto adapter = PortLock::take(port(serial));
    if (!own || !adapter) byte = 'n';
    if (::write(ready[1], &byte, 1) != 1) ::_exit(1);
    static_cast<void>(::read(end[0], &byte, 1) == 0);
    ::_exit(0);
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  EXPECT_EQ(byte, 'y') << "root's lock holds for all users";
  const auto taken = PortLock::take(port(can + "u"));
  ASSERT_FALSE(taken);
  EXPECT_NE(taken.error().message.find("process " + std::to_string(child) + " of user 65534"), std::string::npos)
      << taken.error().message;
  EXPECT_TRUE(PortLock::take(port(serial))) << "the device's own lock decides";
  ::close(end[1]);
  ::waitpid(child, nullptr, 0);
  EXPECT_TRUE(PortLock::take(port(can + "u")));
}

}  // namespace
}  // namespace berth::cli

// What systemd hears of a service: sd_notify(3), as a socket of this test reads it.
#include "berth/io/service_manager.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>

using namespace berth;

namespace {

namespace fs = std::filesystem;

// The manager's end. `name` as in NOTIFY_SOCKET.
class Manager {
 public:
  explicit Manager(const std::string& name) : fd_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
    sockaddr_un at{};
    at.sun_family = AF_UNIX;
    std::memcpy(at.sun_path, name.data(), name.size());
    if (name[0] == '@') at.sun_path[0] = '\0';
    const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&at), length), 0) << std::strerror(errno);
    ::setenv("NOTIFY_SOCKET", name.c_str(), 1);
  }
  ~Manager() {
    ::close(fd_);
    for (const char* const variable : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) ::unsetenv(variable);
  }
  Manager(const Manager&) = delete;
  Manager& operator=(const Manager&) = delete;
  // Empty: nothing came.
  [[nodiscard]] std::string hears() const {
    std::array<char, 512> bytes{};
    const auto count = ::recv(fd_, bytes.data(), bytes.size(), 0);
    return count < 0 ? std::string() : std::string(bytes.data(), static_cast<std::size_t>(count));
  }

 private:
  int fd_;
};

std::string own_name(const char* what) { return std::string(what) + std::to_string(::getpid()); }

}  // namespace

TEST(ServiceManager, HearsWhatIsToldAtAnAbstractAddressAndAtAFile) {
  for (const std::string& name : {own_name("@berth-notify-"), own_name("/tmp/berth-notify-")}) {
    {
      const Manager manager(name);
      const auto service = io::ServiceManager::of_environment();
      ASSERT_TRUE(service) << name;
      EXPECT_TRUE(service->tell("READY=1\nSTATUS=5 of 5 slots operational"));
      EXPECT_EQ(manager.hears(), "READY=1\nSTATUS=5 of 5 slots operational");
      EXPECT_TRUE(service->tell_reloading());
      const std::string reload = manager.hears();
      EXPECT_EQ(reload.substr(0, 27), "RELOADING=1\nMONOTONIC_USEC=");
      EXPECT_GT(std::stoll(reload.substr(27)), 0);
    }
    fs::remove(name);
  }
}

// A program that this one starts must not say that it is ready.
TEST(ServiceManager, TheEnvironmentIsTakenOnce) {
  const Manager manager(own_name("@berth-notify-"));
  ::setenv("WATCHDOG_USEC", "5000000", 1);
  ::setenv("WATCHDOG_PID", std::to_string(::getpid()).c_str(), 1);
  const auto service = io::ServiceManager::of_environment();
  ASSERT_TRUE(service);
  EXPECT_EQ(service->watchdog(), std::chrono::seconds(5));
  for (const char* const variable : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) {
    EXPECT_EQ(std::getenv(variable), nullptr) << variable;
  }
  EXPECT_FALSE(io::ServiceManager::of_environment());
}

TEST(ServiceManager, AWatchdogOfAnotherProcessAndNonsenseAreNone) {
  for (const auto& [period, process] : {std::pair("5000000", "1"), {"0", ""}, {"-5", ""}, {"5s", ""}, {"", ""}}) {
    const Manager manager(own_name("@berth-notify-"));
    ::setenv("WATCHDOG_USEC", period, 1);
    ::setenv("WATCHDOG_PID", process, 1);
    const auto service = io::ServiceManager::of_environment();
    ASSERT_TRUE(service);
    EXPECT_FALSE(service->watchdog()) << period << " " << process;
  }
}

TEST(ServiceManager, AnAddressThatIsNoneIsNoManager) {
  const std::string longest = "/" + std::string(sizeof(sockaddr_un::sun_path) - 1, 'x');
  for (const std::string& address : {std::string(), std::string("@"), std::string("relative"), longest}) {
    ::setenv("NOTIFY_SOCKET", address.c_str(), 1);
    EXPECT_FALSE(io::ServiceManager::of_environment()) << address;
  }
}

// It is gone, or does not read: the bus does not wait for it.
TEST(ServiceManager, OneThatDoesNotReadDelaysNothing) {
  std::optional<io::ServiceManager> service;
  {
    const Manager manager(own_name("@berth-notify-"));
    service.emplace(*io::ServiceManager::of_environment());
    bool all = true;
    for (int i = 0; i < 10'000 && all; ++i) all = service->tell("WATCHDOG=1");
    EXPECT_FALSE(all) << "its queue has an end";
  }
  EXPECT_FALSE(service->tell("WATCHDOG=1"));
}

TEST(ServiceManager, AStatusIsOneLine) {
  EXPECT_EQ(io::status_line("slot \"a\nREADY=1\x7F\" waits"), "slot \"a READY=1 \" waits");
}

TEST(ServiceManager, AStreamOfTheJournalIsKnownByItsInode) {
  struct stat there {};
  ASSERT_EQ(::fstat(STDERR_FILENO, &there), 0);
  const auto stream = [](auto device, auto inode) { return std::to_string(device) + ":" + std::to_string(inode); };
  ::unsetenv("JOURNAL_STREAM");
  EXPECT_FALSE(io::is_journal(STDERR_FILENO));
  ::setenv("JOURNAL_STREAM", stream(there.st_dev, there.st_ino).c_str(), 1);
  EXPECT_TRUE(io::is_journal(STDERR_FILENO));
  ::setenv("JOURNAL_STREAM", stream(there.st_dev, there.st_ino + 1).c_str(), 1);
  EXPECT_FALSE(io::is_journal(STDERR_FILENO));
  ::setenv("JOURNAL_STREAM", "nonsense", 1);
  EXPECT_FALSE(io::is_journal(STDERR_FILENO));
  ::unsetenv("JOURNAL_STREAM");
}

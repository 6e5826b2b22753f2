// `berth gateway` and `berth up --gateway` in processes of their own, and a script before them.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>
#include <string>

#include <array>
#include <chrono>
#include <nlohmann/json.hpp>
#include <sstream>

#include "berth/io/stream.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using namespace std::chrono_literals;

io::Endpoint free_port() {
  const int fd = io::listen_tcp({"127.0.0.1", 0}).value();
  const auto where = *io::local_endpoint(fd);
  ::close(fd);
  return where;
}

/// Says lines and takes lines, as a script does.
class Script {
 public:
  explicit Script(const io::Endpoint& where) {
    const auto address = io::look_up(where).value().front();
    const bool there = eventually([&] {
      const int fd = io::begin_connect(address);
      pollfd wait{fd, POLLOUT, 0};
      if (fd >= 0) ::poll(&wait, 1, 1000);
      if (fd >= 0 && io::connect_error(fd) == 0) {
        fd_ = fd;
      } else if (fd >= 0) {
        ::close(fd);
      }
      return fd_ >= 0;
    });
    EXPECT_TRUE(there) << "no server";
  }
  ~Script() {
    if (fd_ >= 0) ::close(fd_);
  }
  Script(const Script&) = delete;
  Script& operator=(const Script&) = delete;

  void say(const std::string& line) {
    const auto text = line + "\n";
    EXPECT_EQ(::send(fd_, text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
  }
  /// The next reply; indications are passed over. Empty: none within a minute.
  std::string reply() {
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (std::chrono::steady_clock::now() < end) {
      if (const auto at = text_.find("\r\n"); at != std::string::npos) {
        const auto line = text_.substr(0, at);
        text_.erase(0, at + 2);
        if (line.starts_with('[')) return line;
        continue;
      }
      pollfd wait{fd_, POLLIN, 0};
      ::poll(&wait, 1, 100);
      std::array<char, 4096> buffer;
      const auto n = ::recv(fd_, buffer.data(), buffer.size(), MSG_DONTWAIT);
      if (n > 0) text_.append(buffer.data(), static_cast<std::size_t>(n));
      if (n == 0) return {};
    }
    return {};
  }
  std::string ask(const std::string& line) {
    say(line);
    return reply();
  }

 private:
  int fd_ = -1;
  std::string text_;
};

TEST(Gateway, APlantByLinesOverTcp) {
  const auto where = free_port();
  Background gateway({"gateway", example("five-slaves.toml"), "--sim", example("five-slaves.plant.toml"), "--listen",
                      io::to_string(where), "--json"});
  Script script(where);
  EXPECT_EQ(script.ask("[1] set network 1"), "[1] OK");
  EXPECT_EQ(script.ask("[2] set network 2"), "[2] ERROR:106");
  std::string answer;
  const bool identified = eventually([&] {
    answer = script.ask("[3] lss_ident_nonconf");
    return answer == "[3] OK";
  });
  EXPECT_TRUE(identified) << "blank devices, when they have booted: " << answer;
  EXPECT_EQ(script.ask("[4] lss_store now"), "[4] ERROR:101");
  gateway.signal(SIGTERM);
  const auto end = gateway.end();
  EXPECT_EQ(end.status, 0) << end.err;
  std::istringstream lines(end.out);
  std::string line;
  ASSERT_TRUE(std::getline(lines, line));
  EXPECT_EQ(nlohmann::json::parse(line).value("listening", ""), io::to_string(where));
  while (std::getline(lines, line)) EXPECT_TRUE(nlohmann::json::parse(line).is_object()) << line;
}

TEST(Gateway, BesideTheMainJob) {
  const auto where = free_port();
  const Folder folder;
  Background up({"up", example("five-slaves.toml"), "--sim", example("five-slaves.plant.toml"), "--gateway",
                 io::to_string(where), "--control", folder.file("control")});
  Script script(where);
  std::string answer;
  const bool seated = eventually([&] {
    answer = script.ask("[1] 1 1 read 0x1018 4 u32");
    return answer == "[1] 10";
  });
  EXPECT_TRUE(seated) << "serial number 0Ah sits in slot 1: " << answer;
  up.signal(SIGTERM);
  const auto end = up.end();
  EXPECT_NE(end.out.find("CiA 309-3 gateway at " + io::to_string(where)), std::string::npos) << end.out << end.err;
}

TEST(Gateway, WrongUse) {
  const auto machine = example("five-slaves.toml");
  const auto plant = example("five-slaves.plant.toml");
  EXPECT_EQ(berth({"gateway"}).status, 2);
  EXPECT_EQ(berth({"gateway", machine, "--sim", plant, "--listen", "nowhere:99999"}).status, 2);
  EXPECT_EQ(berth({"gateway", machine, "--sim", plant, "--for", "soon"}).status, 2);
  EXPECT_EQ(berth({"up", machine, "--sim", plant, "--gateway", "127.0.0.1:0", "--fast"}).status, 2);
  const int taken = io::listen_tcp({"127.0.0.1", 0}).value();
  const auto where = io::to_string(*io::local_endpoint(taken));
  const auto refused = berth({"gateway", machine, "--sim", plant, "--listen", where});
  EXPECT_EQ(refused.status, 3);
  EXPECT_NE(refused.err.find(where), std::string::npos) << refused.err;
  ::close(taken);
}

}  // namespace
}  // namespace berth::test

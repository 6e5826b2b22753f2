/// Commands to a `berth up` of the small machine that runs, in real time, in a process of its own.
#pragma once

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <sstream>
#include <string>

#include "command_fixture.hpp"

namespace berth::test {

class Running : public Command {
 protected:
  void begin(const std::string& plant_file) {
    up_ = std::make_unique<Background>(Words{"up", machine, "--sim", plant_file, "--pace", "--control", socket});
    ASSERT_TRUE(wait_for("left", "operational"));
  }
  /// Every slot operational: what `status` ends with 0 for.
  [[nodiscard]] bool all_operational() const {
    return eventually([&] { return ask({"status"}).status == 0; });
  }
  [[nodiscard]] Outcome ask(Words words) const {
    words.insert(words.end(), {"--control", socket, "--json"});
    return berth(words);
  }
  [[nodiscard]] bool wait_for(const std::string& slot, const std::string& state) const {
    return eventually([&] {
      const Outcome outcome = ask({"status"});
      if (outcome.status > 1) return false;  // 1: a slot is not operational
      const Json slots = Json::parse(outcome.out).at("slots");
      return std::ranges::any_of(slots, [&](const Json& s) { return s.at("name") == slot && s.at("state") == state; });
    });
  }
  /// A connection of the control socket's own, without a process of Berth.
  [[nodiscard]] int connected() const {
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    socket.copy(address.sun_path, sizeof address.sun_path - 1);
    EXPECT_EQ(::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    const timeval patience{60, 0};  // for an answer that never comes; no figure of the product
    EXPECT_EQ(::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience), 0);
    return fd;
  }
  static void put(int fd, const std::string& text) {
    EXPECT_EQ(::send(fd, text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
  }
  /// Up to the end of the line, or of the connection.
  static std::string take(int fd) {
    std::string answer;
    char c = 0;
    while (!answer.ends_with('\n') && ::recv(fd, &c, 1, 0) == 1) answer += c;
    return answer;
  }
  /// That the running process has used.
  [[nodiscard]] double processor_seconds() const {
    std::istringstream words(contents("/proc/" + std::to_string(up_->pid()) + "/stat"));
    std::string word;
    for (int i = 0; i < 13; ++i) words >> word;
    double user = 0, system = 0;
    words >> user >> system;
    return (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  }
  std::string socket = folder.file("up.sock");
  std::unique_ptr<Background> up_;
};

}  // namespace berth::test

/// Debian's Mosquitto, with a configuration of the test's own, on a free port of 127.0.0.1; started and ended by the
/// test. A test that uses it begins with NEEDS_BROKER().
#pragma once

#include <arpa/inet.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>

#include "berth/mqtt/where.hpp"
#include "folder.hpp"
#include "process.hpp"

namespace berth::mqtt::test {

inline constexpr std::chrono::seconds patience{90};  // how long a test waits for what must come

inline sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

inline bool name_socket(int (*how)(int, const sockaddr*, socklen_t), int fd, std::uint16_t port) {
  const auto address = loopback(port);
  const void* const plain = &address;
  return how(fd, static_cast<const sockaddr*>(plain), sizeof address) == 0;
}

inline std::uint16_t port_of(int fd) {
  sockaddr_in address{};
  socklen_t size = sizeof address;
  void* const plain = &address;
  return ::getsockname(fd, static_cast<sockaddr*>(plain), &size) == 0 ? ntohs(address.sin_port) : std::uint16_t{0};
}

inline std::uint16_t free_port() {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const std::uint16_t port = name_socket(::bind, fd, 0) ? port_of(fd) : std::uint16_t{0};
  ::close(fd);
  return port;
}

inline bool listens(std::uint16_t port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const bool connected = name_socket(::connect, fd, port);
  ::close(fd);
  return connected;
}

class Broker {
 public:
  /// Where the program is; empty: it is not installed. It is for administrators, whose folders others do not search.
  static std::string program() {
    std::string folders = std::getenv("PATH") == nullptr ? "" : std::getenv("PATH");
    folders += ":/usr/sbin:/usr/local/sbin";
    std::istringstream each(folders);
    for (std::string folder; std::getline(each, folder, ':');) {
      const auto path = folder + "/mosquitto";
      if (::access(path.c_str(), X_OK) == 0 && std::filesystem::is_regular_file(path)) return path;
    }
    return {};
  }

  /// `listener`: more lines for its listener; allow_anonymous is true unless it says something else.
  explicit Broker(std::string listener = "") : listener_(std::move(listener)), port_(free_port()) { start(); }
  Broker(const Broker&) = delete;
  Broker& operator=(const Broker&) = delete;

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] Where where(bool tls = false, const std::string& host = "127.0.0.1") const {
    return {tls, host, port_};
  }
  [[nodiscard]] const Folder& folder() const { return folder_; }
  [[nodiscard]] std::string log() const { return folder_.read("log"); }

  void start() {
    std::string text = fmt::format("listener {} 127.0.0.1\n", port_);
    if (listener_.find("allow_anonymous") == std::string::npos) text += "allow_anonymous true\n";
    text += listener_ + "\npersistence false\nlog_type all\nlog_dest stderr\nmax_queued_messages 10000\n";
    if (::geteuid() == 0) text += "user root\n";  // another user could not read the folder
    const auto config = folder_.write("broker.conf", text);
    process_ = Process({program(), "-c", config}, folder_.file("log"));
    const auto end = std::chrono::steady_clock::now() + patience;
    while (!listens(port_) && process_.is_running() && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    ASSERT_TRUE(listens(port_)) << log();
  }
  void stop() { process_.end(SIGTERM); }
  void kill() { process_.end(SIGKILL); }
  /// It keeps its connections, and neither reads nor answers.
  void freeze() const { process_.signal(SIGSTOP); }
  void thaw() const { process_.signal(SIGCONT); }

 private:
  Folder folder_;
  std::string listener_;
  std::uint16_t port_;
  Process process_;
};

}  // namespace berth::mqtt::test

#define NEEDS_BROKER() \
  if (::berth::mqtt::test::Broker::program().empty()) GTEST_SKIP() << "needs mqtt: mosquitto is not installed"

/// CAN interfaces for tests, in a machine that has them: `tools/vm -- build/test/tests/test_vm`.
#pragma once

#include <gtest/gtest.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <thread>

#include "berth/can/port.hpp"
#include "berth/io/loop.hpp"

namespace berth::test {

/// Why a test of this interface cannot be here; empty when it can.
inline std::string no_interface(const char* name) {
  const int fd = ::socket(PF_CAN, SOCK_RAW, 1);
  if (fd < 0) return std::string("no SocketCAN here: ") + std::strerror(errno) + "; run it by ./run vm";
  ::close(fd);
  if (::if_nametoindex(name) == 0) return std::string("no interface ") + name + " here; run it by ./run vm";
  if (::geteuid() != 0) return "not root, and interfaces are to be changed; run it by ./run vm";
  return {};
}

inline bool shell(const std::string& command) { return std::system(command.c_str()) == 0; }

/// Waits until the kernel says that it runs. A controller or a serial adapter that was just set up does so when a
/// worker of the kernel's comes to it, which on a busy machine is long after `ip` has ended.
inline bool runs(const std::string& name) {
  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(120);
  ifreq request{};
  name.copy(static_cast<char*>(request.ifr_name), IFNAMSIZ - 1);
  const auto told = [&] {
    return ::ioctl(fd, SIOCGIFFLAGS, &request) == 0 && (request.ifr_flags & IFF_UP) != 0 &&
           (request.ifr_flags & IFF_RUNNING) != 0;
  };
  while (!told() && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));  // between two looks
  }
  const bool so = told();
  ::close(fd);
  return so;
}

/// A vcan interface of its own for as long as it lives.
class Vcan {
 public:
  explicit Vcan(std::string name) : name_(std::move(name)) { make(); }
  ~Vcan() { drop(); }
  Vcan(const Vcan&) = delete;
  Vcan& operator=(const Vcan&) = delete;
  void make() { shell("ip link add dev " + name_ + " type vcan && ip link set " + name_ + " mtu 72 up"); }
  void drop() { shell("ip link del dev " + name_ + " 2>/dev/null"); }
  void up() { shell("ip link set " + name_ + " up"); }
  void down() { shell("ip link set " + name_ + " down"); }
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  std::string name_;
};

/// Turns the loop until something holds, or so much time has passed that it never will.
inline bool until(io::Loop& loop, const std::function<bool()>& holds,
                  std::chrono::seconds most = std::chrono::seconds(120)) {
  const auto end = std::chrono::steady_clock::now() + most;
  while (!holds()) {
    if (std::chrono::steady_clock::now() >= end) return false;
    loop.turn(std::chrono::milliseconds(20));
  }
  return true;
}

/// Turns the loop for so long: for what must not happen, where the time is the subject. Never for what must: see
/// `until`.
inline void idle(io::Loop& loop, std::chrono::milliseconds time) {
  const auto end = std::chrono::steady_clock::now() + time;
  while (std::chrono::steady_clock::now() < end) loop.turn(std::chrono::milliseconds(10));
}

}  // namespace berth::test

/// One process owns a real port.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>

#include "berth/can/port_spec.hpp"
#include "output.hpp"

namespace berth::cli {

/// Held while it exists, and gone with the process however it ends. It is a name of the kernel's (an abstract Unix
/// socket), so it leaves no file and does not depend on the environment: processes of all users agree on it. Such names
/// belong to a network namespace, as CAN interfaces do: two containers share a name exactly when they share the
/// interface. A serial adapter that containers share without their network is locked by the device itself
/// (`io::SlcanPort`: flock, TIOCEXCL). Not for ports that give each user a node of its own (`plant:`).
class PortLock {
 public:
  /// Refused with the process that has it, and its user when that is another one. Any user can take a name; for a
  /// serial adapter only a process of this user or of root is believed, because the device's own lock decides there.
  [[nodiscard]] static tl::expected<PortLock, Failure> take(const can::PortSpec& port);
  PortLock(PortLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  PortLock& operator=(PortLock&&) = delete;
  ~PortLock();

 private:
  explicit PortLock(int fd) noexcept : fd_(fd) {}
  int fd_;  // -1: another user's process has the name, and the device decides
};

}  // namespace berth::cli

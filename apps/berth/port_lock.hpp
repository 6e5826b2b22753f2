/// Lets only one process own a real port.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>

#include "berth/can/port_spec.hpp"
#include "output.hpp"

namespace berth::cli {

/// Held while it exists; the kernel frees it when the process ends in any way. It is an abstract Unix socket: it leaves
/// no file and does not depend on the environment, so it works between processes of all users. Such names belong to a
/// network namespace, as CAN interfaces do: two containers share a name exactly when they share the interface. For a
/// serial adapter that containers share without their network, the device itself is the lock (`io::SlcanPort`: flock,
/// TIOCEXCL). Not for ports that give each user its own node (`plant:`).
class PortLock {
 public:
  /// Refused if another process holds it; the failure names the process, and its user if it is another user. Any user
  /// can take a name. So for a serial adapter only a process of this user or of root counts, because there the device's
  /// own lock decides.
  [[nodiscard]] static tl::expected<PortLock, Failure> take(const can::PortSpec& port);
  PortLock(PortLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  PortLock& operator=(PortLock&&) = delete;
  ~PortLock();

 private:
  explicit PortLock(int fd) noexcept : fd_(fd) {}
  int fd_;  // -1: another user's process has the name; the device's lock decides
};

}  // namespace berth::cli

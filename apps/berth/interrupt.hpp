/// SIGINT and SIGTERM, so that a command ends in words and with its own exit status.
#pragma once

#include <signal.h>

#include <chrono>
#include <functional>
#include <optional>

namespace berth::cli {

/// Both signals as a descriptor. While it lives neither ends the process by itself: what waits looks at `came`, what
/// computes in a library asks `ended_by`. One at a time: a signal is told to one alone.
class Interrupt {
 public:
  Interrupt();
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  [[nodiscard]] int descriptor() const noexcept { return fd_; }
  /// True once a signal came.
  [[nodiscard]] bool came() noexcept;

 private:
  sigset_t before_{};
  int fd_ = -1;
  bool came_ = false;
};

/// True when SIGINT or SIGTERM waits to be taken, or `after` is over from now on: what ends a call that takes long.
/// There must be an `Interrupt`.
[[nodiscard]] std::function<bool()> ended_by(std::optional<std::chrono::nanoseconds> after);

}  // namespace berth::cli

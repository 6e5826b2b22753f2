/// Ctrl-C and SIGTERM, and waiting that ends by them: the one way in which a command waits.
///
///     Interrupt interrupt(rig.loop());
///     const bool done = wait_until(rig.driver(), interrupt, [&] { return over; }, 5min);
#pragma once

#include <chrono>
#include <functional>
#include <optional>

#include "berth/io/loop.hpp"
#include "berth/rt/driver.hpp"

namespace berth::cli {

/// Signals as a descriptor, so that a run ends cleanly. One at a time.
class Interrupt final : private io::Watcher {
 public:
  /// A signal ends a sleep of `loop`, which must stay; null: nothing sleeps.
  explicit Interrupt(io::Loop* loop = nullptr);
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  /// For who waits by other means than a loop.
  [[nodiscard]] int descriptor() const noexcept { return fd_; }
  /// True once a signal came.
  [[nodiscard]] bool came() noexcept;
  /// The same, a little late where it would cost a system call: may be asked after each instant.
  [[nodiscard]] bool noticed() noexcept;

 private:
  void ready(std::uint32_t events) noexcept override;
  io::Loop* loop_;
  int fd_ = -1;
  unsigned asked_ = 0;
  bool came_ = false;
};

/// Runs until `over()` is true, `most` went by or a signal came; gives what `over()` says then.
bool wait_until(rt::Driver& driver, Interrupt& interrupt, const rt::Driver::Predicate& over, rt::Duration most);
/// Runs for `time`, or until a signal came.
void wait_for(rt::Driver& driver, Interrupt& interrupt, rt::Duration time);

/// True when SIGINT or SIGTERM waits to be taken, or `after` is over from now on: what ends a call that takes long.
[[nodiscard]] std::function<bool()> ended_by(std::optional<std::chrono::nanoseconds> after);

}  // namespace berth::cli

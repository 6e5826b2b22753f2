/// SIGINT, SIGTERM, SIGHUP and an output that is gone, so that a command ends in words and with its own exit status;
/// and waiting that ends by them: the one way in which a command waits.
///
///     const bool done = wait_until(run.driver(), run.interrupt(), [&] { return over; }, 5min);
#pragma once

#include <signal.h>

#include <chrono>
#include <functional>
#include <optional>

#include "berth/io/loop.hpp"
#include "berth/rt/driver.hpp"

namespace berth::cli {

/// These signals as a descriptor. While it lives none ends the process by itself: what waits looks at `came` or waits
/// by `wait_until`, what computes in a library asks `ended_by`. One at a time: a signal is told to one alone.
class Interrupt final : private io::Watcher {
 public:
  /// A signal ends a sleep of `loop`, which must stay; null: nothing sleeps in a loop.
  explicit Interrupt(io::Loop* loop = nullptr);
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  /// For what waits by other means than a loop. Once `came` it tells no more of that signal.
  [[nodiscard]] int descriptor() const noexcept { return fd_; }
  /// True once a signal came.
  [[nodiscard]] bool came() noexcept;
  /// The same, a little late where it would cost a system call: may be asked after each instant.
  [[nodiscard]] bool noticed() noexcept;

 private:
  void ready(std::uint32_t events) noexcept override;
  io::Loop* loop_;
  sigset_t before_{};
  int fd_ = -1;
  unsigned asked_ = 0;
  bool came_ = false;
};

/// Runs until `over()` is true, `most` went by or a signal came; gives what `over()` says then.
bool wait_until(rt::Driver& driver, Interrupt& interrupt, const rt::Driver::Predicate& over, rt::Duration most);
/// Runs for `time`, or until a signal came.
void wait_for(rt::Driver& driver, Interrupt& interrupt, rt::Duration time);

/// True when such a signal waits to be taken, or the run must end (`run_must_end`): what ends a call that takes long.
/// There must be an `Interrupt`, and its loop must not turn meanwhile.
[[nodiscard]] bool is_ending() noexcept;
/// The same, or `after` is over from now on.
[[nodiscard]] std::function<bool()> ended_by(std::optional<std::chrono::nanoseconds> after);

}  // namespace berth::cli

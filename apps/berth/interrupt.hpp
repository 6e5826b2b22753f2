/// SIGINT, SIGTERM, SIGHUP and a closed output end a command with a message and its own exit status. `wait_until`,
/// which they end, is the only way in which a command waits:
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

/// These signals as a descriptor. While it exists, none of them ends the process by itself: code that waits uses `came`
/// or `wait_until`; a long computation in a library asks `ended_by`. Only one may exist at a time, because a signal is
/// delivered once.
class Interrupt final : private io::Watcher {
 public:
  /// A signal ends a sleep of `loop`, which must outlive it; null: nothing sleeps in a loop.
  explicit Interrupt(io::Loop* loop = nullptr);
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  /// For code that waits without a loop. Once `came` is true it no longer reports that signal.
  [[nodiscard]] int descriptor() const noexcept { return fd_; }
  /// True once a signal came.
  [[nodiscard]] bool came() noexcept;
  /// SIGHUP no longer ends the command: it calls `reload`, in the loop; empty: it ends it again. A service manager asks
  /// so for a new reading of files (systemd.service(5), ExecReload).
  void reload_by(std::function<void()> reload);
  /// The same, slightly later if that saves a system call: may be asked after each instant.
  [[nodiscard]] bool noticed() noexcept;

 private:
  void ready(std::uint32_t events) noexcept override;
  [[nodiscard]] bool take_signal() noexcept;
  io::Loop* loop_;
  std::function<void()> reload_;
  sigset_t before_{};
  int fd_ = -1;
  unsigned asked_ = 0;
  bool came_ = false;
};

/// Runs until `over()` is true, `most` has passed or a signal came. Returns the last `over()`.
bool wait_until(rt::Driver& driver, Interrupt& interrupt, const rt::Driver::Predicate& over, rt::Duration most);
/// Runs for `time`, or until a signal came.
void wait_for(rt::Driver& driver, Interrupt& interrupt, rt::Duration time);

/// True when such a signal is pending, or the run must end (`run_must_end`): then a long call ends. There must be an
/// `Interrupt`, and its loop must not turn meanwhile.
[[nodiscard]] bool is_ending() noexcept;
/// The same, or `after` has passed, counted from now.
[[nodiscard]] std::function<bool()> ended_by(std::optional<std::chrono::nanoseconds> after);

}  // namespace berth::cli

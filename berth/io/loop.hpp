/// Drives an `rt::Executor` in real time: a level-triggered epoll loop. World time is the executor's time when the loop
/// was made, plus CLOCK_MONOTONIC since then.
///
///     io::Loop loop(executor);
///     loop.watch(fd, watcher);
///     while (!over) loop.turn(50ms);
///
/// A wait costs one system call, and one reading of the clock: the alarm (a timerfd) is moved only when it would come
/// too late. Before a timer runs, the descriptors are checked once more: data that came before the timer was due is
/// read first, however long the process was held up. `most` of a turn counts from the end of the turn before.
///
/// One thread. Watchers are called between jobs, never inside one; jobs that they make ready run in the same turn.
#pragma once

#include <sys/epoll.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <vector>

#include "berth/rt/executor.hpp"

namespace berth::io {

/// Called when a descriptor can be read or written, or its peer is gone (EPOLLHUP, EPOLLERR are always reported).
class Watcher {
 public:
  /// `events` as in epoll(7). Level-triggered: called again until the cause is gone. May watch and forget any
  /// descriptor, including its own.
  virtual void ready(std::uint32_t events) noexcept = 0;

 protected:
  ~Watcher() = default;
};

class Loop {
 public:
  explicit Loop(rt::Executor& executor);
  ~Loop();
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  /// False when the system refused the descriptors for epoll or the alarm; then nothing else works.
  [[nodiscard]] bool good() const noexcept { return epoll_ >= 0 && alarm_ >= 0; }
  [[nodiscard]] rt::Executor& executor() const noexcept { return *executor_; }
  /// The current world time by the clock; never before the executor's.
  [[nodiscard]] rt::Time clock() const noexcept;
  /// The clock at the end of the last wait: in a watcher, when it was woken. Costs nothing.
  [[nodiscard]] rt::Time woke() const noexcept { return woke_; }

  /// Calls `watcher` when `fd` has one of `events` (EPOLLIN, EPOLLOUT); watched already: changes both. The watcher must
  /// stay until `forget`. False: the system refused.
  bool watch(int fd, Watcher& watcher, std::uint32_t events);
  /// Call before `fd` is closed. Does nothing when it is not watched.
  void forget(int fd) noexcept;

  /// Call in a watcher: events after `at` may not all be read yet. The turn ends at `at`, so that no later timer runs
  /// before them: heartbeats waiting in a socket of a process that was held up still count as in time.
  void hold(rt::Time at) noexcept { held_ = std::min(held_, at); }

  /// Only for a simulated world paced by the loop (not for a loop of real ports): world time passes `factor` times as
  /// fast as the clock. If that is faster than it can be computed, it runs as fast as possible. No instant is skipped.
  void set_speed(double factor) noexcept;
  [[nodiscard]] double speed() const noexcept { return speed_; }
  /// Also for a simulated world: world time stops, at the instant of the calling job, until `pause(false)`. Ready jobs
  /// still run and descriptors are still watched, so that questions are answered; timers wait.
  void pause(bool on) noexcept;
  [[nodiscard]] bool paused() const noexcept { return paused_; }
  /// While paused: runs the work of the earliest instants, one after another, until `over()` is true, checked after
  /// each, or none is left up to `limit`. From a watcher or between two turns, never inside a job.
  template <class Predicate>
  bool step_until(Predicate over, rt::Time limit) {
    bool done = false;
    while (!(done = over()) && executor_->step(limit)) {
    }
    begin_at(executor_->now());
    return done;
  }

  /// Sleeps until the executor's next work, a descriptor, or for `most`; then does the work.
  void turn(rt::Duration most);
  /// Does all work that needs no sleep: descriptors that are ready, then the executor up to the clock.
  void serve() { turn(rt::Duration{0}); }

 private:
  struct Watched {
    int fd;
    Watcher* watcher;
  };
  int collect(int patience_ms) noexcept;
  bool wait(bool sleep) noexcept;
  void set_alarm(rt::Time at) noexcept;
  void arm(std::chrono::nanoseconds since_boot) noexcept;
  void begin_at(rt::Time world) noexcept;
  void keep_up() noexcept;
  void stand(rt::Duration most);
  void run(rt::Duration most);
  void advance(rt::Time until) noexcept;
  [[nodiscard]] Watcher* watcher_of(int fd) const noexcept;

  rt::Executor* executor_;
  int epoll_;
  int alarm_;
  rt::Time began_;
  std::chrono::steady_clock::time_point real_;
  rt::Time woke_;
  double speed_ = 1;
  bool paused_ = false;
  rt::Time held_ = rt::never;            // in this turn
  rt::Time alarm_at_ = rt::Time::min();  // in the past: it has gone off, or was never set
  std::vector<Watched> watched_;
  std::vector<epoll_event> events_;  // of the last wait
};

}  // namespace berth::io

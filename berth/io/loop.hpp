/// Drives an `rt::Executor` in real time: a level-triggered epoll loop. World time is CLOCK_MONOTONIC since the loop
/// was made, added to what the executor's time was then.
///
///     io::Loop loop(executor);
///     loop.watch(fd, watcher);
///     while (!over) loop.turn(50ms);
///
/// A wait costs one system call, and one reading of the clock: the alarm (a timerfd) is moved only when it would come
/// too late. Before a timer runs, the descriptors are looked at once more: what came before it was due is read first,
/// however long the process had no time to. `most` of a turn counts from the end of the turn before.
///
/// One thread. Watchers are called between jobs, never from inside one; what they make ready runs in the same turn.
#pragma once

#include <sys/epoll.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <vector>

#include "berth/rt/executor.hpp"

namespace berth::io {

/// Told when a descriptor can be read or written, or its peer is gone (EPOLLHUP, EPOLLERR come unasked).
class Watcher {
 public:
  /// `events` as by epoll(7). Level-triggered: it is called again until the cause is gone. May watch and forget any
  /// descriptor, its own too.
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

  /// False when the system refused to make the descriptors of epoll and of the alarm; then nothing else works.
  [[nodiscard]] bool good() const noexcept { return epoll_ >= 0 && alarm_ >= 0; }
  [[nodiscard]] rt::Executor& executor() const noexcept { return *executor_; }
  /// The time that it is in the world by the clock; never before the executor's.
  [[nodiscard]] rt::Time clock() const noexcept;
  /// What the clock said when the last wait ended: in a watcher, when it was woken. Costs nothing.
  [[nodiscard]] rt::Time woke() const noexcept { return woke_; }

  /// Calls `watcher` when `fd` has one of `events` (EPOLLIN, EPOLLOUT); watched already: changes both. The watcher must
  /// stay until `forget`. False: the system refused.
  bool watch(int fd, Watcher& watcher, std::uint32_t events);
  /// Before `fd` is closed. Nothing happens when it is not watched.
  void forget(int fd) noexcept;

  /// In a watcher: what happened after `at` may not all be read. This turn ends there, so that no timer that was due
  /// later runs before it: heartbeats that wait in a socket of a process that was held up are in time.
  void hold(rt::Time at) noexcept { held_ = std::min(held_, at); }

  /// Of a simulated world that the loop paces (a loop of real ports is left alone): world time passes `factor` times as
  /// fast as the clock's. When it is faster than it can be computed, it is as fast as it can. No instant is left out.
  void set_speed(double factor) noexcept;
  [[nodiscard]] double speed() const noexcept { return speed_; }
  /// The same: world time stands, at the instant of the job that says so, up to `pause(false)`. What is ready is still
  /// done and descriptors are watched, so that who asks is answered; what waits for a time waits.
  void pause(bool on) noexcept;
  [[nodiscard]] bool paused() const noexcept { return paused_; }
  /// While it stands: does the work of the earliest instants, one after another, until `over()` is true, looked at
  /// after each, or none is left up to `limit`. From a watcher or between two turns, never from inside a job.
  template <class Predicate>
  bool step_until(Predicate over, rt::Time limit) {
    bool done = false;
    while (!(done = over()) && executor_->step(limit)) {
    }
    begin_at(executor_->now());
    return done;
  }

  /// Sleeps until the executor's next work, a descriptor, or for `most`; then does what is to be done.
  void turn(rt::Duration most);
  /// What can be done without sleeping: descriptors that are ready, then the executor up to the clock.
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
  rt::Time held_ = rt::never;            // of this turn
  rt::Time alarm_at_ = rt::Time::min();  // in the past: it has gone off, or was never set
  std::vector<Watched> watched_;
  std::vector<epoll_event> events_;  // of the last wait
};

}  // namespace berth::io

/// Drives an `rt::Executor` in real time: a level-triggered epoll loop. World time is CLOCK_MONOTONIC since the loop
/// was made, added to what the executor's time was then.
///
///     io::Loop loop(executor);
///     loop.watch(fd, watcher);
///     while (!over) loop.turn(50ms);
///
/// One thread. Watchers are called between jobs, never from inside one; what they make ready runs in the same turn.
#pragma once

#include <sys/epoll.h>

#include <chrono>
#include <cstdint>
#include <span>
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

namespace detail {
/// What epoll_pwait2(2) does, for kernels before 5.11 that have it not.
int wait_by_poll(int epoll, std::span<epoll_event> events, rt::Duration most) noexcept;
}  // namespace detail

class Loop {
 public:
  explicit Loop(rt::Executor& executor);
  ~Loop();
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  /// False when the system refused to make or use the epoll descriptor; then nothing else works.
  [[nodiscard]] bool good() const noexcept { return epoll_ >= 0; }
  [[nodiscard]] rt::Executor& executor() const noexcept { return *executor_; }
  /// The time that it is in the world by the clock; never before the executor's.
  [[nodiscard]] rt::Time clock() const noexcept;

  /// Calls `watcher` when `fd` has one of `events` (EPOLLIN, EPOLLOUT); watched already: changes both. The watcher must
  /// stay until `forget`. False: the system refused.
  bool watch(int fd, Watcher& watcher, std::uint32_t events);
  /// Before `fd` is closed. Nothing happens when it is not watched.
  void forget(int fd) noexcept;

  /// Sleeps until the executor's next work, a descriptor, or `most` from now; then does what is to be done.
  void turn(rt::Duration most);
  /// What can be done without sleeping: descriptors that are ready, then the executor up to the clock.
  void serve() { turn(rt::Duration{0}); }
  /// Calls the watchers of descriptors that are ready, without sleeping, for a driver that runs the executor by
  /// `clock()` itself. Before that the executor's time comes up to the clock, or just before its next timer when that
  /// is overdue: what came in while the process slept counts before the timeout.
  void poll() noexcept { wait(rt::Duration{0}); }
  /// Readable while a watched descriptor is ready: to wait for it in a poll of somebody else's.
  [[nodiscard]] int descriptor() const noexcept { return epoll_; }

 private:
  struct Watched {
    int fd;
    Watcher* watcher;
  };
  /// False: nothing came in all that time.
  bool wait(rt::Duration most) noexcept;
  [[nodiscard]] Watcher* watcher_of(int fd) const noexcept;

  rt::Executor* executor_;
  int epoll_;
  rt::Time began_;
  std::chrono::steady_clock::time_point real_;
  std::vector<Watched> watched_;
};

}  // namespace berth::io

/// Drives an executor in real time, by a loop of its own: what runs on real ports, and a simulated world that is paced.
#pragma once

#include "berth/io/loop.hpp"
#include "berth/rt/driver.hpp"

namespace berth::io {

class LoopDriver final : public rt::Driver {
 public:
  /// A predicate may look at what no descriptor tells of, a screen that is drawn each second, say: it is asked at least
  /// every `longest_sleep`.
  explicit LoopDriver(rt::Executor& executor, rt::Duration longest_sleep = std::chrono::milliseconds(50))
      : Driver(executor), loop_(executor), longest_sleep_(longest_sleep) {}

  /// World time is the clock's, so that it may end a little after `end`.
  bool run_until(const Predicate& over, rt::Time end) override;
  /// For descriptors, and for ports.
  [[nodiscard]] Loop& loop() noexcept { return loop_; }

 private:
  Loop loop_;
  rt::Duration longest_sleep_;
};

}  // namespace berth::io

/// Drives an executor in real time, with its own loop: for real ports, and for a paced simulated world.
#pragma once

#include "berth/io/loop.hpp"
#include "berth/rt/driver.hpp"

namespace berth::io {

class LoopDriver final : public rt::Driver {
 public:
  /// A predicate may depend on things that no descriptor reports (for example, a screen drawn each second): it is
  /// called at least every `longest_sleep`.
  explicit LoopDriver(rt::Executor& executor, rt::Duration longest_sleep = std::chrono::milliseconds(50))
      : Driver(executor), loop_(executor), longest_sleep_(longest_sleep) {}

  /// World time follows the clock, so this may end a little after `end`.
  bool run_until(const Predicate& over, rt::Time end) override;
  /// For descriptors, and for ports.
  [[nodiscard]] Loop& loop() noexcept { return loop_; }

 private:
  Loop loop_;
  rt::Duration longest_sleep_;
};

}  // namespace berth::io

/// Gives an executor its time: `io::LoopDriver` in real time, `sim::WorldDriver` as fast as a simulated world can run.
/// Code that waits uses this interface and does not depend on which driver it is.
///
///     bool answered = false;
///     scope.spawn(ask(answered));
///     const bool in_time = driver.run_until([&] { return answered; }, driver.now() + 500ms);
#pragma once

#include <functional>

#include "berth/rt/executor.hpp"

namespace berth::rt {

class Driver {
 public:
  using Predicate = std::function<bool()>;

  virtual ~Driver() = default;
  Driver(const Driver&) = delete;
  Driver& operator=(const Driver&) = delete;

  [[nodiscard]] Executor& executor() const noexcept { return *executor_; }
  [[nodiscard]] Time now() const noexcept { return executor_->now(); }

  /// Runs due work until `over()` is true or `end` is reached; returns the last result of `over()`. It is called before
  /// any work and between jobs, never inside one. It may be called often, so it must be cheap. Not from a job.
  virtual bool run_until(const Predicate& over, Time end) = 0;
  void run_for(Duration time) {
    run_until([] { return false; }, later(time));
  }
  /// `time` from now; `never` if that is beyond the end of time.
  [[nodiscard]] Time later(Duration time) const noexcept { return time < never - now() ? now() + time : never; }

 protected:
  explicit Driver(Executor& executor) noexcept : executor_(&executor) {}

 private:
  Executor* executor_;
};

}  // namespace berth::rt

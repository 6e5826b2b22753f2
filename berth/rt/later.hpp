/// A member function to be called later.
#pragma once

#include "berth/rt/executor.hpp"

namespace berth::rt {

/// A job that calls a member of its owner. The owner outlives it, and should hold it. After destruction it calls
/// nothing.
template <class Owner, void (Owner::*Do)() noexcept>
class Later final : public Job {
 public:
  Later(Owner& owner, Executor& executor) noexcept : owner_(&owner), executor_(&executor) {}
  void run() noexcept override { (owner_->*Do)(); }
  void post() noexcept { executor_->post(*this); }
  void arm(Duration delay) noexcept { executor_->after(delay, *this); }

 private:
  Owner* owner_;
  Executor* executor_;
};

}  // namespace berth::rt

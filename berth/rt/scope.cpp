#include "berth/rt/scope.hpp"

#include <utility>

namespace berth::rt {

void Scope::spawn(Task<void> task) {
  if (!task.valid()) return;
  auto* child = new Child(*this, std::move(task));
  child->next_ = first_;
  if (first_ != nullptr) first_->previous_ = child;
  first_ = child;
  ++running_;
  if (at_once_ < most_) {
    ++at_once_;
    executor_->post(*child);
    return;
  }
  (last_turn_ == nullptr ? next_turn_ : last_turn_->behind_) = child;
  last_turn_ = child;
}

void Scope::Child::run() noexcept {
  if (!started_) {
    started_ = true;
    if (!task_.start(scope_.executor(), *this)) return;
  }
  scope_.remove(*this);
}

void Scope::remove(Child& child) noexcept {
  if (child.previous_ != nullptr) {
    child.previous_->next_ = child.next_;
  } else {
    first_ = child.next_;
  }
  if (child.next_ != nullptr) child.next_->previous_ = child.previous_;
  delete &child;
  if (at_once_ > 0) --at_once_;
  if (next_turn_ != nullptr) {
    Child& next = *std::exchange(next_turn_, next_turn_->behind_);
    if (next_turn_ == nullptr) last_turn_ = nullptr;
    ++at_once_;
    executor_->post(next);
  }
  if (--running_ > 0 || join_ == nullptr) return;
  Join& join = *std::exchange(join_, nullptr);
  join.scope_ = nullptr;
  join.finish();
}

void Scope::cancel() noexcept {
  next_turn_ = last_turn_ = nullptr;
  // NOLINTNEXTLINE(clang-analyzer-cplusplus.NewDelete): remove() makes first_ the next child
  while (first_ != nullptr) remove(*first_);
  at_once_ = 0;
}

Task<void> told(Task<void> task, bool& done, Executor& executor, Job& then) {
  co_await std::move(task);
  done = true;
  executor.post(then);
}

}  // namespace berth::rt

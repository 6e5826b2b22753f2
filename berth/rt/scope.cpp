#include "berth/rt/scope.hpp"

namespace berth::rt {

void Scope::spawn(Task<void> task) {
  if (!task.valid()) return;
  auto* child = new Child(*this, std::move(task));
  child->next_ = first_;
  if (first_ != nullptr) first_->previous_ = child;
  first_ = child;
  ++running_;
  executor_->post(*child);
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
  if (--running_ > 0 || join_ == nullptr) return;
  Join& join = *std::exchange(join_, nullptr);
  join.scope_ = nullptr;
  join.finish();
}

void Scope::cancel() noexcept {
  // NOLINTNEXTLINE(clang-analyzer-cplusplus.NewDelete): remove() makes first_ the next child
  while (first_ != nullptr) remove(*first_);
}

}  // namespace berth::rt

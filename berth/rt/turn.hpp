/// A lock, first come, first served, for sequences of exchanges that must not interleave (LSS select, configure, store;
/// a RAND procedure). Not recursive.
///
///     co_await turn.take();
///     ...
///     turn.give();
#pragma once

#include <utility>

#include "berth/rt/task.hpp"

namespace berth::rt {

class Turn {
 public:
  Turn() = default;
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

  [[nodiscard]] bool taken() const noexcept { return taken_; }
  /// True if another task waits for the turn.
  [[nodiscard]] bool waited_for() const noexcept { return first_ != nullptr; }

  class Take final : public Operation<Take> {
   public:
    explicit Take(Turn& turn) noexcept : turn_(&turn) {}
    /// If destroyed between the grant and the resumption, it passes the turn on.
    ~Take() {
      leave();
      if (granted_) turn_->give();
    }
    bool start() noexcept {
      if (!turn_->taken_) {
        turn_->taken_ = true;
        return false;
      }
      previous_ = turn_->last_;
      (previous_ != nullptr ? previous_->next_ : turn_->first_) = this;
      turn_->last_ = this;
      waits_ = true;
      return true;
    }
    void await_resume() noexcept { granted_ = false; }

   private:
    friend class Turn;
    void leave() noexcept {
      if (!waits_) return;
      (previous_ != nullptr ? previous_->next_ : turn_->first_) = next_;
      (next_ != nullptr ? next_->previous_ : turn_->last_) = previous_;
      waits_ = false;
    }
    Turn* turn_;
    Take* previous_ = nullptr;
    Take* next_ = nullptr;
    bool waits_ = false;
    bool granted_ = false;
  };
  [[nodiscard]] Take take() noexcept { return Take(*this); }
  /// Passes the turn to the task that has waited longest.
  void give() noexcept {
    taken_ = first_ != nullptr;
    if (first_ == nullptr) return;
    Take* const next = first_;
    next->leave();
    next->granted_ = true;
    next->finish();
  }

 private:
  bool taken_ = false;
  Take* first_ = nullptr;
  Take* last_ = nullptr;
};

/// Holds a turn and gives it back at the end of its block, also when the task is destroyed.
class Held {
 public:
  explicit Held(Turn& turn) noexcept : turn_(&turn) {}
  ~Held() { turn_->give(); }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;

 private:
  Turn* turn_;
};

}  // namespace berth::rt

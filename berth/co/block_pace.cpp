#include "berth/co/block_pace.hpp"

#include <utility>

namespace berth::co {

bool BlockPace::take(Member& member) noexcept {
  const bool now = sends_ == nullptr && first_ == nullptr && executor_->now() >= free_until_;
  if (now) {
    sends_ = &member;
    began_ = executor_->now();
    return true;
  }
  Member** end = &first_;
  while (*end != nullptr) end = &(*end)->next_;
  member.next_ = nullptr;
  member.waits_ = true;
  *end = &member;
  if (sends_ == nullptr) executor_->at(free_until_, *this);
  return false;
}

void BlockPace::give(Member& member) noexcept {
  if (sends_ != &member) return;
  sends_ = nullptr;
  const rt::Time now = executor_->now();
  free_until_ = now + (now - began_) / free_part_;
  if (first_ != nullptr) executor_->at(free_until_, *this);
}

void BlockPace::leave(Member& member) noexcept {
  if (std::exchange(member.waits_, false)) {
    Member** place = &first_;
    while (*place != &member) place = &(*place)->next_;
    *place = member.next_;
  }
  give(member);
}

void BlockPace::run() noexcept {
  if (sends_ != nullptr || first_ == nullptr) return;
  Member* const next = std::exchange(first_, first_->next_);
  next->waits_ = false;
  sends_ = next;
  began_ = executor_->now();
  next->turn();
}

}  // namespace berth::co

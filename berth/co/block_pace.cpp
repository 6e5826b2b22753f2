#include "berth/co/block_pace.hpp"

#include <algorithm>
#include <utility>

namespace berth::co {
namespace {

constexpr can::IdRange outranked{0x680, 0x7FF};  // SDO requests, 600h to 67Fh, have priority over these
constexpr unsigned quiet_part = 4;               // a quarter of the free time: about two frames after 127 segments

}  // namespace

bool BlockPace::take(Member& member) noexcept {
  const bool at_once = sends_ == nullptr && first_ == nullptr && now() >= free_until_;
  if (at_once) {
    sends_ = &member;
    began_ = now();
    return true;
  }
  Member** end = &first_;
  while (*end != nullptr) end = &(*end)->next_;
  member.next_ = nullptr;
  member.waits_ = true;
  *end = &member;
  next();
  return false;
}

void BlockPace::give(Member& member) noexcept {
  if (sends_ != &member) return;
  sends_ = nullptr;
  const rt::Duration took = now() - began_;
  const rt::Duration free = took / free_part_;
  free_until_ = now() + free;
  longest_free_ = now() + took;
  quiet_ = free / quiet_part;
  dispatcher_->add(outranked, *this);
  next();
}

void BlockPace::leave(Member& member) noexcept {
  if (std::exchange(member.waits_, false)) {
    Member** place = &first_;
    while (*place != &member) place = &(*place)->next_;
    *place = member.next_;
  }
  give(member);
}

void BlockPace::next() noexcept {
  if (sends_ == nullptr && first_ != nullptr) dispatcher_->executor().at(free_until_, *this);
}

void BlockPace::received(const can::Frame&, rt::Time at) noexcept {
  free_until_ = std::clamp(at + quiet_, free_until_, std::max(free_until_, longest_free_));
}

void BlockPace::run() noexcept {
  if (sends_ != nullptr || first_ == nullptr) return;
  if (now() < free_until_) return next();
  dispatcher_->remove(*this);
  Member* const first = std::exchange(first_, first_->next_);
  first->waits_ = false;
  sends_ = first;
  began_ = now();
  first->turn();
}

}  // namespace berth::co

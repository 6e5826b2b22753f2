#include "berth/sim/transmit_queue.hpp"

#include <algorithm>
#include <utility>

namespace berth::sim {

TransmitQueue::TransmitQueue(TxOrder order, unsigned depth, bool fd)
    : order_(order), slots_(std::max(1U, depth)), fd_frames_(fd ? slots_.size() : 0) {
  for (auto at = static_cast<std::uint32_t>(slots_.size()); at-- > 0;) slots_[at].next = std::exchange(free_, at);
}

bool TransmitQueue::push(const can::Frame& frame, std::uint32_t tag) noexcept {
  const std::uint32_t at = free_;
  Waiting& waiting = slots_[at];
  free_ = waiting.next;
  waiting.frame = can::PackedFrame(frame);
  waiting.arbitration = arbitration_field(frame);
  waiting.tag = tag;
  waiting.next = nothing;
  waiting.tried = false;
  (oldest_ == nothing ? oldest_ : slots_[youngest_].next) = at;
  youngest_ = at;
  ++size_;
  if (frame.fd) [[unlikely]]
    fd_frames_[at] = frame;
  const bool goes_first =
      !has_head() || (order_ == TxOrder::priority && !sending_ && waiting.arbitration < head().arbitration);
  if (goes_first) head_ = at;
  return goes_first;
}

bool TransmitQueue::withdraw(std::uint32_t tag) noexcept {
  bool other_head = false;
  for (std::uint32_t before = nothing, at = oldest_, next = nothing; at != nothing; at = next) {
    next = slots_[at].next;
    const bool on_the_wire = sending_ && at == head_;
    if (slots_[at].tag != tag || on_the_wire) {
      if (slots_[at].tag == tag) abandoned_ = true;
      before = at;
      continue;
    }
    take_out(before, at);
    other_head = other_head || at == head_;
  }
  if (other_head) choose_head();
  return other_head;
}

void TransmitQueue::clear() noexcept {
  abandoned_ = false;
  while (oldest_ != nothing) take_out(nothing, oldest_);
  head_ = nothing;
}

can::Frame TransmitQueue::head_fd_frame(bool passive) const noexcept {
  can::Frame frame = fd_frames_[head_];
  frame.esi = frame.esi || passive;
  return frame;
}

inline void TransmitQueue::choose_head() noexcept {
  head_ = oldest_;
  if (order_ == TxOrder::in_order || head_ == nothing) return;
  for (std::uint32_t at = slots_[head_].next; at != nothing; at = slots_[at].next) {
    if (slots_[at].arbitration < slots_[head_].arbitration) head_ = at;
  }
}

// `before`: the slot of the next older frame, if there is one.
inline void TransmitQueue::take_out(std::uint32_t before, std::uint32_t at) noexcept {
  (before == nothing ? oldest_ : slots_[before].next) = slots_[at].next;
  if (at == youngest_) youngest_ = before;
  slots_[at].next = std::exchange(free_, at);
  --size_;
}

inline void TransmitQueue::take_out_head() noexcept {
  std::uint32_t before = nothing;
  for (std::uint32_t at = oldest_; at != head_; at = slots_[at].next) before = at;
  take_out(before, head_);
}

void TransmitQueue::attempt_over() noexcept {
  sending_ = false;
  if (std::exchange(abandoned_, false)) take_out_head();
  choose_head();
}

std::uint32_t TransmitQueue::sent() noexcept {
  const std::uint32_t tag = head().tag;
  take_out_head();
  sending_ = abandoned_ = false;
  choose_head();
  return tag;
}

}  // namespace berth::sim

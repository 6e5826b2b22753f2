#include "berth/sim/transmit_queue.hpp"

#include <algorithm>
#include <utility>

namespace berth::sim {

TransmitQueue::TransmitQueue(TxOrder order, unsigned depth, bool fd)
    : order_kind_(order), slots_(std::max(1U, depth)), fd_frames_(fd ? slots_.size() : 0) {
  order_.reserve(slots_.size());
  free_.reserve(slots_.size());
  for (auto i = static_cast<std::uint32_t>(slots_.size()); i > 0; --i) free_.push_back(i - 1);
}

bool TransmitQueue::push(const can::Frame& frame, std::uint32_t tag) noexcept {
  const std::uint32_t at = free_.back();
  free_.pop_back();
  order_.push_back(at);
  Waiting& waiting = slots_[at];
  waiting.frame = can::PackedFrame(frame);
  waiting.arbitration = arbitration_field(frame);
  waiting.tag = tag;
  waiting.tried = false;
  if (frame.fd) [[unlikely]]
    fd_frames_[at] = frame;
  const bool goes_first =
      !has_head() || (order_kind_ == TxOrder::priority && !sending_ && waiting.arbitration < head().arbitration);
  if (goes_first) head_ = at;
  return goes_first;
}

bool TransmitQueue::withdraw(std::uint32_t tag) noexcept {
  bool other_head = false;
  for (auto it = order_.begin(); it != order_.end();) {
    const std::uint32_t at = *it;
    if (slots_[at].tag != tag || (sending_ && at == head_)) {
      if (slots_[at].tag == tag) abandoned_ = true;
      ++it;
      continue;
    }
    it = order_.erase(it);
    free_.push_back(at);
    if (at != head_) continue;
    choose_head();
    other_head = true;
  }
  return other_head;
}

void TransmitQueue::clear() noexcept {
  abandoned_ = false;
  for (const auto at : order_) free_.push_back(at);
  order_.clear();
  head_ = nothing;
}

can::Frame TransmitQueue::head_fd_frame(bool passive) const noexcept {
  can::Frame frame = fd_frames_[head_];
  frame.esi = frame.esi || passive;
  return frame;
}

void TransmitQueue::choose_head() noexcept {
  head_ = order_.empty() ? nothing : order_.front();
  if (order_kind_ == TxOrder::in_order) return;
  for (const auto at : order_) {
    if (slots_[at].arbitration < slots_[head_].arbitration) head_ = at;
  }
}

void TransmitQueue::attempt_over() noexcept {
  sending_ = false;
  if (std::exchange(abandoned_, false)) {
    std::erase(order_, head_);
    free_.push_back(head_);
  }
  choose_head();
}

std::uint32_t TransmitQueue::sent() noexcept {
  const std::uint32_t tag = head().tag;
  if (order_.size() == 1) {
    order_.clear();
  } else {
    std::erase(order_, head_);
  }
  free_.push_back(head_);
  sending_ = abandoned_ = false;
  choose_head();
  return tag;
}

}  // namespace berth::sim

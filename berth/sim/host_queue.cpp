#include "berth/sim/host_queue.hpp"

#include <algorithm>

namespace berth::sim {

HostQueue::HostQueue(rt::Executor& executor, const can::Port& port, unsigned rx_depth, rt::Duration rx_service)
    : executor_(&executor), port_(&port), rx_depth_(std::max(1U, rx_depth)), rx_service_(rx_service), events_(4) {}

void HostQueue::listen(can::Listener* listener) noexcept {
  if (listener != listener_) forget();
  listener_ = listener;
}

HostQueue::Event& HostQueue::push(What what, rt::Time at) noexcept {
  if (count_ == events_.size()) {
    std::vector<Event> larger(events_.size() * 2);
    for (std::size_t i = 0; i < count_; ++i) larger[i] = events_[(first_ + i) & (events_.size() - 1)];
    events_.swap(larger);
    first_ = 0;
  }
  Event& event = events_[(first_ + count_) & (events_.size() - 1)];
  event.what = what;
  event.at = at;
  if (count_++ == 0) schedule();
  return event;
}

void HostQueue::schedule() noexcept {
  if (count_ == 0) return;
  if (rx_service_.count() == 0 || events_[first_].what != What::received) {
    executor_->post(*this);
  } else {
    executor_->after(rx_service_, *this);
  }
}

bool HostQueue::received(const can::Frame& frame, rt::Time at) noexcept {
  if (deaf_ || rx_waiting_ >= rx_depth_) return false;
  ++rx_waiting_;
  push(What::received, at).frame = can::PackedFrame(frame);
  if (frame.fd) [[unlikely]]
    keep_fd(frame);
  return true;
}

void HostQueue::sent(std::uint32_t tag, rt::Time at) noexcept {
  if (tag != 0 && listener_ != nullptr) push(What::sent, at).tag = tag;
}

void HostQueue::changed() noexcept {
  if (listener_ != nullptr) push(What::changed, executor_->now());
}

void HostQueue::keep_fd(const can::Frame& frame) { fd_received_.push_back(frame); }

void HostQueue::receive_fd(rt::Time at) noexcept {
  const can::Frame frame = fd_received_.front();
  fd_received_.pop_front();
  listener_->received(frame, at);
}

void HostQueue::forget() noexcept {
  cancel();
  count_ = first_ = rx_waiting_ = 0;
  fd_received_.clear();
}

void HostQueue::run() noexcept {
  const Event& event = events_[first_];
  const What what = event.what;
  const rt::Time at = event.at;
  const std::uint32_t tag = event.tag;
  // The callback may push events, or destroy this queue and its controller.
  const can::Frame frame = event.frame.unpacked();
  if (what == What::received) --rx_waiting_;
  first_ = (first_ + 1) & (events_.size() - 1);
  --count_;
  schedule();
  if (what == What::received) {
    if (frame.fd) [[unlikely]]
      return receive_fd(at);
    listener_->received(frame, at);
  } else if (what == What::sent) {
    listener_->sent(tag, at);
  } else {
    listener_->changed(port_->status(), at);
  }
}

}  // namespace berth::sim

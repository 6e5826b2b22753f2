#include "berth/sim/host_queue.hpp"

#include <algorithm>

namespace berth::sim {

HostQueue::HostQueue(rt::Executor& executor, const can::Port& port, unsigned rx_depth, rt::Duration rx_service)
    : executor_(&executor), port_(&port), rx_depth_(std::max(1U, rx_depth)), rx_service_(rx_service), events_(4) {}

void HostQueue::listen(can::Listener* listener) noexcept {
  if (listener != listener_) forget();
  listener_ = listener;
}

void HostQueue::grow() {
  std::vector<Event> larger(events_.size() * 2);
  for (std::size_t i = 0; i < count_; ++i) larger[i] = events_[(first_ + i) & (events_.size() - 1)];
  events_.swap(larger);
  first_ = 0;
}

void HostQueue::changed() noexcept {
  if (listener_ != nullptr) push(What::changed, executor_->now());
}

void HostQueue::keep_fd(const can::Frame& frame) { fd_received_.push_back(frame); }

void HostQueue::receive_fd(rt::Time at) noexcept {
  const can::Frame frame = fd_received_.front();
  fd_received_.erase(fd_received_.begin());
  listener_->received(frame, at);
}

void HostQueue::forget() noexcept {
  cancel();
  count_ = first_ = rx_waiting_ = 0;
  fd_received_.clear();
}

void HostQueue::run() noexcept {
  // The callback may push events, or destroy this queue and its controller: its arguments are copied before.
  const Event& event = events_[first_];
  const rt::Time at = event.at;
  const What what = event.what;
  first_ = (first_ + 1) & (events_.size() - 1);
  if (--count_ > 0) schedule(events_[first_].what);
  if (what == What::received) {
    --rx_waiting_;
    const can::Frame frame = event.frame.unpacked();
    if (frame.fd) [[unlikely]]
      return receive_fd(at);
    listener_->received(frame, at);
  } else if (what == What::sent) {
    listener_->sent(event.tag, at);
  } else {
    listener_->changed(port_->status(), at);
  }
}

}  // namespace berth::sim

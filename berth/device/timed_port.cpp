#include "berth/device/timed_port.hpp"

#include <algorithm>

namespace berth::device {
namespace {

constexpr std::size_t usual_depth = 4;  // most devices never have more than a few frames waiting

}  // namespace

TimedPort::TimedPort(rt::Executor& executor, can::Port& port, const Timing& timing, Random random)
    : executor_(&executor), port_(&port), timing_(&timing), random_(random) {
  buffer_.resize(std::clamp<std::size_t>(timing.rx_depth, 1, usual_depth));
}

TimedPort::~TimedPort() { port_->listen(nullptr, {}); }

can::Queued TimedPort::send(const can::Frame& frame, std::uint32_t tag) noexcept {
  const auto queued = port_->send(frame, tag);
  if (timing_->repeat_per_million != 0 && queued == can::Queued::yes && random_.chance(timing_->repeat_per_million)) {
    port_->send(frame, 0);
  }
  return queued;
}

void TimedPort::listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
  listener_ = listener;
  port_->listen(listener == nullptr ? nullptr : this, accept);
}

bool TimedPort::restart(std::uint32_t bit_rate) noexcept {
  clear();
  return port_->restart(bit_rate);
}

void TimedPort::deaf(Deaf why, bool on) noexcept {
  const auto bit = static_cast<std::uint8_t>(why);
  deaf_ = static_cast<std::uint8_t>(on ? deaf_ | bit : deaf_ & ~bit);
  if (on) clear();
}

void TimedPort::clear() noexcept {
  lost_ += count_;
  count_ = 0;
  cancel();
}

rt::Duration TimedPort::draw() noexcept {
  const Timing& t = *timing_;
  auto own = t.response_min;
  if (t.outlier_per_million != 0 && random_.chance(t.outlier_per_million)) {
    own = t.outlier;
  } else if (t.response_max > t.response_min) {
    own = rt::Duration(random_.between(t.response_min.count(), t.response_max.count()));
  }
  return t.in_world(own) + extra_;
}

void TimedPort::received(const can::Frame& frame, rt::Time at) noexcept {
  if (deaf_ != 0 || frame.size > 8) {
    ++lost_;
    return;
  }
  const auto latency = draw();
  if (count_ == 0 && latency <= rt::Duration::zero()) {
    ++delivered_;
    listener_->received(frame, at);
    return;
  }
  queue(frame, at, latency);
}

bool TimedPort::put_by(const can::Frame& frame, rt::Time at) noexcept {
  const bool waits = timing_->in_world(timing_->response_min) > rt::Duration::zero() && extra_ >= rt::Duration::zero();
  if (!waits || timing_->outlier_per_million != 0) return false;  // the device may have to take it at once
  received(frame, at);
  return true;
}

void TimedPort::queue(const can::Frame& frame, rt::Time at, rt::Duration latency) noexcept {
  if (count_ == buffer_.size() && !make_room()) {
    ++lost_;
    return;
  }
  auto due = executor_->now() + latency;
  if (count_ > 0) due = std::max(due, waiting(count_ - 1).due);
  waiting(count_) = {due, at, can::PackedFrame(frame)};
  if (count_++ == 0) executor_->at(due, *this);
}

bool TimedPort::make_room() noexcept {
  const auto depth = std::max<std::size_t>(1, timing_->rx_depth);
  if (buffer_.size() >= depth) return false;
  std::vector<Waiting> larger(std::min(depth, buffer_.size() * 2));
  for (std::size_t i = 0; i < count_; ++i) larger[i] = waiting(i);
  buffer_.swap(larger);
  first_ = 0;
  return true;
}

void TimedPort::run() noexcept {
  if (count_ == 0) return;
  const Waiting w = buffer_[first_];
  if (++first_ == buffer_.size()) first_ = 0;
  if (--count_ > 0) executor_->at(buffer_[first_].due, *this);
  if (listener_ == nullptr) return;
  ++delivered_;
  listener_->received(w.frame.unpacked(), w.at);
}

void TimedPort::sent(std::uint32_t tag, rt::Time at) noexcept {
  if (listener_ != nullptr) listener_->sent(tag, at);
}

void TimedPort::changed(const can::Status& status, rt::Time at) noexcept {
  if (listener_ != nullptr) listener_->changed(status, at);
}

}  // namespace berth::device

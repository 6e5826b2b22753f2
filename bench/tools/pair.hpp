/// Two ports joined without a bus: what the benches of services put between client and server.
#pragma once

#include <array>

#include "berth/can/port.hpp"

namespace berth::bench {

/// One end of a pair of ports: a frame is with the other end at once, each frame in a job of its own as a port
/// promises. `room`: frames that can wait; block transfer wants a few.
template <unsigned room = 1>
class Pair final : public can::Port, private rt::Job {
 public:
  explicit Pair(rt::Executor& executor) noexcept : executor_(&executor) {}
  void join(Pair& other) noexcept { other_ = &other; }

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    if (count_ == room) return can::Queued::full;
    Waiting& waiting = queue_[(first_ + count_++) % room];
    waiting.frame = frame;
    waiting.tag = tag;
    executor_->post(*this);
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t tag) noexcept override {
    for (unsigned i = 0; i < count_; ++i) {
      Waiting& waiting = queue_[(first_ + i) % room];
      if (waiting.tag == tag) waiting.tag = gone;
    }
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    accepts_ = listener == nullptr || accept.empty() ? can::IdRange{1, 0}
                                                     : can::IdRange{accept.front().first, accept.back().last};
  }
  [[nodiscard]] can::Status status() const noexcept override { return {.up = true, .knows_sent = true}; }
  bool restart(std::uint32_t) noexcept override { return false; }

 private:
  static constexpr std::uint32_t gone = 0xFFFF'FFFFU;
  struct Waiting {
    can::Frame frame;
    std::uint32_t tag = 0;
  };
  void run() noexcept override {
    const Waiting& waiting = queue_[first_ % room];  // stays in its place: it counts until it is dealt with
    const auto tag = waiting.tag;
    if (tag != gone && other_->accepts_.contains(waiting.frame.key())) {
      other_->listener_->received(waiting.frame, executor_->now());
    }
    first_ = (first_ + 1) % room;
    if (--count_ > 0) executor_->post(*this);
    if (tag != 0 && tag != gone) listener_->sent(tag, executor_->now());
  }

  rt::Executor* executor_;
  Pair* other_ = nullptr;
  can::Listener* listener_ = nullptr;
  can::IdRange accepts_{1, 0};
  std::array<Waiting, room> queue_;
  unsigned first_ = 0;
  unsigned count_ = 0;
};

}  // namespace berth::bench

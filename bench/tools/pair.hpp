/// Two ports joined without a bus: what the benches of services put between client and server.
#pragma once

#include <utility>

#include "berth/can/port.hpp"

namespace berth::bench {

/// One end of a pair of ports: a frame is with the other end at once, each call in a job of its own as a port promises.
/// Takes one frame at a time; a second one is `full` until the other end has heard the first.
class Pair final : public can::Port, private rt::Job {
 public:
  explicit Pair(rt::Executor& executor) noexcept : executor_(&executor) {}
  void join(Pair& other) noexcept { other_ = &other; }

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    if (other_->hears_ || tag_ != 0) return can::Queued::full;
    if (tag != 0) {
      tag_ = tag;
      executor_->post(*this);
    }
    if (other_->listener_ != nullptr && other_->accepts_.contains(frame.key())) other_->take(frame);
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t tag) noexcept override {
    if (tag == tag_) tag_ = 0;
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    accepts_ = accept.empty() ? can::IdRange{1, 0} : can::IdRange{accept.front().first, accept.back().last};
  }
  [[nodiscard]] can::Status status() const noexcept override { return {.up = true, .knows_sent = true}; }
  bool restart(std::uint32_t) noexcept override { return false; }

 private:
  void take(const can::Frame& frame) noexcept {
    frame_ = frame;
    hears_ = true;
    executor_->post(*this);
  }
  void run() noexcept override {
    if (tag_ != 0) {
      if (hears_) executor_->post(*this);
      listener_->sent(std::exchange(tag_, 0U), executor_->now());
    } else if (hears_) {
      listener_->received(frame_, executor_->now());
      hears_ = false;
    }
  }

  rt::Executor* executor_;
  Pair* other_ = nullptr;
  can::Listener* listener_ = nullptr;
  can::IdRange accepts_{1, 0};
  can::Frame frame_;
  std::uint32_t tag_ = 0;
  bool hears_ = false;
};

}  // namespace berth::bench

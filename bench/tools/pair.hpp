/// Two ports joined without a bus: what the benches of services put between client and server.
#pragma once

#include "berth/can/port.hpp"

namespace berth::bench {

/// One end of a pair of ports: a frame is with the other end at once, each call in a job of its own as a port promises.
/// Takes one frame at a time; a second one is `full` until the first has gone.
class Pair final : public can::Port, private rt::Job {
 public:
  explicit Pair(rt::Executor& executor) noexcept : executor_(&executor) {}
  void join(Pair& other) noexcept { other_ = &other; }

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    if (waits_) return can::Queued::full;
    frame_ = frame;
    tag_ = tag;
    waits_ = true;
    executor_->post(*this);
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t tag) noexcept override {
    if (waits_ && tag == tag_) waits_ = false;
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    accepts_ = accept.empty() ? can::IdRange{1, 0} : can::IdRange{accept.front().first, accept.back().last};
  }
  [[nodiscard]] can::Status status() const noexcept override { return {.up = true, .knows_sent = true}; }
  bool restart(std::uint32_t) noexcept override { return false; }

 private:
  void run() noexcept override {
    if (heard_) {
      heard_ = false;
      listener_->received(incoming_, executor_->now());
      return;
    }
    if (!waits_) return;
    waits_ = false;
    if (other_->listener_ != nullptr && other_->accepts_.contains(frame_.key())) other_->take(frame_);
    if (tag_ != 0) listener_->sent(tag_, executor_->now());
  }
  void take(const can::Frame& frame) noexcept {
    incoming_ = frame;
    heard_ = true;
    executor_->post(*this);
  }

  rt::Executor* executor_;
  Pair* other_ = nullptr;
  can::Listener* listener_ = nullptr;
  can::IdRange accepts_{1, 0};
  can::Frame frame_;
  can::Frame incoming_;
  std::uint32_t tag_ = 0;
  bool waits_ = false;
  bool heard_ = false;
};

}  // namespace berth::bench

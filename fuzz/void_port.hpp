// A port for fuzzing whoever asks: what is sent goes into the void and is confirmed at once; what is heard is the
// input.
#pragma once

#include <vector>

#include "berth/can/port.hpp"
#include "fuzz/require.hpp"

namespace berth::fuzz {

class VoidPort final : public can::Port, private rt::Job {
 public:
  explicit VoidPort(rt::Executor& executor) : executor_(executor) {}
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    last = frame;
    if (tag == 0) return can::Queued::yes;
    tags_.push_back(tag);
    executor_.post(*this);
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t tag) noexcept override { std::erase(tags_, tag); }
  void listen(can::Listener* listener, std::span<const can::IdRange>) noexcept override { listener_ = listener; }
  can::Status status() const noexcept override { return {}; }
  bool restart(std::uint32_t) noexcept override { return true; }
  void hear(const can::Frame& frame) noexcept {
    if (listener_ != nullptr) listener_->received(frame, executor_.now());
  }
  can::Frame last;  ///< the newest frame sent

 private:
  void run() noexcept override {
    while (!tags_.empty()) {
      const auto tag = tags_.front();
      tags_.erase(tags_.begin());
      if (listener_ != nullptr) listener_->sent(tag, executor_.now());
    }
  }
  rt::Executor& executor_;
  can::Listener* listener_ = nullptr;
  std::vector<std::uint32_t> tags_;
};

/// Notes that an operation has ended.
struct Flag final : rt::Job {
  void run() noexcept override { set = true; }
  bool set = false;
};

}  // namespace berth::fuzz

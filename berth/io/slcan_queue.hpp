/// Own frames on their way through a serial adapter: waiting ones, of which the first may be with the adapter, and
/// those that it has taken and not yet reported as sent. Internal to room `io`.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>

#include "berth/can/frame.hpp"

namespace berth::io {

class SlcanQueue {
 public:
  static constexpr unsigned most_tries = 500;
  static constexpr std::size_t most_flying = 256;

  void push(const can::Frame& frame, std::uint32_t tag) { waiting_.push_back({frame, tag}); }
  /// `asked`: the first is with the adapter, and is sent without a tag.
  void withdraw(std::uint32_t tag, bool asked) {
    const auto first = waiting_.begin() + (asked ? 1 : 0);
    waiting_.erase(std::remove_if(first, waiting_.end(), [tag](const Waiting& w) { return w.tag == tag; }),
                   waiting_.end());
    for (auto* const queue : {&waiting_, &flying_}) {
      for (auto& w : *queue) {
        if (w.tag == tag) w.tag = 0;
      }
    }
  }
  [[nodiscard]] bool none_waits() const noexcept { return waiting_.empty(); }
  [[nodiscard]] const can::Frame& first() const noexcept { return waiting_.front().frame; }
  [[nodiscard]] std::size_t size() const noexcept { return waiting_.size() + flying_.size(); }

  /// The first was sent; returns its tag.
  std::uint32_t gone() {
    const auto tag = waiting_.front().tag;
    waiting_.pop_front();
    return tag;
  }
  /// The adapter has taken the first, and will report it as sent.
  void taken() {
    if (flying_.size() >= most_flying) flying_.pop_front();
    flying_.push_back(waiting_.front());
    waiting_.pop_front();
  }
  /// The adapter refuses the first. False after too many refusals: the frame is dropped.
  bool refused() {
    if (++waiting_.front().tries < most_tries) return true;
    waiting_.pop_front();
    return false;
  }
  /// The adapter reports a frame as sent; returns its tag, or 0 if the frame was not from here.
  std::uint32_t reported(const can::Frame& frame) {
    const auto it = std::ranges::find(flying_, frame, &Waiting::frame);
    if (it == flying_.end()) return 0;
    const auto tag = it->tag;
    flying_.erase(it);
    return tag;
  }
  void clear() noexcept {
    waiting_.clear();
    flying_.clear();
  }

 private:
  struct Waiting {
    can::Frame frame;
    std::uint32_t tag = 0;
    unsigned tries = 0;
  };
  std::deque<Waiting> waiting_;  // the first is being offered to the adapter
  std::deque<Waiting> flying_;   // taken by the adapter, not yet acknowledged
};

}  // namespace berth::io

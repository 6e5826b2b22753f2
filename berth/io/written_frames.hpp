/// Frames that a SocketCAN port has written and whose echo it awaits. Finds out which frames an echo confirms. Internal
/// to room `io`.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>

#include "berth/can/frame.hpp"

namespace berth::io {

class WrittenFrames {
 public:
  /// After so many echoes of later frames one is given up: more than there are mailboxes.
  static constexpr unsigned most_passed = 32;

  /// Room for `most`; beyond that the oldest are forgotten.
  explicit WrittenFrames(std::size_t most) noexcept : most_(most) {}
  void add(const can::Frame& frame, std::uint32_t tag) {
    if (frames_.size() >= most_) frames_.pop_front();
    frames_.push_back({frame, tag, 0});
  }
  /// Frames with this tag are not reported any more.
  void withdraw(std::uint32_t tag) noexcept {
    for (auto& written : frames_) {
      if (written.tag == tag) written.tag = 0;
    }
  }
  void clear() noexcept { frames_.clear(); }
  [[nodiscard]] std::size_t size() const noexcept { return frames_.size(); }

  /// The echo of `frame`; `lost`: how many frames the receive buffer has lost so far. Calls `sent(tag)` for each tagged
  /// frame that this confirms. Frames are sent in the order of writing. If a frame's echo is missing and the receive
  /// buffer lost frames, it was sent before this one; else the controller sends by priority, or the driver dropped it.
  template <class Sent>
  void echoed(const can::Frame& frame, std::uint32_t lost, const Sent& sent) {
    const auto it = std::ranges::find_if(frames_, [&frame](const Written& w) { return w.frame == frame; });
    if (it == frames_.end()) return;
    const bool lost_some = lost != lost_then_;
    lost_then_ = lost;
    const auto first = lost_some ? frames_.begin() : it;
    for (auto w = frames_.begin(); w != first; ++w) ++w->passed;
    for (auto w = first; w <= it; ++w) {
      if (w->tag != 0) sent(w->tag);
    }
    frames_.erase(first, it + 1);
    while (!frames_.empty() && frames_.front().passed >= most_passed) frames_.pop_front();
  }

 private:
  struct Written {
    can::Frame frame;
    std::uint32_t tag;
    unsigned passed;  // echoes of frames that were written later
  };
  std::deque<Written> frames_;  // oldest first
  std::size_t most_;
  std::uint32_t lost_then_ = 0;
};

}  // namespace berth::io

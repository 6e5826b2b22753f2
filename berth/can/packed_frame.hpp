/// A frame of at most 8 bytes in 16 bytes, for queues and receive buffers. `Frame` is for processing, with room for
/// FD's 64 bytes.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "berth/can/frame.hpp"

namespace berth::can {

class PackedFrame {
 public:
  PackedFrame() = default;
  /// Keeps only the beginning of a longer frame, which must not be unpacked or compared. ESI is not kept.
  explicit PackedFrame(const Frame& frame) noexcept : head_(frame) {
    if (head_.fd) [[unlikely]]
      head_.esi = false;
    std::copy_n(frame.data.begin(), data_.size(), data_.begin());
  }
  [[nodiscard]] Frame unpacked() const noexcept {
    Frame frame;
    static_cast<FrameHead&>(frame) = head_;
    std::copy_n(data_.begin(), data_.size(), frame.data.begin());
    return frame;
  }
  [[nodiscard]] bool fd() const noexcept { return head_.fd; }
  friend bool operator==(const PackedFrame& a, const PackedFrame& b) noexcept {
    return a.head_ == b.head_ &&
           (a.head_.remote || std::equal(a.data_.begin(), a.data_.begin() + a.head_.size, b.data_.begin()));
  }

 private:
  FrameHead head_;
  std::array<std::uint8_t, 8> data_{};
};
static_assert(sizeof(PackedFrame) <= 16);

}  // namespace berth::can

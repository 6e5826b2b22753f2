/// A classic frame in 16 bytes: what queues and receive buffers keep. `Frame` is for handling, with room for FD.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "berth/can/frame.hpp"

namespace berth::can {

class PackedFrame {
 public:
  PackedFrame() = default;
  /// `frame` must be classic: not FD, at most 8 bytes.
  explicit PackedFrame(const Frame& frame) noexcept : key_(frame.key()), size_(frame.size), remote_(frame.remote) {
    std::copy_n(frame.data.begin(), data_.size(), data_.begin());
  }
  [[nodiscard]] Frame unpacked() const noexcept {
    Frame frame;
    frame.id = key_ & ~extended_flag;
    frame.extended = (key_ & extended_flag) != 0;
    frame.remote = remote_;
    frame.size = size_;
    std::copy_n(data_.begin(), data_.size(), frame.data.begin());
    return frame;
  }
  friend bool operator==(const PackedFrame& a, const PackedFrame& b) noexcept {
    return a.key_ == b.key_ && a.remote_ == b.remote_ && a.size_ == b.size_ &&
           (a.remote_ || std::equal(a.data_.begin(), a.data_.begin() + a.size_, b.data_.begin()));
  }

 private:
  std::uint32_t key_ = 0;
  std::uint8_t size_ = 0;
  bool remote_ = false;
  std::array<std::uint8_t, 8> data_{};
};
static_assert(sizeof(PackedFrame) <= 16);

}  // namespace berth::can

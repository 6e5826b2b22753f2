/// A frame of at most 8 bytes in 16 bytes: what queues and receive buffers keep. `Frame` is for handling, with room for
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
  /// Of a longer frame only the beginning is kept: that is not to be unpacked or compared. ESI is not kept.
  explicit PackedFrame(const Frame& frame) noexcept
      : key_(frame.key()), size_(frame.size), flags_(frame.fd ? fd_flags(frame) : frame.remote) {
    std::copy_n(frame.data.begin(), data_.size(), data_.begin());
  }
  [[nodiscard]] Frame unpacked() const noexcept {
    Frame frame;
    frame.id = key_ & ~extended_flag;
    frame.extended = (key_ & extended_flag) != 0;
    frame.remote = flags_ == 1;
    if (fd()) [[unlikely]] {
      frame.fd = true;
      frame.brs = flags_ == 3;
    }
    frame.size = size_;
    std::copy_n(data_.begin(), data_.size(), frame.data.begin());
    return frame;
  }
  [[nodiscard]] bool fd() const noexcept { return flags_ > 1; }
  friend bool operator==(const PackedFrame& a, const PackedFrame& b) noexcept {
    return a.key_ == b.key_ && a.flags_ == b.flags_ && a.size_ == b.size_ &&
           (a.flags_ == 1 || std::equal(a.data_.begin(), a.data_.begin() + a.size_, b.data_.begin()));
  }

 private:
  static std::uint8_t fd_flags(const Frame& frame) noexcept { return frame.brs ? 3 : 2; }
  std::uint32_t key_ = 0;
  std::uint8_t size_ = 0;
  std::uint8_t flags_ = 0;  // 1 remote; 2 FD, 3 with BRS
  std::array<std::uint8_t, 8> data_{};
};
static_assert(sizeof(PackedFrame) <= 16);

}  // namespace berth::can

/// Bytes passing from one bus to the other.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

namespace berth::multilevel {

/// First in, first out. Bytes taken out are kept until their room is needed, so that a short value can be taken again.
class ByteQueue {
 public:
  [[nodiscard]] std::size_t size() const noexcept { return bytes_.size() - first_; }
  /// Bytes put in since `clear`.
  [[nodiscard]] std::size_t total() const noexcept { return dropped_ + bytes_.size(); }
  [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept { return std::span(bytes_).subspan(first_); }
  void clear() noexcept {
    bytes_.clear();
    first_ = dropped_ = 0;
  }
  void put(std::span<const std::uint8_t> bytes) {
    if (first_ >= lazy) {
      dropped_ += first_;
      bytes_.erase(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(first_));
      first_ = 0;
    }
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  }
  std::size_t take(std::span<std::uint8_t> into) noexcept {
    const auto count = std::min(into.size(), size());
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(first_), count, into.begin());
    first_ += count;
    return count;
  }
  /// Starts again at the first byte; false when that is no longer kept.
  bool again() noexcept {
    if (dropped_ != 0) return false;
    first_ = 0;
    return true;
  }

 private:
  static constexpr std::size_t lazy = 1024;
  std::vector<std::uint8_t> bytes_;
  std::size_t first_ = 0;
  std::size_t dropped_ = 0;
};

}  // namespace berth::multilevel

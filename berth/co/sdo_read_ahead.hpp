/// A part of SDO server and client: streams are read in large pieces and sent in small ones.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>

#include "berth/od/abort_code.hpp"

namespace berth::co {

/// Bytes read ahead of a stream into a buffer.
class ReadAhead {
 public:
  void begin(std::span<std::uint8_t> buffer) noexcept {
    buffer_ = buffer;
    first_ = end_ = 0;
    ended_ = false;
  }
  /// Provides at least `count` bytes (at most the buffer's size), fewer only at the end. `read(span)` fills from the
  /// beginning and returns the number of bytes, fewer than asked for = the end. It is asked for at most `ready` bytes;
  /// if they are too few, the answer is `pending`.
  template <class Read>
  [[nodiscard]] od::Answer<std::span<const std::uint8_t>> want(std::size_t count, std::size_t ready,
                                                               Read&& read) noexcept {
    if (end_ - first_ < count && !ended_) {
      std::memmove(buffer_.data(), buffer_.data() + first_, end_ - first_);
      end_ -= std::exchange(first_, 0);
      const auto room = buffer_.subspan(end_, std::min(buffer_.size() - end_, ready));
      const od::Answer<std::size_t> got = room.empty() ? 0 : read(room);
      if (!got) return od::refuse(got.error());
      ended_ = *got < room.size();
      end_ += std::min(*got, room.size());
      if (end_ - first_ < count && !ended_) return od::refuse(od::AbortCode::pending);
    }
    return std::span<const std::uint8_t>(buffer_).subspan(first_, end_ - first_);
  }
  void consume(std::size_t count) noexcept { first_ += count; }

 private:
  std::span<std::uint8_t> buffer_;
  std::size_t first_ = 0;
  std::size_t end_ = 0;
  bool ended_ = false;
};

}  // namespace berth::co

/// Shared by SDO server and client (CiA 301 §7.2.4; docs/protocols/cia301.md §SDO).
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "berth/base/bytes.hpp"
#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"
#include "berth/co/cob_id.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/rt/executor.hpp"

namespace berth::co {

using od::AbortCode;

/// The identifiers of one SDO channel, client to server and back (1200h.., 1280h..).
struct SdoChannel {
  CobId request{};
  CobId response{};
  /// The default channel of a node, which must be configured.
  [[nodiscard]] static constexpr SdoChannel of(NodeId node) noexcept {
    return {CobId(sdo_request_id(node)), CobId(sdo_response_id(node))};
  }
  [[nodiscard]] constexpr bool valid() const noexcept { return request.valid() && response.valid(); }
  friend constexpr bool operator==(SdoChannel, SdoChannel) noexcept = default;
};

/// Bytes of an object as uploaded: little-endian, up to 16 of them without the heap. Movable.
class SdoValue {
 public:
  static constexpr std::size_t small_size = 16;
  SdoValue() noexcept = default;
  explicit SdoValue(std::span<const std::uint8_t> bytes) { append(bytes); }
  SdoValue(const SdoValue&) = default;
  SdoValue& operator=(const SdoValue&) = default;
  /// The one moved from is empty.
  SdoValue(SdoValue&& other) noexcept
      : size_(std::exchange(other.size_, 0)), small_(other.small_), large_(std::move(other.large_)) {}
  SdoValue& operator=(SdoValue&& other) noexcept {
    size_ = std::exchange(other.size_, 0);
    small_ = other.small_;
    large_ = std::move(other.large_);
    return *this;
  }
  ~SdoValue() = default;

  void clear() noexcept {
    size_ = 0;
    large_.clear();
  }
  void append(std::span<const std::uint8_t> bytes) {
    if (bytes.empty()) return;
    if (size_ + bytes.size() <= small_size) {
      std::memcpy(small_.data() + size_, bytes.data(), bytes.size());
    } else {
      if (size_ <= small_size) large_.assign(small_.begin(), small_.begin() + static_cast<std::ptrdiff_t>(size_));
      large_.resize(size_);
      large_.insert(large_.end(), bytes.begin(), bytes.end());
    }
    size_ += bytes.size();
  }
  /// Appends the seven bytes of a segment, in few instructions.
  void append_segment(const std::uint8_t* from) {
    constexpr std::size_t segment = 7, ahead = 64 * segment;
    if (size_ <= small_size || size_ + segment > large_.size()) [[unlikely]] {
      append({from, segment});
      if (size_ > small_size) large_.resize(std::min(large_.capacity(), size_ + ahead));
      return;
    }
    std::memcpy(large_.data() + size_, from, segment);
    size_ += segment;
  }
  /// Makes room for `bytes` in all, so that appending does not copy.
  void reserve(std::size_t bytes) {
    if (bytes > small_size) large_.reserve(bytes);
  }
  /// Adds `count` bytes at the end, to be filled in through the pointer. `drop_back` must follow, at least with 0.
  [[nodiscard]] std::uint8_t* extend(std::size_t count) {
    if (size_ <= small_size) large_.assign(small_.begin(), small_.begin() + static_cast<std::ptrdiff_t>(size_));
    large_.resize(size_ + count);
    return large_.data() + std::exchange(size_, size_ + count);
  }
  /// Removes the last `count` of the bytes added by `extend`.
  void drop_back(std::size_t count) noexcept {
    size_ -= count;
    if (size_ <= small_size) std::copy_n(large_.begin(), size_, small_.begin());
    large_.resize(size_);
  }
  /// The first `count` (0..4) of the four bytes at `from`: an expedited answer.
  void set_expedited(const std::uint8_t* from, std::size_t count) noexcept {
    large_.clear();
    std::memcpy(small_.data(), from, 4);
    size_ = count;
  }
  [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept {
    return {size_ <= small_size ? small_.data() : large_.data(), size_};
  }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  /// The bytes as text, up to the first NUL.
  [[nodiscard]] std::string_view text() const noexcept;
  /// The bytes as an integer of exactly that size (bool: one byte); empty when the size differs.
  template <class T>
  [[nodiscard]] std::optional<T> as() const noexcept {
    static_assert(std::is_integral_v<T>);
    if (size_ != sizeof(T)) return std::nullopt;
    if constexpr (std::is_same_v<T, bool>) {
      return small_[0] != 0;
    } else {
      return static_cast<T>(load_le<std::make_unsigned_t<T>>(small_.data()));
    }
  }
  friend bool operator==(const SdoValue& a, const SdoValue& b) noexcept {
    return a.size_ == b.size_ && (a.size_ == 0 || std::memcmp(a.bytes().data(), b.bytes().data(), a.size_) == 0);
  }

 private:
  std::size_t size_ = 0;
  std::array<std::uint8_t, small_size> small_{};
  std::vector<std::uint8_t> large_;  // all bytes, if there are more than `small_size`; perhaps with spare bytes after
                                     // them
};

namespace sdo {

/// Command specifiers, bits 7..5 of byte 0. Client's and server's numbers differ.
enum class Ccs : std::uint8_t {
  download_segment,
  download,
  upload,
  upload_segment,
  abort,
  block_upload,
  block_download,
  network
};
enum class Scs : std::uint8_t {
  upload_segment,
  download_segment,
  upload,
  download,
  abort,
  block_download,
  block_upload,
  network
};
[[nodiscard]] constexpr std::uint8_t specifier(std::uint8_t byte0) noexcept {
  return static_cast<std::uint8_t>(byte0 >> 5);
}

inline constexpr std::uint8_t toggle_bit = 0x10;
inline constexpr std::size_t segment_bytes = 7;
/// Byte 0 of the confirmation of a sub-block: scs 5 and ss 2 of a server, ccs 5 and cs 2 of a client.
inline constexpr std::uint8_t sub_block_confirmed = 0xA2;
/// A receiver that hears no more of a sub-block acknowledges what it has after this part of its time-out.
inline constexpr int block_gap_part = 4;

/// Turns `frame` into a data frame of 8 bytes to this identifier.
inline void address(can::Frame& frame, CobId id) noexcept { frame.set_head(id.key(), 8); }

/// An SDO frame is a base data frame of exactly 8 bytes; others are ignored (CiA 301 §7.2.4.3; HC1.S16).
[[nodiscard]] constexpr bool well_formed(const can::Frame& frame) noexcept {
  return frame.size == 8 && !frame.remote && !frame.fd;
}
[[nodiscard]] inline ObjectRef multiplexer(const can::Frame& frame) noexcept {
  return {load_le<std::uint16_t>(frame.data.data() + 1), frame.data[3]};
}
/// Writes command byte, multiplexer and a number (bytes 4..7) to a frame's data, as one word (see `can::FrameHead`).
inline void put(can::Frame& frame, std::uint8_t command, ObjectRef ref, std::uint32_t number = 0) noexcept {
  const std::uint32_t low = command | std::uint32_t{ref.index} << 8U | std::uint32_t{ref.sub} << 24U;
  store_le(frame.data.data(), low | std::uint64_t{number} << 32U);
}
/// Writes command byte and seven bytes from `from` on, as one word.
inline void put_segment(can::Frame& frame, std::uint8_t command, const std::uint8_t* from) noexcept {
  const std::uint64_t bytes = load_le<std::uint32_t>(from) | std::uint64_t{load_le<std::uint32_t>(from + 3)} << 24U;
  store_le(frame.data.data(), bytes << 8U | command);
}
/// A frame with command byte and multiplexer, the other bytes 0.
[[nodiscard]] inline can::Frame make(std::uint32_t id, std::uint8_t command, ObjectRef ref = {}) noexcept {
  can::Frame frame;
  frame.set_head(id, 8);
  put(frame, command, ref);
  return frame;
}
/// Changes the object that the frame is about.
inline void rename(can::Frame& frame, ObjectRef ref) noexcept {
  store_le(frame.data.data() + 1, ref.index);
  frame.data[3] = ref.sub;
}
inline void put_abort(can::Frame& frame, ObjectRef ref, AbortCode code) noexcept {
  put(frame, 0x80, ref, static_cast<std::uint32_t>(code));
}
[[nodiscard]] inline can::Frame make_abort(CobId id, ObjectRef ref, AbortCode code) noexcept {
  can::Frame frame;
  address(frame, id);
  put_abort(frame, ref, code);
  return frame;
}
[[nodiscard]] inline AbortCode abort_code(const can::Frame& frame) noexcept {
  return static_cast<AbortCode>(load_le<std::uint32_t>(frame.data.data() + 4));
}

}  // namespace sdo
}  // namespace berth::co

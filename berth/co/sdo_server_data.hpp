/// The data end of an SDO server's transfer: an object dictionary's value or its stream, through a buffer. A part of
/// `SdoServer`.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <utility>

#include "berth/co/sdo.hpp"
#include "berth/co/sdo_read_ahead.hpp"
#include "berth/od/values.hpp"

namespace berth::co {

/// One transfer at a time. No heap use after construction.
class SdoServerData {
  enum class Kind : std::uint8_t { buffer, view, stream };

 public:
  /// Values of up to `buffer` bytes are held whole. For a dictionary with a DOMAIN, or with values longer than
  /// `buffer`, the buffer has at least the size that block transfer needs (897 bytes).
  /// `channel`: as `od::Channels` counts.
  SdoServerData(od::Values& values, std::size_t buffer, std::uint8_t channel);

  /// The values, which see this channel from the call on.
  [[nodiscard]] od::Values& values() const noexcept {
    values_->channels().enter(channel_);
    return *values_;
  }
  [[nodiscard]] std::size_t memory() const noexcept { return reserve_; }
  /// True if a stream is open; `drop` closes it.
  [[nodiscard]] bool streaming() const noexcept { return stream_.open(); }
  /// Forgets the transfer; a stream is closed as broken off.
  void drop() noexcept { stream_.drop(); }

  /// @name Upload
  /// @{
  [[nodiscard]] AbortCode open_read(ObjectRef ref) noexcept;
  /// The same, but a value of 1 to 4 bytes, which fits an expedited answer, is not opened: `expedited` refers to it.
  [[nodiscard]] AbortCode open_read(ObjectRef ref, std::span<const std::uint8_t>& expedited) noexcept;
  /// Size of the object; empty: its stream does not know.
  [[nodiscard]] std::optional<std::size_t> size() const noexcept {
    return sized_ ? std::optional(size_) : std::nullopt;
  }
  /// The bytes from the position on: all up to the end, or more than `count`, which is at most a sub-block. `pending`:
  /// a stream does not have them yet.
  [[nodiscard]] od::Answer<std::span<const std::uint8_t>> window(std::size_t count) noexcept {
    if (kind_ == Kind::buffer) return std::span<const std::uint8_t>(buffer_.get() + offset_, size_ - offset_);
    return far_window(count);
  }
  void consume(std::size_t count) noexcept {
    offset_ += count;
    if (kind_ == Kind::stream) ahead_.consume(count);
  }
  void close_read() noexcept;
  /// The next seven bytes, and consumes them, if they are available and more follow. Else null: use `window`.
  [[nodiscard]] const std::uint8_t* quick_read() noexcept {
    if (kind_ != Kind::buffer || size_ - offset_ <= sdo::segment_bytes) return nullptr;
    return buffer_.get() + std::exchange(offset_, offset_ + sdo::segment_bytes);
  }
  /// @}

  /// @name Download
  /// @{
  /// `pending` means accepted: the stream reports later that it is ready.
  [[nodiscard]] AbortCode open_write(ObjectRef ref, std::optional<std::size_t> size) noexcept;
  /// How many of `wanted` segments can be stored in a row.
  [[nodiscard]] unsigned segments(unsigned wanted) const noexcept;
  /// A place for `count` bytes: one segment, or as many as `segments` says.
  [[nodiscard]] od::Answer<std::uint8_t*> place(std::size_t count) noexcept {
    if (kind_ == Kind::buffer && offset_ + count <= reserve_) return buffer_.get() + offset_;
    return far_place(count);
  }
  /// So many bytes at the place belong to the object.
  [[nodiscard]] AbortCode commit(std::size_t count) noexcept {
    const auto total = offset_ + filled_ + count;
    if (total > limit_) return too_long(total);
    (kind_ == Kind::buffer ? offset_ : filled_) += count;
    return AbortCode::none;
  }
  /// A place for seven bytes that all belong to the object: committed at once. Null: use `place` and `commit`.
  [[nodiscard]] std::uint8_t* quick_place() noexcept {
    if (kind_ != Kind::buffer || limit_ - offset_ < sdo::segment_bytes) return nullptr;
    return buffer_.get() + std::exchange(offset_, offset_ + sdo::segment_bytes);
  }
  /// `pending`, reported once: the stream took bytes and is not ready for more (`od::Stream::write`).
  [[nodiscard]] AbortCode ready() noexcept {
    return std::exchange(waits_, false) ? AbortCode::pending : AbortCode::none;
  }
  /// All bytes are there: passes them to the dictionary or the stream and returns its answer, also `pending`.
  [[nodiscard]] AbortCode close_write() noexcept;
  /// @}

 private:
  [[nodiscard]] od::Answer<std::span<const std::uint8_t>> far_window(std::size_t count) noexcept;
  [[nodiscard]] od::Answer<std::uint8_t*> far_place(std::size_t count) noexcept;
  [[nodiscard]] AbortCode open_stream(od::Stream& stream) noexcept;
  [[nodiscard]] AbortCode open_value(const od::Answer<std::span<const std::uint8_t>>& value) noexcept;
  [[nodiscard]] AbortCode flush() noexcept;
  [[nodiscard]] AbortCode too_long(std::size_t total) const noexcept;
  [[nodiscard]] std::span<std::uint8_t> all() const noexcept { return {buffer_.get(), reserve_}; }

  od::Values* values_;
  std::unique_ptr<std::uint8_t[]> buffer_;
  std::size_t capacity_;  // the longest value held whole
  std::size_t reserve_;   // allocated bytes
  std::size_t size_ = 0;
  std::size_t offset_ = 0;  // bytes done; with a stream: given to it
  std::size_t filled_ = 0;  // download to a stream: bytes waiting in the buffer
  std::size_t limit_ = 0;   // download: more than this is refused
  std::size_t piece_ = 0;   // download to a stream: bytes that do not wait in the buffer
  od::StreamUse stream_;
  ReadAhead ahead_;
  ObjectRef ref_;
  Kind kind_ = Kind::buffer;
  std::uint8_t channel_;
  bool sized_ = false;
  bool waits_ = false;
};

}  // namespace berth::co

/// A DOMAIN whose bytes do not stand in `Values`: a program, a log, a file of 100 MB. What transfers it (the SDO
/// server) moves it piece by piece.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "berth/base/ids.hpp"
#include "berth/od/abort_code.hpp"

namespace berth::od {

class StreamUse;

/// Derive, then `Values::attach(stream, ref)`. One transfer at a time: a second one is refused with 0800 0022. Each
/// transfer is `open_read`, `read`... or `open_write`, `write`..., and then `close` once, also when it was broken off;
/// after a refusal by `open_read` or `open_write` there is no `close`. Access rights are checked before.
class Stream {
 public:
  /// Bytes that an SDO server gives at once: a sub-block of a block transfer, and a segment.
  static constexpr std::size_t longest_piece = 904;

  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  /// The stream that serves this SDO channel (`od::Channels`): itself, unless each channel has one of its own.
  virtual Stream& of(std::uint8_t channel) noexcept;

  /// An upload begins. The size in bytes when it is known; then exactly so many are read. `pending`: not known yet; it
  /// is asked again after `Channels::answer`. A size of 1 to 4 bytes is told when they are `ready`.
  virtual Answer<std::optional<std::size_t>> open_read(ObjectRef ref) noexcept;
  /// How many bytes `read` can give now: so many are asked for at most. SIZE_MAX: all that are asked for, or the end.
  /// When they are too few, the server waits for `Channels::answer`.
  [[nodiscard]] virtual std::size_t ready() const noexcept;
  /// Fills `into` from the beginning and says how many bytes that are; fewer than asked for = the end.
  virtual Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept;
  /// What the answer to an initiated upload calls the object; another one only where a protocol wants it so.
  [[nodiscard]] virtual ObjectRef named(ObjectRef ref) const noexcept;
  /// A download begins; `size` as the client indicated it. May answer `pending` (memory is erased first, say).
  virtual AbortCode open_write(ObjectRef ref, std::optional<std::size_t> size) noexcept;
  /// So many bytes are enough for a `write`; fewer come only at the end. The server makes them more where its buffer
  /// allows it, unless this says otherwise.
  [[nodiscard]] virtual std::size_t piece() const noexcept;
  /// A sub-block of a block download is asked for no larger than this: a stream that hands its bytes on gets them
  /// sooner. At least 7.
  [[nodiscard]] virtual std::size_t sub_block() const noexcept;
  /// The next bytes, never empty; they are taken (copied) whatever it answers, unless it refuses, which ends the
  /// transfer. `pending`: they are taken, and the server waits for `Channels::answer` before it asks for more (flash
  /// memory is being written). When `close` comes before that, only the answer of `close` is waited for.
  virtual AbortCode write(std::span<const std::uint8_t> bytes) noexcept;
  /// The transfer has ended; `complete`: all bytes were read, or written and found right (CRC, size). What it answers
  /// is the last word on a complete download, `pending` is allowed; otherwise it is not looked at.
  virtual AbortCode close(ObjectRef ref, bool complete) noexcept;

 protected:
  Stream() = default;
  ~Stream();

 private:
  friend class StreamUse;
  friend class Values;
  StreamUse* use_ = nullptr;
  class Values* values_ = nullptr;
};

/// One transfer's hold on a stream: what a server keeps. Closes (not complete) when destroyed; survives the stream's
/// end, after which reads and writes are refused with 0800 0020.
class StreamUse {
 public:
  StreamUse() = default;
  ~StreamUse() { drop(); }
  StreamUse(const StreamUse&) = delete;
  StreamUse& operator=(const StreamUse&) = delete;

  [[nodiscard]] Answer<std::optional<std::size_t>> open_read(Stream& stream, ObjectRef ref) noexcept;
  [[nodiscard]] AbortCode open_write(Stream& stream, ObjectRef ref, std::optional<std::size_t> size) noexcept;
  [[nodiscard]] Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept;
  [[nodiscard]] std::size_t ready() const noexcept;
  [[nodiscard]] std::size_t piece() const noexcept;
  [[nodiscard]] std::size_t sub_block() const noexcept;
  [[nodiscard]] AbortCode write(std::span<const std::uint8_t> bytes) noexcept;
  [[nodiscard]] AbortCode close(bool complete) noexcept;
  /// Closes what is open, as broken off.
  void drop() noexcept {
    if (open_) static_cast<void>(close(false));
  }
  [[nodiscard]] bool open() const noexcept { return open_; }

 private:
  friend class Stream;
  [[nodiscard]] bool take(Stream& stream, ObjectRef ref) noexcept;
  void release() noexcept;
  Stream* stream_ = nullptr;  // null although open: the stream is gone
  ObjectRef ref_;
  bool open_ = false;
};

}  // namespace berth::od

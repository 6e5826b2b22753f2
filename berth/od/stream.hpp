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

  /// An upload begins. The size in bytes when it is known; then exactly so many are read.
  virtual Answer<std::optional<std::size_t>> open_read(ObjectRef ref) noexcept;
  /// Fills `into` from the beginning and says how many bytes that are; fewer than asked for = the end.
  virtual Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept;
  /// A download begins; `size` as the client indicated it. May answer `pending` (memory is erased first, say).
  virtual AbortCode open_write(ObjectRef ref, std::optional<std::size_t> size) noexcept;
  /// The next bytes, never empty; they are taken (copied) whatever it answers, unless it refuses, which ends the
  /// transfer. `pending`: they are taken, and the server waits for `co::SdoServer::complete` before it asks for more
  /// (flash memory is being written). When `close` comes before that, only the answer of `close` is waited for.
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

/// A DOMAIN whose bytes are not in `Values`: a program, a log, a file of 100 MB. The SDO server transfers it piece by
/// piece.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "berth/base/ids.hpp"
#include "berth/od/abort_code.hpp"

namespace berth::od {

class StreamUse;

/// Derive, then call `Values::attach(stream, ref)`. One transfer at a time: a second one is refused with 0800 0022.
/// Each transfer is `open_read`, `read`... or `open_write`, `write`..., and then one `close`, also when it was broken
/// off. After a refusal by `open_read` or `open_write` there is no `close`. Access rights are checked before.
class Stream {
 public:
  /// Bytes that an SDO server passes at once: a sub-block of a block transfer, and a segment.
  static constexpr std::size_t longest_piece = 904;

  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  /// The stream for this SDO channel (`od::Channels`): itself, unless each channel has its own.
  virtual Stream& of(std::uint8_t channel) noexcept;

  /// An upload begins. Returns the size in bytes if known; then exactly so many are read. `pending`: not known yet; the
  /// server asks again after `Channels::answer`. A size of 1 to 4 bytes may be returned only when they are `ready`.
  virtual Answer<std::optional<std::size_t>> open_read(ObjectRef ref) noexcept;
  /// How many bytes `read` can give at once; the server asks for no more. SIZE_MAX: all that are asked for, or the end.
  /// If they are too few, the server waits for `Channels::answer`.
  [[nodiscard]] virtual std::size_t ready() const noexcept;
  /// Fills `into` from the beginning and returns the number of bytes; fewer than asked for = the end.
  virtual Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept;
  /// The object named in the answer to an initiated upload; another one only if a protocol requires it.
  [[nodiscard]] virtual ObjectRef named(ObjectRef ref) const noexcept;
  /// A download begins; `size` as the client indicated it. May answer `pending` (for example, memory is erased first).
  virtual AbortCode open_write(ObjectRef ref, std::optional<std::size_t> size) noexcept;
  /// So many bytes are enough for a `write`; fewer come only at the end. The server passes more if its buffer allows
  /// it, unless this is overridden.
  [[nodiscard]] virtual std::size_t piece() const noexcept;
  /// Limit for the sub-blocks that a block download requests, at least 7: a stream that forwards its bytes gets them
  /// sooner.
  [[nodiscard]] virtual std::size_t sub_block() const noexcept;
  /// The next bytes, never empty. They are taken (copied) whatever the answer is, except a refusal, which ends the
  /// transfer. `pending`: they are taken, and the server waits for `Channels::answer` before it requests more (flash
  /// memory is being written). If `close` comes before that, the server waits only for the answer of `close`.
  virtual AbortCode write(std::span<const std::uint8_t> bytes) noexcept;
  /// The transfer has ended; `complete`: all bytes were read, or written and found correct (CRC, size). After a
  /// complete download the result answers the client, and may be `pending`; otherwise it is ignored.
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

/// A server's hold on a stream during one transfer. Closes it (not complete) when destroyed; may outlive the stream:
/// reads and writes are then refused with 0800 0020.
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
  /// Closes an open transfer, as broken off.
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

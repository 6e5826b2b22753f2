/// SDO block transfer for server and client (CiA 301 §7.2.4.3.9 to §7.2.4.3.14): the sender of the sub-blocks and
/// their receiver. Neither does I/O; `BlockPump` puts a sub-block's frames into a port's queue.
#pragma once

#include <span>

#include "berth/base/crc.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/co/sdo.hpp"

namespace berth::co::sdo {

inline constexpr unsigned longest_block = 127;  ///< segments in a sub-block
/// Bytes held by a sender that may have to repeat a sub-block, and one more to see whether there are more.
inline constexpr std::size_t block_window = longest_block * segment_bytes + 1;
/// Losses make sub-blocks no smaller than this: one that is lost completely cannot be asked for again.
inline constexpr unsigned smallest_block = 8;
/// After so many sub-blocks in a row that brought nothing new, the transfer is given up.
inline constexpr unsigned longest_standstill = 16;

[[nodiscard]] constexpr bool valid_block_size(unsigned size) noexcept { return size >= 1 && size <= longest_block; }

/// Sends sub-blocks of one transfer: frames from a window of bytes, which must stay until acknowledged.
class BlockSender {
 public:
  enum class Heard : std::uint8_t {
    stale,     ///< no acknowledgement of this sub-block: ignored
    invalid,   ///< more than was sent, or an invalid block size: abort with `code()`
    go_on,     ///< `acknowledged()` bytes are done; the next sub-block begins after them
    finished,  ///< all bytes are done
  };

  void begin(bool with_crc) noexcept;
  /// Begins the next sub-block, with the size that the receiver asked for. `window` begins at the first byte that is
  /// not acknowledged; it ends with the data, or has more bytes than the sub-block takes.
  void sub_block(unsigned size, std::span<const std::uint8_t> window) noexcept;
  [[nodiscard]] bool sending() const noexcept { return sent_ < count_; }
  /// All segments of the sub-block are on the wire.
  [[nodiscard]] bool all_out() const noexcept { return confirmed_ == count_; }
  /// Fills the data of the next segment; call `advance` when it was taken.
  void segment(can::Frame& frame) const noexcept;
  void advance() noexcept { ++sent_; }
  /// The segments up to the last advanced one are on the wire.
  void confirm() noexcept { confirmed_ = sent_; }
  /// The segments up to this number are on the wire.
  void confirm(unsigned number) noexcept { confirmed_ = static_cast<std::uint8_t>(number); }
  [[nodiscard]] unsigned sent() const noexcept { return sent_; }
  /// Segments of the sub-block that are not sent yet.
  [[nodiscard]] unsigned left() const noexcept { return count_ - sent_; }

  [[nodiscard]] Heard acknowledge(unsigned number, unsigned next_size) noexcept;
  [[nodiscard]] std::size_t acknowledged() const noexcept { return acknowledged_; }
  [[nodiscard]] unsigned size() const noexcept { return size_; }
  [[nodiscard]] AbortCode code() const noexcept { return code_; }
  /// CRC of all acknowledged bytes; 0 without CRC.
  [[nodiscard]] std::uint16_t crc() const noexcept { return crc_; }
  /// Unused bytes of the last segment.
  [[nodiscard]] unsigned unused() const noexcept { return unused_; }

 private:
  const std::uint8_t* window_ = nullptr;
  std::size_t available_ = 0;
  std::size_t acknowledged_ = 0;
  AbortCode code_ = AbortCode::none;
  std::uint16_t crc_ = 0;
  std::uint8_t size_ = 1;
  std::uint8_t count_ = 0;  // segments in this sub-block
  std::uint8_t sent_ = 0;
  std::uint8_t confirmed_ = 0;
  std::uint8_t standstill_ = 0;
  std::uint8_t unused_ = 0;
  bool ends_ = false;  // this sub-block ends the transfer
  bool with_crc_ = false;
};

/// Collects sub-blocks of one transfer.
class BlockReceiver {
 public:
  enum class Heard : std::uint8_t {
    more,     ///< the sub-block goes on
    ends,     ///< acknowledge `good()` segments and begin the next sub-block, or wait for the end when `complete()`
    invalid,  ///< not a number of this sub-block: abort with 0504 0003
  };

  void begin() noexcept;
  /// Begins the next sub-block: stores at most `size` segments at `place`, 7 bytes each.
  void sub_block(unsigned size, std::uint8_t* place) noexcept;
  [[nodiscard]] Heard take(const can::Frame& frame) noexcept {
    const unsigned number = frame.data[0] & 0x7FU;
    if (number != good_ + 1U || number > size_) return take_other(frame);
    std::memcpy(place_, frame.data.data() + 1, segment_bytes);
    place_ += segment_bytes;
    ++good_;
    heard_ = true;
    if (number != size_ && (frame.data[0] & 0x80U) == 0) return Heard::more;
    return end(frame);
  }
  /// Segments received in order, of the current sub-block or the one that just ended.
  [[nodiscard]] unsigned good() const noexcept { return good_; }
  [[nodiscard]] unsigned size() const noexcept { return size_; }
  /// The last segment of the transfer was received.
  [[nodiscard]] bool complete() const noexcept { return complete_; }
  /// Something of this sub-block was heard.
  [[nodiscard]] bool heard() const noexcept { return heard_; }
  /// The block size to ask for next: half after a loss, so that a receive buffer does not overflow again.
  [[nodiscard]] unsigned next_size() const noexcept;
  /// False when too many sub-blocks in a row brought nothing.
  [[nodiscard]] bool alive() const noexcept { return standstill_ < longest_standstill; }
  /// The place after the last good segment.
  [[nodiscard]] const std::uint8_t* place() const noexcept { return place_; }
  /// True for the same frame as the one that ended the sub-block before: a duplicate.
  [[nodiscard]] bool repeats_last(const can::Frame& frame) const noexcept;
  /// The time-out ended the sub-block.
  void give_up() noexcept;

 private:
  [[nodiscard]] Heard take_other(const can::Frame& frame) noexcept;
  [[nodiscard]] Heard end(const can::Frame& frame) noexcept;

  std::uint8_t* place_ = nullptr;
  std::array<std::uint8_t, 8> last_{};  // the frame that ended the sub-block before
  std::uint8_t size_ = 0;
  std::uint8_t good_ = 0;
  std::uint8_t standstill_ = 0;
  bool heard_ = false;
  bool complete_ = false;
  bool lossy_ = false;
};

/// Keeps a few frames of a sub-block in a port's queue, so that it neither runs empty nor fills up: the next burst
/// follows when the first frame of the one before is on the wire. A full queue only delays.
class BlockPump final : private rt::Job, private can::Confirmation {
 public:
  static constexpr unsigned burst = 4;  ///< at most twice as many frames wait in the queue
  class Owner {
   public:
    /// The last segment of the sub-block is on the wire.
    virtual void pumped(rt::Time at) noexcept = 0;
    /// The port takes nothing (any more). `full` when it took nothing within the time-out.
    virtual void stuck(can::Queued why) noexcept = 0;

   protected:
    ~Owner() = default;
  };

  BlockPump(can::Dispatcher& dispatcher, Owner& owner) noexcept : dispatcher_(&dispatcher), owner_(&owner) {}
  /// Sends the sub-block of `sender`, which must stay until `pumped`, `stuck` or `stop`. After `patience` without
  /// progress it calls `stuck`; 0 = never.
  void start(BlockSender& sender, CobId id, rt::Duration patience) noexcept;
  void stop() noexcept;
  [[nodiscard]] bool running() const noexcept { return sender_ != nullptr; }

 private:
  void run() noexcept override;
  void sent(rt::Time at) noexcept override;
  void push() noexcept;
  void wait(rt::Duration time) noexcept;

  can::Dispatcher* dispatcher_;
  Owner* owner_;
  BlockSender* sender_ = nullptr;
  rt::Duration patience_{};
  rt::Time progress_{};
  CobId id_;
  std::uint8_t confirms_ = 0;  // the number of the segment that the confirmation is for
};

}  // namespace berth::co::sdo

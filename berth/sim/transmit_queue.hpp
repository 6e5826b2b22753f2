/// The waiting frames of one controller, and the head: the one that it offers to the bus.
///
/// The queue knows neither bus nor time. The head stays queued while it is on the wire (`sending`), so that a failed
/// attempt is repeated.
#pragma once

#include <cstdint>
#include <vector>

#include "berth/can/packed_frame.hpp"

namespace berth::sim {

/// Selects the queued frame that the controller offers to the bus.
enum class TxOrder : std::uint8_t {
  in_order,  ///< the oldest: a low priority frame delays the ones behind it (priority inversion)
  priority,  ///< the one that would win arbitration; among equals the oldest
};

/// The arbitration field as a number: the lower wins. Base and extended, data and remote compare as on the wire: the
/// bits are ID 28..18, RTR or SRR, IDE, ID 17..0, RTR.
[[nodiscard]] inline std::uint32_t arbitration_field(const can::Frame& f) noexcept {
  const std::uint32_t rtr = f.remote ? 1U : 0U;
  if (!f.extended) return (f.id << 21U) | (rtr << 20U);
  return ((f.id >> 18U) << 21U) | (3U << 19U) | ((f.id & 0x3FFFFU) << 1U) | rtr;
}

class TransmitQueue {
 public:
  struct Waiting {
    can::PackedFrame frame;  ///< only the beginning of an FD frame
    std::uint32_t arbitration = 0;
    std::uint32_t tag = 0;
    std::uint32_t next = 0;  ///< internal: the slot of the next younger one, or the next free slot
    bool tried = false;      ///< an attempt failed: the next one is a retransmission
  };

  /// Room for `depth` frames, at least one; `fd`: FD frames, too.
  TransmitQueue(TxOrder order, unsigned depth, bool fd);

  [[nodiscard]] bool full() const noexcept { return free_ == nothing; }
  /// Number of waiting frames, with the head.
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// True if it is now the head. Must not be `full`.
  [[nodiscard]] bool push(const can::Frame& frame, std::uint32_t tag) noexcept;
  /// Removes the frames with this tag; one that is on the wire is still sent, but not repeated if that fails. True: the
  /// head has changed.
  [[nodiscard]] bool withdraw(std::uint32_t tag) noexcept;
  /// Removes all. Not while `sending`.
  void clear() noexcept;

  [[nodiscard]] bool has_head() const noexcept { return head_ != nothing; }
  [[nodiscard]] const Waiting& head() const noexcept { return slots_[head_]; }
  /// The head as it is sent; an FD frame of a `passive` sender has ESI recessive.
  [[nodiscard]] can::Frame head_frame(bool passive) const noexcept {
    return head().frame.fd() ? head_fd_frame(passive) : head().frame.unpacked();
  }

  /// The head is on the wire.
  [[nodiscard]] bool sending() const noexcept { return sending_; }
  void begin() noexcept { sending_ = true; }
  /// The node ends its activity: nothing of it is on the wire.
  void break_off() noexcept { sending_ = false; }
  /// An error ended the attempt.
  void mark_tried() noexcept { slots_[head_].tried = true; }
  /// The attempt failed. The frame stays queued, unless it was withdrawn, and another may become the head.
  void attempt_over() noexcept;
  /// The head was sent and is removed; returns its tag.
  std::uint32_t sent() noexcept;

 private:
  static constexpr std::uint32_t nothing = 0xFFFF'FFFFU;
  [[nodiscard, gnu::cold]] can::Frame head_fd_frame(bool passive) const noexcept;
  void choose_head() noexcept;
  void take_out(std::uint32_t before, std::uint32_t at) noexcept;
  void take_out_head() noexcept;

  std::uint32_t head_ = nothing;    // slot of the frame offered
  std::uint32_t oldest_ = nothing;  // start of the used slots, linked by `next`
  std::uint32_t youngest_ = nothing;
  std::uint32_t free_ = nothing;  // start of the free slots, linked by `next`
  std::uint32_t size_ = 0;
  TxOrder order_;
  bool sending_ = false;
  bool abandoned_ = false;  // the head was withdrawn while on the wire: it is not repeated
  std::vector<Waiting> slots_;
  std::vector<can::Frame> fd_frames_;  // by slot; empty without FD
};

}  // namespace berth::sim

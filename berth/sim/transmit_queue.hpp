/// Frames of one controller that wait to be sent, and the one that it offers to the bus: the head.
///
/// The queue knows neither bus nor time. The head stays queued while it is on the wire (`sending`), so that an attempt
/// that fails is repeated.
#pragma once

#include <cstdint>
#include <vector>

#include "berth/can/packed_frame.hpp"

namespace berth::sim {

/// Which queued frame the controller offers to the bus.
enum class TxOrder : std::uint8_t {
  in_order,  ///< the oldest: a low priority frame holds up what stands behind it (priority inversion)
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
    can::PackedFrame frame;  ///< of an FD frame only the beginning
    std::uint32_t arbitration = 0;
    std::uint32_t tag = 0;
    std::uint32_t next = 0;  ///< internal: the slot of the next younger one, or the next free slot
    bool tried = false;      ///< an attempt failed: the next one is a retransmission
  };

  /// Room for `depth` frames, at least one; `fd`: FD frames, too.
  TransmitQueue(TxOrder order, unsigned depth, bool fd);

  [[nodiscard]] bool full() const noexcept { return free_ == nothing; }
  /// Frames that wait, the head included.
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// True: it is the head now. Must not be `full`.
  [[nodiscard]] bool push(const can::Frame& frame, std::uint32_t tag) noexcept;
  /// Takes the frames of this tag out; one that is on the wire is sent all the same, and not repeated when that fails.
  /// True: there is another head, or none any more.
  [[nodiscard]] bool withdraw(std::uint32_t tag) noexcept;
  /// All go. Not while `sending`.
  void clear() noexcept;

  [[nodiscard]] bool has_head() const noexcept { return head_ != nothing; }
  [[nodiscard]] const Waiting& head() const noexcept { return slots_[head_]; }
  /// As it goes out now; an FD frame of a `passive` sender with ESI recessive.
  [[nodiscard]] can::Frame head_frame(bool passive) const noexcept {
    return head().frame.fd() ? head_fd_frame(passive) : head().frame.unpacked();
  }

  /// The head is on the wire.
  [[nodiscard]] bool sending() const noexcept { return sending_; }
  void begin() noexcept { sending_ = true; }
  /// The node no longer does what it did: nothing of it is on the wire.
  void break_off() noexcept { sending_ = false; }
  /// An error ended the attempt.
  void mark_tried() noexcept { slots_[head_].tried = true; }
  /// The attempt is over without success. The frame stays queued, unless it was withdrawn, and may give way to another.
  void attempt_over() noexcept;
  /// The head went out and is taken out; its tag.
  std::uint32_t sent() noexcept;

 private:
  static constexpr std::uint32_t nothing = 0xFFFF'FFFFU;
  [[nodiscard, gnu::cold]] can::Frame head_fd_frame(bool passive) const noexcept;
  void choose_head() noexcept;
  void take_out(std::uint32_t before, std::uint32_t at) noexcept;
  void take_out_head() noexcept;

  std::uint32_t head_ = nothing;    // slot of the frame offered
  std::uint32_t oldest_ = nothing;  // from it on by `next`: the slots in use
  std::uint32_t youngest_ = nothing;
  std::uint32_t free_ = nothing;  // from it on by `next`: the others
  std::uint32_t size_ = 0;
  TxOrder order_;
  bool sending_ = false;
  bool abandoned_ = false;  // the head is on the wire and was withdrawn meanwhile: it is not repeated
  std::vector<Waiting> slots_;
  std::vector<can::Frame> fd_frames_;  // by slot; empty without FD
};

}  // namespace berth::sim

/// The last frames of all buses, for a thread beside the executor's: filled on the bus side by four stores a frame,
/// without a lock, a system call or the heap; read by number from any thread, whole or not at all.
///
///     FrameRing ring;
///     ring.put(bus, frame, at, own);               // the executor's thread alone
///     RingFrame frame;
///     if (ring.read(number, frame)) ...            // any thread; false: not there yet, or overwritten
///
/// A record is four words. The first is the frame's number plus one, and 0 while the record is written: a reader takes
/// it before and behind the others, so that it never gives a torn record. 32 bytes a frame: 32 MiB for `standard`.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::studio {

struct RingFrame {
  std::uint64_t number = 0;  ///< from 0, over all buses
  rt::Time at{};             ///< the end of the frame
  std::uint8_t bus = 0;      ///< index among the machine's buses
  bool own = false;          ///< sent by Berth
  bool cut = false;          ///< an FD frame of more than 8 bytes: `frame` has the first 8 of them
  can::Frame frame;          ///< classic: whether it was FD, only `cut` tells
};

class FrameRing {
 public:
  static constexpr std::size_t standard = std::size_t{1} << 20U;  ///< frames
  /// `most` frames, rounded up to a power of two.
  explicit FrameRing(std::size_t most = standard);
  FrameRing(const FrameRing&) = delete;
  FrameRing& operator=(const FrameRing&) = delete;

  /// The one thread that fills it.
  void put(std::uint8_t bus, const can::Frame& frame, rt::Time at, bool own) noexcept;

  /// Frames that came, ever: the number of the next one.
  [[nodiscard]] std::uint64_t next() const noexcept { return next_.load(std::memory_order_acquire); }
  /// The oldest that is still there; by the time it is read, it may not be.
  [[nodiscard]] std::uint64_t first() const noexcept;
  [[nodiscard]] bool read(std::uint64_t number, RingFrame& into) const noexcept;
  [[nodiscard]] std::size_t most() const noexcept { return records_.size(); }

 private:
  struct Record {
    std::atomic<std::uint64_t> stamp{0};  // number + 1; 0: it is being written, or was never
    std::atomic<std::uint64_t> at{0};     // ns of the executor's time
    std::atomic<std::uint64_t> head{0};   // identifier, flags, bus, bytes
    std::atomic<std::uint64_t> data{0};
  };
  static_assert(sizeof(Record) == 32);
  std::vector<Record> records_;
  alignas(64) std::atomic<std::uint64_t> next_{0};
};

}  // namespace berth::studio

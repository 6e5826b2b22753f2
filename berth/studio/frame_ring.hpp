/// The last frames of all buses, for other threads: the bus side writes four words per frame, without a lock, a system
/// call or the heap; any thread can read a frame by number, whole or not at all.
///
///     FrameRing ring;
///     ring.put(bus, frame, at, own);               // the executor's thread alone
///     RingFrame frame;
///     if (ring.read(number, frame)) ...            // any thread; false: not there yet, or overwritten
///
/// A record is four words. The first is the frame's number plus one, and 0 while the record is written: a reader reads
/// it before and after the others, so it never returns a torn record. 32 bytes a frame: 32 MiB for `standard`. The rest
/// of an FD frame beyond 8 bytes is in separate records, one for 16 frames of the ring (4 MiB): only the newest FD
/// frames are complete. Error reports (can/bus_error.hpp) are records like frames, numbered among them.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::studio {

struct RingFrame {
  std::uint64_t number = 0;  ///< from 0, over all buses
  rt::Time at{};             ///< the end of the frame
  std::uint8_t bus = 0;      ///< index among the machine's buses
  bool own = false;          ///< sent by Berth
  bool cut = false;          ///< an FD frame of more than 8 bytes: `frame` has the first 8
  bool fd = false;           ///< an FD frame: `frame` is classic here, `FrameRing::whole` has the original
  bool error = false;        ///< not a frame: `frame` is a report of an error
  std::string_view about{};  ///< error: which node signalled what, if known; lives as long as the ring
  can::Frame frame;
};

class FrameRing {
 public:
  static constexpr std::size_t standard = std::size_t{1} << 20U;  ///< frames
  /// `most` frames, rounded up to a power of two.
  explicit FrameRing(std::size_t most = standard);
  FrameRing(const FrameRing&) = delete;
  FrameRing& operator=(const FrameRing&) = delete;

  /// Call it only in the one writing thread.
  void put(std::uint8_t bus, const can::Frame& frame, rt::Time at, bool own) noexcept;
  /// In the same thread. `about`: readers get the first `most_words` different texts; later ones are omitted.
  void put_error(std::uint8_t bus, const can::Frame& report, rt::Time at, std::string_view about);
  static constexpr std::size_t most_words = 2048;

  /// Total of frames so far: the number of the next one.
  [[nodiscard]] std::uint64_t next() const noexcept { return next_.load(std::memory_order_acquire); }
  /// The oldest one still there; it may be overwritten before it is read.
  [[nodiscard]] std::uint64_t first() const noexcept;
  [[nodiscard]] bool read(std::uint64_t number, RingFrame& into) const noexcept;
  /// An FD frame in its original form; false: it, or its part beyond 8 bytes, was overwritten.
  [[nodiscard]] bool whole(std::uint64_t number, can::Frame& into) const noexcept;
  [[nodiscard]] std::size_t most() const noexcept { return records_.size(); }

 private:
  struct Record {
    std::atomic<std::uint64_t> stamp{0};  // number + 1; 0: it is being written, or was never
    std::atomic<std::uint64_t> at{0};     // ns of the executor's time
    std::atomic<std::uint64_t> head{0};   // identifier, flags, bus, bytes
    std::atomic<std::uint64_t> data{0};
  };
  static_assert(sizeof(Record) == 32);
  struct Rest {
    std::atomic<std::uint64_t> stamp{0};  // as of a record
    std::array<std::atomic<std::uint64_t>, 7> data{};
  };
  static_assert(sizeof(Rest) == 64);
  /// The content of a record.
  struct Words {
    std::uint64_t at = 0, head = 0, data = 0;
  };
  [[nodiscard]] bool take(std::uint64_t number, Words& into) const noexcept;
  void put(std::uint64_t head, rt::Time at, const can::Frame& frame) noexcept;
  void put_rest(std::uint64_t number, const can::Frame& frame) noexcept;
  [[nodiscard]] std::uint64_t word_of(std::string_view about);

  std::vector<Record> records_;
  std::vector<Rest> rests_;
  std::vector<std::string> words_;  // after the first `words_there_` the writer adds; these do not change
  std::map<std::string, std::uint64_t, std::less<>> known_words_;  // the writer's
  std::atomic<std::size_t> words_there_{0};
  alignas(64) std::atomic<std::uint64_t> next_{0};
};

}  // namespace berth::studio

/// A recorded trace: each frame with its bus and time. Plain data; `stream.hpp` reads and writes it in every format,
/// piece by piece, `candump.hpp` whole.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::trace {

/// Of a frame, as seen by the controller that recorded it.
enum class Direction : std::uint8_t { unknown, received, sent };

/// One frame of a trace.
struct Entry {
  /// The end of the frame on the wire, since the recorder's zero: the beginning of a simulated world, or 1970 for a log
  /// of candump.
  rt::Duration at{};
  std::uint16_t bus = 0;  ///< index of `Trace::buses`
  can::Frame frame;
  Direction direction = Direction::unknown;
  /// Not a frame, but SocketCAN's report of an error: `frame.id` has the class bits (without 2000 0000h), `frame.data`
  /// the details as in linux/can/error.h. `read_candump` never returns it.
  bool error = false;
  friend bool operator==(const Entry&, const Entry&) = default;
};

struct Trace {
  std::vector<std::string> buses;  ///< names as written, in the order in which they first appear
  std::vector<Entry> entries;      ///< in the order of the file

  /// The index of a bus, which is added if it is new.
  std::uint16_t bus(std::string_view name);
  friend bool operator==(const Trace&, const Trace&) = default;
};

/// Statistics of one identifier. A period is the time between the ends of two of its frames.
struct IdStatistics {
  std::uint32_t key = 0;  ///< `can::Frame::key`
  std::uint64_t frames = 0;
  std::uint64_t bits = 0;
  rt::Duration shortest{};  ///< period; all 0 if there are fewer than two frames
  rt::Duration average{};
  rt::Duration longest{};
  rt::Duration jitter{};  ///< standard deviation of the periods
  friend bool operator==(const IdStatistics&, const IdStatistics&) = default;
};

/// Statistics of a trace, or of one bus of it. Times are those of the frames' ends.
struct Statistics {
  std::uint64_t frames = 0;
  std::uint64_t bits = 0;         ///< exact lengths with stuff bits and intermission; classic frames only
  std::uint64_t fd_frames = 0;    ///< not counted in `bits`
  rt::Duration first{};           ///< end of the first frame
  rt::Duration last{};            ///< end of the last frame
  rt::Duration longest_gap{};     ///< between the ends of two frames
  std::vector<IdStatistics> ids;  ///< ascending by `key`: base identifiers first

  [[nodiscard]] rt::Duration span() const noexcept { return last - first; }
  /// Share of `span` in which frames were on the wire: the bits of all frames except the first, which ended before it
  /// began. 0 for a span of 0; above 1 if the trace is not from a bus with this bit rate. `bit_rate` in bit/s, not 0.
  [[nodiscard]] double load(std::uint32_t bit_rate) const noexcept;

  std::uint64_t first_bits = 0;  ///< of the first frame
};

/// Counts one bus as its frames come; its memory grows only with the identifiers. Ignores error frames.
class Counter {
 public:
  void add(const Entry& entry);
  [[nodiscard]] Statistics statistics() const;

 private:
  struct Id {
    std::uint64_t frames = 0;
    std::uint64_t bits = 0;
    rt::Duration first{}, last{}, shortest{}, longest{};
    double mean = 0;     // of the periods, ns; with `squares` by Welford's method
    double squares = 0;  // sum of the squares of the deviations from the mean
  };
  Statistics all_;
  std::vector<Id> base_ = std::vector<Id>(can::base_mask + 1);
  std::unordered_map<std::uint32_t, Id> extended_;
};

/// Of all entries of one bus.
[[nodiscard]] Statistics statistics(const Trace& trace, std::uint16_t bus);

}  // namespace berth::trace

/// What goes through a SocketCAN socket, apart from the socket: frames and error frames as bytes, acceptance filters,
/// the kernel's times. Layouts: linux/can.h, linux/can/error.h. Inside of room `io`.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::io {

inline constexpr std::size_t classic_size = 16;  ///< bytes of a `struct can_frame`
inline constexpr std::size_t fd_size = 72;       ///< ... of a `struct canfd_frame`
using KernelFrame = std::array<std::uint8_t, fd_size>;

/// Bytes of it to write, or 0 when it is no frame that a bus could carry.
[[nodiscard]] std::size_t encode_frame(const can::Frame& frame, KernelFrame& bytes) noexcept;
/// Empty for an error frame and for what is no frame.
[[nodiscard]] std::optional<can::Frame> decode_frame(std::span<const std::uint8_t> bytes) noexcept;

/// What an error frame tells.
struct BusReport {
  enum class Level : std::uint8_t { active, warning, passive };
  bool error = false;     ///< an error on the bus, this node's own frames' included
  bool overflow = false;  ///< the controller lost at least one received frame
  bool bus_off = false;
  bool restarted = false;        ///< out of bus-off
  std::optional<Level> level{};  ///< the state that the controller came into
  bool counts = false;  ///< `tec` and `rec` come from the controller; else they are the least that `level` means
  std::uint8_t tec = 0;
  std::uint8_t rec = 0;
};
/// Empty for what is no error frame.
[[nodiscard]] std::optional<BusReport> decode_error(std::span<const std::uint8_t> bytes) noexcept;

/// The same as a frame: the classes (can/bus_error.hpp) and eight bytes of details. Only of what `decode_error` takes.
[[nodiscard]] can::Frame error_frame(std::span<const std::uint8_t> bytes) noexcept;

/// As `struct can_filter`: a frame passes when its can_id and `id` agree in the bits of `mask`.
struct KernelFilter {
  std::uint32_t id = 0;
  std::uint32_t mask = 0;
  friend bool operator==(const KernelFilter&, const KernelFilter&) = default;
};
inline constexpr std::size_t most_filters = 512;  ///< CAN_RAW_FILTER_MAX

/// Filters that pass all frames with keys in these ranges, and as few others as at most `most` (>= 4) filters can say:
/// every base (extended) frame, when its ranges need too many. Data frames of a single identifier are found by the
/// kernel in a table and cost the other sockets of the interface nothing; a filter with a mask costs every frame a
/// comparison, which is why small ranges become single identifiers and one filter passes all remote frames.
[[nodiscard]] std::vector<KernelFilter> kernel_filters(std::span<const can::IdRange> ranges, std::size_t most);

/// The kernel's times of arrival (wall clock) in the loop's time. They never go back, and a wall clock that is set
/// meanwhile moves no frame: its batch then counts as arrived when it was read.
class StampMap {
 public:
  /// Before the times of one batch: the same instant by the loop's clock and by the wall clock (ns).
  void begin(rt::Time loop, std::int64_t wall) noexcept;
  /// The same without the wall clock, whose reading costs as much as a tenth of a frame's whole way: 100 ms long the
  /// two clocks run as they did. False, and nothing begins: that was too long ago, or `stamp`, the batch's last, is
  /// not of the 20 ms before `loop`, so that the wall clock may have been set.
  [[nodiscard]] bool begin_as_before(rt::Time loop, std::optional<std::int64_t> stamp) noexcept;
  /// By the wall clock (ns), when this batch began.
  [[nodiscard]] std::int64_t wall() const noexcept { return wall_; }
  /// The time of a frame of this batch, not after `latest`. No `stamp`: it arrived now.
  [[nodiscard]] rt::Time at(std::optional<std::int64_t> stamp, rt::Time latest) noexcept;
  /// Something else happened at `time`, or when the last frame came if that was later: no frame is earlier from now on.
  rt::Time not_before(rt::Time time) noexcept;

 private:
  rt::Time loop_{};
  std::int64_t wall_ = 0;
  std::optional<std::int64_t> offset_{};  // wall clock minus loop
  rt::Time learnt_{};                     // when both were read
  rt::Time last_ = rt::Time::min();
  bool steady_ = true;
};

}  // namespace berth::io

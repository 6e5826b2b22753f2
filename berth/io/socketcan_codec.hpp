/// The content of a SocketCAN socket: frames and error frames as bytes, acceptance filters, the kernel's times.
/// Layouts: linux/can.h, linux/can/error.h. Internal to room `io`.
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

/// Returns the number of bytes to write, or 0 for a frame that no bus could carry.
[[nodiscard]] std::size_t encode_frame(const can::Frame& frame, KernelFrame& bytes) noexcept;
/// Empty for an error frame and for invalid bytes.
[[nodiscard]] std::optional<can::Frame> decode_frame(std::span<const std::uint8_t> bytes) noexcept;

/// The content of an error frame.
struct BusReport {
  enum class Level : std::uint8_t { active, warning, passive };
  bool error = false;     ///< an error on the bus, this node's own frames' included
  bool overflow = false;  ///< the controller lost at least one received frame
  bool bus_off = false;
  bool restarted = false;        ///< out of bus-off
  std::optional<Level> level{};  ///< the new state of the controller
  bool counts = false;  ///< `tec` and `rec` come from the controller; else they are the least that `level` means
  std::uint8_t tec = 0;
  std::uint8_t rec = 0;
};
/// Empty for anything but an error frame.
[[nodiscard]] std::optional<BusReport> decode_error(std::span<const std::uint8_t> bytes) noexcept;

/// The same as a frame: the classes (can/bus_error.hpp) and eight bytes of details. Only for bytes that `decode_error`
/// accepts.
[[nodiscard]] can::Frame error_frame(std::span<const std::uint8_t> bytes) noexcept;

/// As `struct can_filter`: a frame passes when its can_id and `id` agree in the bits of `mask`.
struct KernelFilter {
  std::uint32_t id = 0;
  std::uint32_t mask = 0;
  friend bool operator==(const KernelFilter&, const KernelFilter&) = default;
};
inline constexpr std::size_t most_filters = 512;  ///< CAN_RAW_FILTER_MAX

/// Filters that pass all frames with keys in these ranges, and as few others as possible with at most `most` (>= 4)
/// filters: every base (extended) frame, if its ranges need too many. The kernel finds data frames of a single
/// identifier in a table, at no cost to other sockets of the interface; a filter with a mask costs every frame a
/// comparison. Therefore small ranges become single identifiers, and one filter passes all remote frames.
[[nodiscard]] std::vector<KernelFilter> kernel_filters(std::span<const can::IdRange> ranges, std::size_t most);

/// Converts the kernel's times of arrival (wall clock) to the loop's time. They never go back. If the wall clock is set
/// meanwhile, no frame moves: its batch then counts as arrived when it was read.
class StampMap {
 public:
  /// Call before the times of one batch: the same instant by the loop's clock and by the wall clock (ns).
  void begin(rt::Time loop, std::int64_t wall) noexcept;
  /// The same without reading the wall clock, which costs as much as a tenth of a frame's whole way: for 100 ms the
  /// difference of the clocks counts as constant. False, and nothing begins: the last reading is too old, or `stamp`,
  /// the batch's last, is not in the 20 ms before `loop`, so that the wall clock may have been set.
  [[nodiscard]] bool begin_as_before(rt::Time loop, std::optional<std::int64_t> stamp) noexcept;
  /// The wall clock (ns) when this batch began.
  [[nodiscard]] std::int64_t wall() const noexcept { return wall_; }
  /// The time of a frame of this batch, not after `latest`. No `stamp`: it arrived now.
  [[nodiscard]] rt::Time at(std::optional<std::int64_t> stamp, rt::Time latest) noexcept;
  /// Another event happened at `time`, or when the last frame came if that was later: later frames get no earlier time.
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

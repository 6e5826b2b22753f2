/// The page of `GET /metrics`, for Prometheus and all that reads its text (docs/metrics.md): figures in, text out.
/// Pure.
///
///     const auto text = metrics_page(about, figures, traffic, Exposition::prometheus);
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/places/slot.hpp"

namespace berth::studio {

/// A metric of the page. A sample's name is this one; a histogram's has `_bucket`, `_sum` or `_count` behind it.
struct Metric {
  std::string_view name;
  std::string_view type;  ///< "counter", "gauge" or "histogram"
  std::string_view help;
};
/// All of them, in the order of the page.
[[nodiscard]] std::span<const Metric> metrics() noexcept;

/// How late timers ran.
class Lateness {
 public:
  static constexpr std::array limits{0.0001, 0.00025, 0.0005, 0.001, 0.0025, 0.005, 0.01,
                                     0.025,  0.05,    0.1,    0.25,  0.5,    1.0};  ///< seconds
  void add(double seconds) noexcept;
  /// How many were this late or less, by limit.
  [[nodiscard]] std::uint64_t within(std::size_t limit) const noexcept;
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  [[nodiscard]] double sum() const noexcept { return sum_; }

 private:
  std::array<std::uint64_t, limits.size()> counts_{};  // of each limit alone
  std::uint64_t count_ = 0;
  double sum_ = 0;
};

/// The states of a bus's port, in words.
inline constexpr std::array<std::string_view, 5> port_states{"active", "warning", "passive", "bus-off", "down"};

struct BusFigures {
  std::string name{};
  bool has_port = false;     ///< false: it is beneath a gateway, and nothing below is known
  std::string_view state{};  ///< one of `port_states`; empty: the port does not say
  std::optional<std::uint8_t> tec{};
  std::optional<std::uint8_t> rec{};
  std::uint64_t errors = 0;    ///< error frames
  std::uint64_t lost = 0;      ///< frames that came, and never reached Berth
  std::uint64_t bus_offs = 0;  ///< how often the port went bus-off
};

struct SlotFigures {
  std::size_t bus = 0;  ///< index of `Figures::buses`
  NodeId id{};
  std::string name{};
  places::SlotState state = places::SlotState::unknown;
  bool required = true;  ///< it is not optional
  // Since Berth began; of no use beneath a gateway.
  std::uint64_t heartbeats_lost = 0;
  std::uint64_t emergencies = 0;
  std::uint64_t boots = 0;
  std::uint64_t mismatches = 0;  ///< values of its configuration that were not as wanted
  bool differs = false;          ///< some still are not
};

/// What the executor tells of the machine.
struct Figures {
  std::vector<BusFigures> buses{};
  std::vector<SlotFigures> slots{};
  Lateness lateness{};
};

/// What the frames of one bus tell.
struct Traffic {
  std::uint64_t frames = 0;
  double busy_s = 0;                            ///< time that they took on the wire
  double load = 0;                              ///< of the last second, 0 to 1
  std::array<std::uint32_t, 128> sdo_aborts{};  ///< by the node-ID of the server
  /// A frame came. `bits`: its length; `bit_rate`: the bus's.
  void add(const can::Frame& frame, unsigned bits, std::uint32_t bit_rate) noexcept;
};

/// What does not change, and how old the figures are.
struct About {
  std::string version{};
  std::string machine{};
  bool simulated = false;
  double start_s = 0;             ///< Unix time
  std::optional<double> age_s{};  ///< empty: there are no figures yet
};

/// Prometheus' text 0.0.4, or OpenMetrics 1.0.
enum class Exposition : std::uint8_t { prometheus, open_metrics };
/// What a client with this header (Accept) gets.
[[nodiscard]] Exposition exposition_for(std::string_view accept) noexcept;
[[nodiscard]] std::string_view content_type(Exposition exposition) noexcept;

/// `traffic`: by the index of the bus; a bus beyond its end had no frames.
[[nodiscard]] std::string metrics_page(const About& about, const Figures& figures, std::span<const Traffic> traffic,
                                       Exposition exposition);

}  // namespace berth::studio

/// The routing database in the gateway's upstream dictionary, so that it is configured like any device's parameters,
/// and the objects by which signals come and go (docs/multilevel.md §Signals). Paper 3 gives them no index.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/multilevel/routing.hpp"
#include "berth/od/description.hpp"
#include "berth/od/values.hpp"

namespace berth::multilevel {

/// Arrays with a sub-index for each signal.
struct RoutingObjects {
  static constexpr std::uint16_t mode = 0x5F10;  ///< UNSIGNED8: the mode now, 0..31; counts at once
  /// UNSIGNED64, see `RouteEntry`; 0: none. Sub-index 0: how many of them count, from the first on.
  static constexpr std::uint16_t routes = 0x5F11;
  static constexpr std::uint16_t budgets = 0x5F12;     ///< UNSIGNED32: longest delay in us; 0: none
  static constexpr std::uint16_t freshness = 0x5F13;   ///< UNSIGNED16: ms; 0: never stale
  static constexpr std::uint16_t stopped = 0x5F14;     ///< UNSIGNED8: 0 hold, 1 substitute, 2 silent; bit 7: `every`
  static constexpr std::uint16_t modes = 0x5F15;       ///< UNSIGNED32: bit m: forwarded in mode m
  static constexpr std::uint16_t substitute = 0x5F16;  ///< UNSIGNED64: its bytes, low ones first
};

/// One row of 5F11h: source in bits 31..0, target in bits 63..32; of each index (31..16), sub-index (15..8) and side
/// (7..0): 0 the upstream one, n the bus beneath port n.
struct RouteEntry {
  std::uint8_t from = 0;
  std::uint8_t to = 0;
  ObjectRef source{};
  ObjectRef target{};
  [[nodiscard]] std::uint64_t raw() const noexcept;
  [[nodiscard]] static RouteEntry of(std::uint64_t raw) noexcept;
  friend bool operator==(const RouteEntry&, const RouteEntry&) = default;
};

/// Where signals of this many bytes (1, 2, 4, 8) have their places on each side: arrays 5F20h to 5F23h. A place takes
/// what an RPDO brings, or holds what a TPDO carries.
[[nodiscard]] std::optional<std::uint16_t> signal_places(unsigned bytes) noexcept;

/// 5F10h to 5F16h with room for `rows` (1..254) signals: of the upstream dictionary.
void add_routing_objects(od::DescriptionBuilder& builder, std::uint8_t rows);
/// 5F20h to 5F23h with `places` (1..254) each, and `pdos` (1..512) TPDOs and RPDOs that are not valid and whose mapping
/// can be written: of every side.
void add_signal_places(od::DescriptionBuilder& builder, std::uint8_t places, unsigned pdos);

/// The rows of the objects, "signal 1" for sub-index 1; empty entries and objects that are not there are none.
[[nodiscard]] std::vector<Signal> read_routes(const od::Values& upstream);

}  // namespace berth::multilevel

/// The routing database in the gateway's upstream dictionary, where it is configured like any device's parameters, and
/// the objects that carry the signals (docs/multilevel.md §Signals). Paper 3 gives them no index.
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
  static constexpr std::uint16_t mode = 0x5F10;  ///< UNSIGNED8: the present mode, 0..31; takes effect at once
  /// UNSIGNED64, see `RouteEntry`; 0: none. Sub-index 0: how many are used, from the first on.
  static constexpr std::uint16_t routes = 0x5F11;
  static constexpr std::uint16_t budgets = 0x5F12;     ///< UNSIGNED32: longest delay in us; 0: none
  static constexpr std::uint16_t freshness = 0x5F13;   ///< UNSIGNED16: ms; 0: never stale
  static constexpr std::uint16_t stopped = 0x5F14;     ///< UNSIGNED8: 0 hold, 1 substitute, 2 silent; bit 7: `every`
  static constexpr std::uint16_t modes = 0x5F15;       ///< UNSIGNED32: bit m: forwarded in mode m
  static constexpr std::uint16_t substitute = 0x5F16;  ///< UNSIGNED64: its bytes, low ones first
};

/// One row of 5F11h: source in bits 31..0, target in bits 63..32; in each, index (31..16), sub-index (15..8) and side
/// (7..0): 0 upstream, n the bus beneath port n.
struct RouteEntry {
  std::uint8_t from = 0;
  std::uint8_t to = 0;
  ObjectRef source{};
  ObjectRef target{};
  [[nodiscard]] std::uint64_t raw() const noexcept;
  [[nodiscard]] static RouteEntry of(std::uint64_t raw) noexcept;
  friend bool operator==(const RouteEntry&, const RouteEntry&) = default;
};

/// The array with the places of signals of this many bytes (1, 2, 4, 8) on each side: 5F20h to 5F23h. A place receives
/// from an RPDO, or holds a value for a TPDO.
[[nodiscard]] std::optional<std::uint16_t> signal_places(unsigned bytes) noexcept;

/// Adds 5F10h to 5F16h with room for `rows` (1..254) signals to the upstream dictionary.
void add_routing_objects(od::DescriptionBuilder& builder, std::uint8_t rows);
/// Adds to a side 5F20h to 5F23h with `places` (1..254) each, and `pdos` (1..512) TPDOs and RPDOs that are not valid
/// and have a writable mapping. Every side needs them.
void add_signal_places(od::DescriptionBuilder& builder, std::uint8_t places, unsigned pdos);

/// The rows in the objects, named "signal 1" for sub-index 1; empty entries and missing objects give none.
[[nodiscard]] std::vector<Signal> read_routes(const od::Values& upstream);

}  // namespace berth::multilevel

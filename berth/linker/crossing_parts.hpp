/// Links across gateways: each becomes a signal on every bus of its way, and a route in every gateway. Between the
/// sources of room `linker`.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "berth/linker/resolve_parts.hpp"

namespace berth::linker {

struct Hop {
  std::size_t gateway = 0;  ///< index in `LinkNetwork::gateways`
  bool down = false;        ///< from the bus above to the one beneath
  friend auto operator<=>(const Hop&, const Hop&) = default;
};
/// From one bus to another; empty ways lead nowhere else. None: no gateway leads there.
[[nodiscard]] std::optional<std::vector<Hop>> way(const LinkNetwork& network, std::size_t from, std::size_t to);
/// Where a gateway receives what goes this way, and the node from which it sends it on: both have descriptions.
[[nodiscard]] std::size_t entry_of(const LinkNetwork& network, Hop hop);
[[nodiscard]] std::size_t exit_of(const LinkNetwork& network, Hop hop);

/// Why the gateways between the two ends cannot carry what the link wants, and what would help; none: they can.
struct CannotCross {
  std::string why;
  std::string fix;
};
[[nodiscard]] std::optional<CannotCross> cannot_cross(const LinkNetwork& network, const Link& link, Consumer from,
                                                      Consumer to, od::DataType type);

/// Replaces each signal that leaves its bus by one on each bus of its way. What has no room in a gateway is told in
/// `findings` and taken out.
[[nodiscard]] std::vector<Route> cross(const LinkNetwork& network, Resolved& resolved, const Earlier& earlier,
                                       Findings& findings);

/// What the plan's PDOs say of the routes and of the links across gateways: `Route::freshness_ms`, and the crossings.
void finish_crossings(const LinkNetwork& network, Plan& plan);

}  // namespace berth::linker

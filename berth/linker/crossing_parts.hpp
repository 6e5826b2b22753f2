/// Links across gateways: each becomes a signal on every bus of its way, and a route in every gateway. Internal to room
/// `linker`.
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
/// The way from one bus to another; empty if they are the same. None: no gateway leads there.
[[nodiscard]] std::optional<std::vector<Hop>> way(const LinkNetwork& network, std::size_t from, std::size_t to);
/// The node where a gateway receives what goes this way, and the node from which it sends it on: both have
/// descriptions.
[[nodiscard]] std::size_t entry_of(const LinkNetwork& network, Hop hop);
[[nodiscard]] std::size_t exit_of(const LinkNetwork& network, Hop hop);

/// Why the gateways between the two ends cannot carry the link, and what would help; none: they can.
struct CannotCross {
  std::string why;
  std::string fix;
};
[[nodiscard]] std::optional<CannotCross> cannot_cross(const LinkNetwork& network, const Link& link, Consumer from,
                                                      Consumer to, od::DataType type);

/// Replaces each signal that leaves its bus by one on each bus of its way. Removes those that have no room in a
/// gateway, with a finding.
[[nodiscard]] std::vector<Route> cross(const LinkNetwork& network, Resolved& resolved, const Earlier& earlier,
                                       Findings& findings);

/// Completes the routes (`Route::freshness_ms`) and the links across gateways from the plan's PDOs.
void finish_crossings(const LinkNetwork& network, Plan& plan);

}  // namespace berth::linker

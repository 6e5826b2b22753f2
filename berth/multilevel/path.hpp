/// The place of a node beneath gateways (paper 3; docs/multilevel.md): `3/5` is node 5 on the bus beneath gateway 3,
/// and `3.2/5` the same if gateway 3 has several buses beneath it and the second is meant.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/ids.hpp"

namespace berth::multilevel {

/// One gateway on the way down.
struct Hop {
  NodeId gateway;         ///< on the bus above
  std::uint8_t port = 1;  ///< which of its buses beneath, 1..`most_ports`
  friend auto operator<=>(const Hop&, const Hop&) noexcept = default;
};
inline constexpr std::uint8_t most_ports = 8;

/// From a starting bus down to a node.
struct Path {
  std::vector<Hop> gateways = {};  ///< topmost first; empty: the node is on this bus
  NodeId node = {};

  /// Number of gateways on the way.
  [[nodiscard]] std::size_t depth() const noexcept { return gateways.size(); }
  friend auto operator<=>(const Path&, const Path&) noexcept = default;
};

/// "3/5", "3.2/5", "5". Empty: an invalid node-ID or port, or other text.
[[nodiscard]] std::optional<Path> parse_path(std::string_view text);
[[nodiscard]] std::string to_string(const Hop& hop);
[[nodiscard]] std::string to_string(const Path& path);

}  // namespace berth::multilevel

/// The layouts of an emergency message that contains its origin in a machine with several buses (paper 3 Figures 5, 7,
/// 8 and 9; docs/multilevel.md §EMCY). The whole machine has one layout. The COB-ID gives the node on the bus where it
/// is heard; the sub-net bytes give the way down from there, nearest to the backbone first, 0 = end (S3.17, S3.19).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/co/emcy.hpp"

namespace berth::multilevel {

/// Named by the paper's figure.
enum class EmcyLayout : std::uint8_t {
  source = 7,           ///< five sub-net bytes: 6 levels
  source_and_exit = 8,  ///< three sub-net bytes, exiting code: 4 levels
  complete = 9,         ///< one sub-net byte, source port, source signal, exiting code: 2 levels
};
/// "figure 7", "figure 8", "figure 9".
[[nodiscard]] std::string_view name(EmcyLayout layout) noexcept;
/// Number of sub-net bytes.
[[nodiscard]] constexpr std::size_t sub_nets(EmcyLayout layout) noexcept {
  return layout == EmcyLayout::source ? 5 : layout == EmcyLayout::source_and_exit ? 3 : 1;
}
/// Levels of buses, including the backbone.
[[nodiscard]] constexpr std::size_t levels(EmcyLayout layout) noexcept { return 1 + sub_nets(layout); }
/// Distinguishable nodes: 127 per level.
[[nodiscard]] constexpr std::uint64_t nodes(EmcyLayout layout) noexcept {
  std::uint64_t count = 1;
  for (std::size_t level = 0; level < levels(layout); ++level) count *= 127;
  return count;
}
/// For a machine with so many levels of buses: the most detailed layout that reaches the deepest node. Deeper than six:
/// Figure 7, which loses the deepest node-IDs.
[[nodiscard]] constexpr EmcyLayout layout_for(std::size_t levels_of_buses) noexcept {
  if (levels_of_buses <= levels(EmcyLayout::complete)) return EmcyLayout::complete;
  return levels_of_buses <= levels(EmcyLayout::source_and_exit) ? EmcyLayout::source_and_exit : EmcyLayout::source;
}
[[nodiscard]] constexpr bool has_exit(EmcyLayout layout) noexcept { return layout != EmcyLayout::source; }

/// A message's content, read by the layout.
struct EmcyReading {
  std::vector<NodeId> path;         ///< the node of the COB-ID first; the last is the producer
  std::uint16_t code = 0;           ///< of the pending error; 0: none, or `exiting` names it
  std::uint8_t error_register = 0;  ///< the producer's
  std::uint16_t exiting = 0;        ///< code of the error that is gone; 0: none, or not in the layout
  std::uint8_t port = 0;            ///< of the producer, 0: not given
  std::uint8_t signal = 0;
  bool garbled = false;  ///< a sub-net byte is not a node-ID, or follows a 0: probably manufacturer data
  friend bool operator==(const EmcyReading&, const EmcyReading&) = default;
};
[[nodiscard]] EmcyReading read_emcy(EmcyLayout layout, NodeId heard_from, const co::Emcy& message);
/// "3/4/5".
[[nodiscard]] std::string path_text(const std::vector<NodeId>& path);

/// A device's message about itself: no sub-nets (S3.19).
struct EmcyDetails {
  std::uint16_t exiting = 0;
  std::uint8_t port = 0;
  std::uint8_t signal = 0;
};
[[nodiscard]] std::array<std::uint8_t, 5> emcy_info(EmcyLayout layout, const EmcyDetails& details) noexcept;

/// The change that a gateway makes to a message of `node` beneath (Figure 6): the sub-net bytes move one place on, the
/// node-ID comes first. False: all places were taken, the deepest node-ID is lost.
bool insert_sub_net(EmcyLayout layout, co::Emcy& message, NodeId node) noexcept;

/// The message as a router of CiA 302-7 forwards it: a new message with code F000h, its own register, and network-ID,
/// node-ID and code of the origin (S3.18, S3.38). A message that has this form already keeps its origin.
[[nodiscard]] co::Emcy routed(const co::Emcy& message, NodeId node, std::uint16_t network,
                              std::uint8_t own_register) noexcept;
inline constexpr std::uint16_t routed_code = 0xF000;
struct RoutedOrigin {
  std::uint16_t network = 0;
  std::uint8_t node = 0;
  std::uint16_t code = 0;
  friend bool operator==(const RoutedOrigin&, const RoutedOrigin&) = default;
};
/// Empty: its code is not F000h.
[[nodiscard]] std::optional<RoutedOrigin> read_routed(const co::Emcy& message) noexcept;

/// Codes of the gateway itself, in the range that CiA 301 leaves to devices; the paper names none.
namespace gateway_code {
inline constexpr std::uint16_t mandatory_bus_failed = 0xFF01, optional_bus_failed = 0xFF02, emcy_lost = 0xFF03,
                               too_deep = 0xFF04, signal_late = 0xFF05, route_wrong = 0xFF06;
}
/// Null: none of these.
[[nodiscard]] const char* gateway_code_text(std::uint16_t code) noexcept;

}  // namespace berth::multilevel

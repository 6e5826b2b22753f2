/// Finds which devices have only one possible slot, and which belong to one question. Devices and slots form a graph;
/// an edge means that the device fits the slot. Pure.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

namespace berth::places {

/// `fits[d]`: the slots, as indices below `slots`, that device d fits.
struct FitGraph {
  std::size_t slots = 0;
  std::vector<std::vector<std::size_t>> fits;
};

/// For each device its slot, if that is the same in every assignment that seats as many devices as possible; none if
/// there is a choice, or no slot. So a device with one possible place gets it without a question, even if only the
/// other devices leave it that one.
[[nodiscard]] std::vector<std::optional<std::size_t>> only_places(const FitGraph& graph);

/// For each slot its device, if all slots and all devices can be paired: the lowest slot gets the lowest device with
/// which the others can still be paired, and so on. Without revisions that distinguish devices this is paper 1's rule
/// 2.
[[nodiscard]] std::optional<std::vector<std::size_t>> pairs_in_order(const FitGraph& graph);

/// Devices and slots that are connected: the choice for one affects the others.
struct FitComponent {
  std::vector<std::size_t> devices;  ///< ascending
  std::vector<std::size_t> slots;    ///< ascending
};
/// Ordered by their first device. Devices and slots without an edge are in none.
[[nodiscard]] std::vector<FitComponent> components(const FitGraph& graph);

}  // namespace berth::places

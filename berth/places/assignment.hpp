/// Which devices have only one place, and which belong to one question: devices and slots as a graph whose edges say
/// that a device fits a slot. Pure.
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

/// For each device the slot that it has in every assignment which seats as many devices as can be seated; none when
/// there is a choice, or no slot. So a device with one possible place gets it without a question, also when only the
/// others leave it that one.
[[nodiscard]] std::vector<std::optional<std::size_t>> only_places(const FitGraph& graph);

/// For each slot its device, when all slots and all devices can be paired: the lowest slot gets the lowest device with
/// which the others can still be paired, and so on. Without revisions that tell devices apart this is paper 1's rule 2.
[[nodiscard]] std::optional<std::vector<std::size_t>> pairs_in_order(const FitGraph& graph);

/// Devices and slots that hang together, so that what one gets says something about the others.
struct FitComponent {
  std::vector<std::size_t> devices;  ///< ascending
  std::vector<std::size_t> slots;    ///< ascending
};
/// In the order of their first device. Devices and slots without an edge are in none.
[[nodiscard]] std::vector<FitComponent> components(const FitGraph& graph);

}  // namespace berth::places

#include "berth/places/assignment.hpp"

#include <algorithm>
#include <numeric>

namespace berth::places {
namespace {

constexpr std::size_t none = static_cast<std::size_t>(-1);

/// A maximum matching, enlarged by augmenting paths (Berge's theorem). With at most 127 slots, nothing faster is
/// needed.
class Matching {
 public:
  explicit Matching(const FitGraph& graph)
      : graph_(graph), slot_of_(graph.fits.size(), none), device_of_(graph.slots, none) {
    for (std::size_t d = 0; d < graph.fits.size(); ++d) grow(d);
  }

  [[nodiscard]] std::size_t slot_of(std::size_t device) const { return slot_of_[device]; }

  /// Is there a matching of the same size without this device's edge? Changes it to that one if there is.
  [[nodiscard]] bool without_edge_of(std::size_t device) {
    const std::size_t slot = slot_of_[device];
    banned_device_ = device;
    banned_slot_ = slot;
    slot_of_[device] = none;
    device_of_[slot] = none;
    bool found = false;
    for (std::size_t d = 0; d < slot_of_.size() && !found; ++d) found = slot_of_[d] == none && grow(d);
    banned_device_ = banned_slot_ = none;
    if (!found) {
      slot_of_[device] = slot;
      device_of_[slot] = device;
    }
    return found;
  }

 private:
  bool grow(std::size_t device) {
    std::vector<bool> seen(graph_.slots, false);
    return grow(device, seen);
  }
  bool grow(std::size_t device, std::vector<bool>& seen) {
    for (const std::size_t slot : graph_.fits[device]) {
      const bool banned = device == banned_device_ && slot == banned_slot_;
      if (seen[slot] || banned) continue;
      seen[slot] = true;
      if (device_of_[slot] != none && !grow(device_of_[slot], seen)) continue;
      slot_of_[device] = slot;
      device_of_[slot] = device;
      return true;
    }
    return false;
  }

  const FitGraph& graph_;
  std::vector<std::size_t> slot_of_;
  std::vector<std::size_t> device_of_;
  std::size_t banned_device_ = none;
  std::size_t banned_slot_ = none;
};

}  // namespace

std::vector<std::optional<std::size_t>> only_places(const FitGraph& graph) {
  std::vector<std::optional<std::size_t>> places(graph.fits.size());
  Matching matching(graph);
  for (std::size_t d = 0; d < graph.fits.size(); ++d) {
    const std::size_t slot = matching.slot_of(d);
    if (slot == none) continue;
    const bool choice = matching.without_edge_of(d);
    if (!choice) places[d] = slot;
  }
  return places;
}

namespace {

bool all_placed(const FitGraph& graph) {
  const Matching matching(graph);
  for (std::size_t d = 0; d < graph.fits.size(); ++d) {
    if (matching.slot_of(d) == none) return false;
  }
  return true;
}

// The graph in which the device fits only this slot, and the slot takes no other device.
FitGraph with_pair(const FitGraph& graph, std::size_t device, std::size_t slot) {
  FitGraph paired = graph;
  for (auto& fits : paired.fits) std::erase(fits, slot);
  paired.fits[device] = {slot};
  return paired;
}

}  // namespace

std::optional<std::vector<std::size_t>> pairs_in_order(const FitGraph& graph) {
  if (graph.slots != graph.fits.size()) return std::nullopt;
  std::vector<std::size_t> device_of(graph.slots);
  std::iota(device_of.begin(), device_of.end(), std::size_t{0});
  const bool as_they_come = std::ranges::all_of(
      device_of, [&](std::size_t d) { return std::ranges::find(graph.fits[d], d) != graph.fits[d].end(); });
  if (as_they_come) return device_of;
  if (!all_placed(graph)) return std::nullopt;
  device_of.clear();
  FitGraph left = graph;
  for (std::size_t slot = 0; slot < graph.slots; ++slot) {
    for (std::size_t d = 0; d < left.fits.size(); ++d) {
      const auto& fits = left.fits[d];
      if (std::ranges::find(fits, slot) == fits.end()) continue;
      FitGraph paired = with_pair(left, d, slot);
      if (!all_placed(paired)) continue;
      left = std::move(paired);
      device_of.push_back(d);
      break;
    }
  }
  return device_of;
}

std::vector<FitComponent> components(const FitGraph& graph) {
  std::vector<FitComponent> found;
  std::vector<bool> known(graph.fits.size(), false);
  for (std::size_t first = 0; first < graph.fits.size(); ++first) {
    if (known[first] || graph.fits[first].empty()) continue;
    known[first] = true;
    FitComponent component{{first}, {}};
    for (std::size_t i = 0; i < component.devices.size(); ++i) {
      for (const std::size_t slot : graph.fits[component.devices[i]]) {
        if (std::ranges::find(component.slots, slot) != component.slots.end()) continue;
        component.slots.push_back(slot);
        for (std::size_t d = 0; d < graph.fits.size(); ++d) {
          const auto& fits = graph.fits[d];
          if (known[d] || std::ranges::find(fits, slot) == fits.end()) continue;
          known[d] = true;
          component.devices.push_back(d);
        }
      }
    }
    std::ranges::sort(component.devices);
    std::ranges::sort(component.slots);
    found.push_back(std::move(component));
  }
  return found;
}

}  // namespace berth::places

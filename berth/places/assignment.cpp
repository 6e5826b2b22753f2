#include "berth/places/assignment.hpp"

#include <algorithm>

namespace berth::places {
namespace {

constexpr std::size_t none = static_cast<std::size_t>(-1);

/// A matching, made larger path by path (Berge's theorem). At most 127 slots, so that nothing quicker is needed.
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

/// Devices without LSS whose node-ID is an object, written as the device library describes (`places::Recipe`).
#pragma once

#include "berth/operate/asking.hpp"
#include "berth/places/recipe_binding.hpp"

namespace berth::operate {

class RecipeSeating {
 public:
  RecipeSeating(BusServices& services, SlotTable& slots, FoundDevices& found, Asking& asking) noexcept
      : s_(services), slots_(slots), found_(found), asking_(asking) {}

  /// All such devices that were found. The turn must be held.
  rt::Task<void> bind_all();

 private:
  [[nodiscard]] Seat* seat_for(const places::Found& found);
  rt::Task<void> bind(Seat& seat, Identity device, NodeId now);
  void not_bound(Seat& seat, const places::RecipeBinding& binding, const std::optional<Error>& store_said);

  BusServices& s_;
  SlotTable& slots_;
  FoundDevices& found_;
  Asking& asking_;
};

}  // namespace berth::operate

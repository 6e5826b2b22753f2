/// Devices of one type without serial numbers. They share one LSS address, so LSS cannot distinguish them: each is
/// known by its node-ID, and without a node-ID it cannot be recognised.
#pragma once

#include "berth/operate/asking.hpp"
#include "berth/operate/planning.hpp"

namespace berth::operate {

class Equals {
 public:
  Equals(BusServices& services, SlotTable& slots, FoundDevices& found, const Planning& planning) noexcept
      : s_(services), slots_(slots), found_(found), planning_(planning) {}

  /// A found device gets the slot back from which one of its kind is absent, if only one slot qualifies; with
  /// one-at-a-time, the lowest of several. The store then has the intention.
  void seat_again();
  /// Its address was found, and a known device with a node-ID has the same address: is this another device, without a
  /// node-ID? If not, it is forgotten. The turn must be held.
  rt::Task<void> look_for_another(const places::Found& found);
  /// The device was to give up its node-ID, and one of its kind appeared without one: that blanking is complete.
  bool came_without(const Identity& device);

 private:
  BusServices& s_;
  SlotTable& slots_;
  FoundDevices& found_;
  const Planning& planning_;
};

}  // namespace berth::operate

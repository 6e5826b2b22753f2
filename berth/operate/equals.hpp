/// Devices of one kind without serial numbers. They have one LSS address, so that LSS does not tell them apart: one is
/// known by its node-ID, and without that nobody knows which it is.
#pragma once

#include "berth/operate/asking.hpp"
#include "berth/operate/planning.hpp"

namespace berth::operate {

class Equals {
 public:
  Equals(BusServices& services, SlotTable& slots, FoundDevices& found, const Planning& planning) noexcept
      : s_(services), slots_(slots), found_(found), planning_(planning) {}

  /// One that was found and is missed by one slot alone, or by the lowest where they come one at a time, is to be that
  /// slot's again: the intention is in the store then.
  void seat_again();
  /// Whether it is another one without a node-ID, when its address was found and is that of one with a node-ID. Else it
  /// is forgotten. The turn must be held.
  rt::Task<void> look_for_another(const places::Found& found);
  /// It was to give its node-ID up, and one of its kind came without: that is finished.
  bool came_without(const Identity& device);

 private:
  BusServices& s_;
  SlotTable& slots_;
  FoundDevices& found_;
  const Planning& planning_;
};

}  // namespace berth::operate

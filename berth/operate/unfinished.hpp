/// What an earlier run, or an earlier attempt of this one, began with a device and did not finish: a node-ID that the
/// device was told to store, or to give up. Its device is looked for; until it is seen, the node-ID stays reserved
/// (paper 1 §III.c; S1.29, S1.53).
#pragma once

#include <vector>

#include "berth/operate/asking.hpp"
#include "berth/operate/bus_services.hpp"
#include "berth/operate/equals.hpp"
#include "berth/operate/erased_node_ids.hpp"
#include "berth/operate/found_devices.hpp"
#include "berth/operate/loans.hpp"
#include "berth/operate/slot_table.hpp"

namespace berth::operate {

class Unfinished {
 public:
  /// All must outlive it.
  Unfinished(BusServices& services, SlotTable& slots, FoundDevices& found, Loans& loans, Asking& asking, Equals& equals,
             ErasedNodeIds& erased) noexcept
      : s_(services), slots_(slots), found_(found), loans_(loans), asking_(asking), equals_(equals), erased_(erased) {}

  /// Asks each such device one question, and adds those that must rest in this round to `avoid`. The turn must be held.
  rt::Task<void> look(std::vector<Identity>& avoid);
  /// The slot reports that its node-ID is reserved, and for which device.
  void keep(Seat& seat);

 private:
  rt::Task<bool> answers_by_lss(Identity device);
  rt::Task<bool> waits_for_its_power_cycle(Seat& seat, bool& told_one);
  rt::Task<void> reset_who_may_be_its_device(Seat& seat);

  BusServices& s_;
  SlotTable& slots_;
  FoundDevices& found_;
  Loans& loans_;
  Asking& asking_;
  Equals& equals_;
  ErasedNodeIds& erased_;
};

/// A device does not use this node-ID any more. It may have answered in place of the slot's device, which then seemed
/// to refuse or to fail a store: that is tried again.
void left_node_id(SlotTable& slots, NodeId id);

}  // namespace berth::operate

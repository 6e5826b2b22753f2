/// `berth status SLOT`: everything known of one slot.
#pragma once

#include <optional>

#include "berth/command/objects.hpp"
#include "berth/command/run.hpp"
#include "berth/places/slot_store.hpp"

namespace berth::command {

/// The slot that "slot" and "bus" of a request mean; else the reason for users.
[[nodiscard]] Checked<const design::Slot*> wanted_slot(const design::Machine& machine, const Request& request);

/// The device's own description: 1008h, 1009h, 100Ah. Empty: not asked, or it has none.
struct DeviceWords {
  std::string name;
  std::string hardware;
  std::string software;
};

/// One JSON object and a line for each fact: state and since when, reason, device and type, boot-up's letter, NMT state
/// and heartbeat, EMCYs, configuration date, the device's own description, the last events and lines of the history.
/// `now`: empty if no process runs the machine.
void tell_slot(const operate::Report& report, const SlotReport& slot, const DeviceWords& says,
               const design::Machine& machine, places::SlotStore& store, std::optional<rt::Time> now, Reply& reply);

}  // namespace berth::command

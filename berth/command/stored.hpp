/// Reports from the slot table and the files beside the machine file alone, while no process runs the machine: no port
/// is opened, and no device is asked.
#pragma once

#include "berth/command/reply.hpp"
#include "berth/design/machine.hpp"
#include "berth/places/slot_store.hpp"

namespace berth::command {

/// "history": which device sat where. Errors in the request, or of the store, are in `reply`.
void tell_history(places::SlotStore& store, const design::Machine& machine, const Request& request, Reply& reply);
/// "report": which device belongs where; no slot is operational, so its status is 1.
void tell_report(places::SlotStore& store, const design::Machine& machine, const Request& request, Reply& reply);
/// "note read", "note write", "note remove": what is known of an object, and a user's notes on it.
void tell_note(const design::Machine& machine, const Request& request, Reply& reply);

}  // namespace berth::command

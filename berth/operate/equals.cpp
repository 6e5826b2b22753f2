#include "berth/operate/equals.hpp"

#include <algorithm>

namespace berth::operate {

// A device without a serial number and node-ID may be the missing one of its kind or a replacement; Berth cannot
// determine which. If several are missing, it may be any of them.
void Equals::seat_again() {
  for (const auto& f : found_.all()) {
    const bool comes =
        !f.device.has_serial() && !f.clone && slots_.of(f.device) == nullptr && !planning_.never_by_lss(f.device);
    const Seat* const own = slots_.at(f.active);
    const bool home = own != nullptr && !f.lent && !own->slot.record.device() && places::fits(own->slot.spec, f.device);
    if (!comes || home) continue;
    std::vector<Seat*> missing;
    for (const auto& seat : slots_.seats()) {
      const auto& record = seat->slot.record;
      const bool misses = seat->life == Life::absent && record.confirmed && !record.intended &&
                          seat->slot.spec.assign == places::Assign::lss && record.confirmed->device.agrees(f.device);
      if (misses) missing.push_back(seat.get());
    }
    const bool in_turn =
        !missing.empty() && missing.front()->slot.spec.when_ambiguous == places::WhenAmbiguous::one_at_a_time;
    if (missing.empty() || (missing.size() > 1 && !in_turn)) continue;
    std::ranges::sort(missing, {}, [](const Seat* s) { return s->id(); });
    Seat& seat = *missing.front();
    const auto asked = slots_.store().ask(seat.slot.record.slot, {seat.slot.record.confirmed->device, seat.id()},
                                          "one of its kind came without this node-ID");
    if (asked) slots_.refresh(seat);
    return;
  }
}

// RAND or a search found only the address of a device without a serial number: it may be one that is known by its
// node-ID.
rt::Task<void> Equals::look_for_another(const places::Found& found) {
  if (found.active.configured()) co_return;
  const LssAddress device = found.device.address;
  const auto another = co_await lss::any_without_node_id(s_.lss, device);
  if (another && !*another) found_.forget(Identity(device));
}

// A device without a serial number is known by the node-ID that it was to give up: without it, it has another identity.
bool Equals::came_without(const Identity& device) {
  const auto* const found = device.has_serial() ? nullptr : found_.of(device.with(NodeId()));
  if (found == nullptr || found->active.configured() || found_.of(device) != nullptr) return false;
  const auto written = slots_.store().confirm_blank(slots_.known(device), "it came without a node-ID");
  if (!written)
    slots_.events().tell(EventKind::error, "", "the slot table cannot be written: " + describe(written.error()));
  return true;
}

}  // namespace berth::operate

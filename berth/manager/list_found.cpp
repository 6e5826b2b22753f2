#include "berth/manager/list_found.hpp"

#include <algorithm>

namespace berth::manager {

void ListFound::note(const places::Found& told) {
  places::Found device = told;
  device.device = known_as(told);
  if (device.device != told.device) forget(told.device);
  if (places::drop_shorter_names(all_, device)) return;
  places::Found* const known = find(device.device);
  if (known == nullptr) {
    all_.push_back(device);
  } else {
    *known = device;
  }
  // A device that appeared during a long search was not asked in this run.
  ListSlot* const slot = slot_at(slots_, device.active);
  if (slot != nullptr && !slot->device && !device.clone && !device.shared) slot->device = device.device;
}

void ListFound::forget(const Identity& device) {
  std::erase_if(all_, [&](const places::Found& f) { return f.device == device; });
}

places::Found* ListFound::find(const Identity& device) noexcept {
  const auto it = std::ranges::find(all_, device, &places::Found::device);
  return it == all_.end() ? nullptr : &*it;
}

places::Found* ListFound::one_for(const Identity& device) noexcept {
  places::Found* const known = find(device);
  if (known != nullptr || device.has_serial()) return known;
  const auto it = std::ranges::find_if(all_, [&](const places::Found& f) {
    return f.device.address == device.address && !f.clone && slot_of(slots_, f.device) == nullptr;
  });
  return it == all_.end() ? nullptr : &*it;
}

Identity ListFound::known_as(const places::Found& f) const noexcept {
  const ListSlot* const slot = f.active.configured() && !f.clone ? slot_at(slots_, f.active) : nullptr;
  if (slot != nullptr && slot->slot.record.confirmed && slot_of(slots_, f.device) == nullptr) {
    const Identity& sits = slot->slot.record.confirmed->device;
    // A device that reports little may match all devices of its maker: the one found with its node-ID may be of another
    // type.
    const bool same = f.device.agrees(sits) && (f.device.unknown != 0 || sits.unknown != 0) &&
                      places::fits(slot->slot.spec, f.device);
    if (same) return sits;
  }
  return f.device.has_serial() || f.clone ? f.device : f.device.with(f.active);
}

bool ListFound::has_equals(const Identity& device, NodeId own) const noexcept {
  if (device.has_serial()) return false;
  const auto equal = [&](const Identity& other) {
    return !other.has_serial() && other.agrees(device) && other.at != device.at && other.at != own;
  };
  return std::ranges::any_of(all_, [&](const places::Found& f) { return equal(f.device); }) ||
         std::ranges::any_of(slots_, [&](const ListSlot& slot) {
           const auto sits = slot.slot.record.device();
           return sits && slot.there && equal(*sits);
         });
}

}  // namespace berth::manager

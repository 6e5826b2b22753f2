#include "berth/operate/found_devices.hpp"

#include <algorithm>

namespace berth::operate {

Identity FoundDevices::known_as(const places::Found& found) const noexcept {
  const Seat* const seat = found.active.configured() && !found.clone ? slots_.at(found.active) : nullptr;
  const bool sits = seat != nullptr && seat->sits(found.device) && slots_.of(found.device) == nullptr;
  const bool same = sits && (found.device.unknown != 0 || seat->slot.record.confirmed->device.unknown != 0);
  if (same) return seat->slot.record.confirmed->device;
  if (found.device.has_serial() || found.clone) return found.device;
  const Identity blank = found.device.with(NodeId());
  const auto* const loan = loans_.of(blank);
  const bool lent = loan != nullptr && loan->id == found.active;
  return lent ? blank : found.device.with(found.active);
}

void FoundDevices::note(const places::Found& told) {
  places::Found found = told;
  found.device = known_as(told);
  if (found.device != told.device) forget(told.device);
  if (places::drop_shorter_names(list_, found)) return;
  const auto [seen, fresh] = first_seen_.try_emplace(found.device, s_.executor.now());
  const auto booted = found.active.configured() ? s_.boots.boot_up(found.active) : std::nullopt;
  if (booted && !loans_.of_ours(found.active, *booted)) seen->second = std::min(seen->second, *booted);
  loans_.seen(found.device);
  std::erase(silent_, found.device);
  if (found.clone && !is_clone(found.device)) clones_.push_back(found.device);
  places::Found noted = found;
  noted.seen = seen->second;
  noted.shared = found.active.configured() && std::ranges::find(shared_, found.device) != shared_.end();
  places::Found* const known = of(found.device);
  if (known == nullptr) {
    list_.push_back(noted);
  } else {
    *known = noted;
  }
}

void FoundDevices::forget(const Identity& device) {
  std::erase_if(list_, [&](const places::Found& f) { return f.device == device; });
}

void FoundDevices::fell_silent(const Identity& device) {
  forget(device);
  if (std::ranges::find(silent_, device) == silent_.end()) silent_.push_back(device);
}

const Identity* FoundDevices::silent_for(const places::SlotSpec& slot) const noexcept {
  const auto it = std::ranges::find_if(silent_, [&](const Identity& device) { return places::fits(slot, device); });
  return it == silent_.end() ? nullptr : &*it;
}

void FoundDevices::forget_who_left() {
  silent_.clear();
  std::erase_if(first_seen_, [&](const auto& seen) { return of(seen.first) == nullptr; });
}

places::Found* FoundDevices::of(const Identity& device) noexcept {
  const auto it = std::ranges::find(list_, device, &places::Found::device);
  return it == list_.end() ? nullptr : &*it;
}

const places::Found* FoundDevices::of(const Identity& device) const noexcept {
  const auto it = std::ranges::find(list_, device, &places::Found::device);
  return it == list_.end() ? nullptr : &*it;
}

Identity FoundDevices::one_for(const Identity& device) const noexcept {
  if (device.has_serial() || of(device) != nullptr) return device;
  const auto it = std::ranges::find_if(list_, [&](const places::Found& f) {
    return f.device.address == device.address && slots_.of(f.device) == nullptr;
  });
  return it == list_.end() ? device : it->device;
}

bool FoundDevices::any_at(NodeId id) const noexcept {
  return std::ranges::find(list_, id, &places::Found::active) != list_.end();
}

bool FoundDevices::uses(const Identity& device, NodeId id) const noexcept {
  return std::ranges::any_of(list_,
                             [&](const places::Found& f) { return f.device == device && f.active == id && !f.clone; });
}

void FoundDevices::mark_loans() {
  for (auto& f : list_) {
    const auto* const loan = loans_.of(f.device);
    f.lent = loan != nullptr && loan->id == f.active;
  }
}

NodeId FoundDevices::active_of(const Identity& device) const noexcept {
  const places::Found* const known = of(device);
  return known == nullptr ? NodeId() : known->active;
}

bool FoundDevices::is_clone(const Identity& device) const noexcept {
  return std::ranges::find(clones_, device) != clones_.end();
}

void FoundDevices::note_shared(const Identity& device) {
  if (std::ranges::find(shared_, device) == shared_.end()) shared_.push_back(device);
  places::Found* const known = of(device);
  if (known != nullptr) known->shared = known->active.configured();
}

void FoundDevices::note_without_rand(const Identity& device) {
  if (!without_rand(device)) without_rand_.push_back(device);
}

bool FoundDevices::without_rand(const Identity& device) const noexcept {
  return std::ranges::find(without_rand_, device) != without_rand_.end();
}

std::vector<LssAddress> FoundDevices::addresses() const {
  std::vector<LssAddress> all;
  for (const auto& [seen, at] : first_seen_) all.push_back(seen.address);
  for (const auto& f : list_) all.push_back(f.device.address);
  return all;
}

}  // namespace berth::operate

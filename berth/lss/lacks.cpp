#include "berth/lss/lacks.hpp"

#include <algorithm>

namespace berth::lss {

bool LackMemory::has(const LssAddress& device, Lackable what) const noexcept {
  const auto entry = std::ranges::find(entries_, device, &Entry::device);
  return entry != entries_.end() && entry->lacks.has(what);
}

bool LackMemory::likely(const LssAddress& device, Lackable what) const noexcept {
  return std::ranges::any_of(entries_, [&](const Entry& e) {
    return e.device.type() == device.type() && e.device.revision == device.revision && e.lacks.has(what);
  });
}

LackMemory::Entry& LackMemory::entry_of(const LssAddress& device) {
  auto entry = std::ranges::find(entries_, device, &Entry::device);
  if (entry == entries_.end()) entry = entries_.insert(entry, Entry{.device = device});
  return *entry;
}

void LackMemory::note(const LssAddress& device, Lackable what) { entry_of(device).lacks.add(what); }

bool LackMemory::is_scanned(const LssAddress& device) const noexcept {
  const auto entry = std::ranges::find(entries_, device, &Entry::device);
  return entry != entries_.end() && entry->scanned;
}

void LackMemory::scanned(const LssAddress& device) { entry_of(device).scanned = true; }

}  // namespace berth::lss

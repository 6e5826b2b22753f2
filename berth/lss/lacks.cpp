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

void LackMemory::note(const LssAddress& device, Lackable what) {
  auto entry = std::ranges::find(entries_, device, &Entry::device);
  if (entry == entries_.end()) entry = entries_.insert(entry, Entry{device, {}});
  entry->lacks.add(what);
}

}  // namespace berth::lss

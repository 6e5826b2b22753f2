#include "berth/sparkplug/backlog.hpp"

namespace berth::sparkplug {
namespace {

std::size_t size_of(const Kept& change) {
  return sizeof change + change.device.size() + change.metric.size() + heap_of(change.value);
}

}  // namespace

bool MemoryBacklog::append(const Kept& change) {
  const auto size = size_of(change);
  if (entries_.size() >= limits_.entries || bytes_ + size > limits_.bytes) return false;
  entries_.emplace(++last_, change);
  bytes_ += size;
  return true;
}

std::vector<Backlog::Entry> MemoryBacklog::after(std::uint64_t id, std::size_t most) const {
  std::vector<Entry> out;
  for (auto at = entries_.upper_bound(id); at != entries_.end() && out.size() < most; ++at) {
    out.push_back({at->first, at->second});
  }
  return out;
}

void MemoryBacklog::drop(std::span<const std::uint64_t> ids) {
  for (const auto id : ids) {
    const auto found = entries_.find(id);
    if (found == entries_.end()) continue;
    bytes_ -= size_of(found->second);
    entries_.erase(found);
  }
}

}  // namespace berth::sparkplug

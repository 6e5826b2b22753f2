#include "berth/sim/contenders.hpp"

namespace berth::sim {

void Contenders::place(std::size_t at, Contender contender) noexcept {
  heap_[at] = contender;
  places_[contender.slot()].at = static_cast<std::uint32_t>(at);
}

// Moves the contender at `at` up or down to where it belongs.
void Contenders::move(std::size_t at) noexcept {
  const Contender moving = heap_[at];
  while (at > 0 && moving.order < heap_[(at - 1) / 2].order) {
    place(at, heap_[(at - 1) / 2]);
    at = (at - 1) / 2;
  }
  const std::size_t count = heap_.size();
  for (std::size_t child = 2 * at + 1; child < count; child = 2 * at + 1) {
    if (child + 1 < count) child += heap_[child + 1].order < heap_[child].order ? 1 : 0;
    if (heap_[child].order >= moving.order) break;
    place(at, heap_[child]);
    at = child;
  }
  place(at, moving);
}

void Contenders::put(std::uint32_t slot, std::uint32_t arbitration) noexcept {
  const Contender contender{static_cast<std::uint64_t>(arbitration) << 32U | slot};
  std::size_t at = places_[slot].at;
  if (at == nowhere) {
    places_[slot].since = starts_;
    at = heap_.size();
    heap_.push_back(contender);
  } else if (heap_[at].order == contender.order) {
    return;
  }
  heap_[at] = contender;
  move(at);
}

std::uint64_t Contenders::remove(std::uint32_t slot) noexcept {
  const std::size_t at = places_[slot].at;
  if (at == nowhere) return 0;
  places_[slot].at = nowhere;
  const Contender last = heap_.back();
  heap_.pop_back();
  if (at != heap_.size()) {
    heap_[at] = last;
    move(at);
  }
  return starts_ - places_[slot].since;
}

}  // namespace berth::sim

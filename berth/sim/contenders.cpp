#include "berth/sim/contenders.hpp"

namespace berth::sim {

inline void Contenders::place(std::size_t at, Contender contender) noexcept {
  heap_[at] = contender;
  places_[contender.slot()].at = static_cast<std::uint32_t>(at);
}

// Puts the contender into the empty place `at`, or above it.
inline void Contenders::rise(std::size_t at, Contender moving) noexcept {
  for (; at > 0 && moving.order < heap_[(at - 1) / 2].order; at = (at - 1) / 2) place(at, heap_[(at - 1) / 2]);
  place(at, moving);
}

// Puts the contender into the empty place `at`, or below it.
inline void Contenders::sink(std::size_t at, Contender moving) noexcept {
  for (std::size_t child = 2 * at + 1; child < count_; child = 2 * at + 1) {
    if (child + 1 < count_) child += heap_[child + 1].order < heap_[child].order ? 1 : 0;
    if (heap_[child].order >= moving.order) break;
    place(at, heap_[child]);
    at = child;
  }
  place(at, moving);
}

void Contenders::put(std::uint32_t slot, std::uint32_t arbitration) noexcept {
  const Contender contender{static_cast<std::uint64_t>(arbitration) << 32U | slot};
  const std::size_t at = places_[slot].at;
  if (at == nowhere) {
    places_[slot].since = starts_;
    rise(count_++, contender);
  } else if (contender.order < heap_[at].order) {
    rise(at, contender);
  } else if (contender.order > heap_[at].order) {
    sink(at, contender);
  }
}

std::uint64_t Contenders::remove(std::uint32_t slot) noexcept {
  const std::size_t at = places_[slot].at;
  if (at == nowhere) return 0;
  places_[slot].at = nowhere;
  const Contender last = heap_[--count_];
  if (at < count_) {
    if (at > 0 && last.order < heap_[at].order) {
      rise(at, last);
    } else {
      sink(at, last);
    }
  }
  return starts_ - places_[slot].since;
}

}  // namespace berth::sim

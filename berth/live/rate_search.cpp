#include "berth/live/rate_search.hpp"

#include <algorithm>

namespace berth::live {

std::optional<std::uint32_t> decide(std::span<const RateHeard> heard) noexcept {
  const RateHeard* best = nullptr;
  for (const auto& h : heard) {
    const bool fits = h.frames >= 2 || (h.frames == 1 && h.errors == 0);
    if (fits && (best == nullptr || h.frames > best->frames)) best = &h;
  }
  return best != nullptr ? std::optional(best->rate) : std::nullopt;
}

bool anything(std::span<const RateHeard> heard) noexcept {
  return std::ranges::any_of(heard, [](const RateHeard& h) { return h.frames > 0 || h.errors > 0; });
}

}  // namespace berth::live

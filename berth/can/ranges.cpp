#include "berth/can/ranges.hpp"

#include <algorithm>
#include <iterator>

namespace berth::can {

std::vector<IdRange> normalised(std::span<const IdRange> ranges) {
  std::vector<IdRange> parts;
  for (const auto& r : ranges) {
    for (const auto& space : {all_base, all_extended}) {
      const IdRange part{std::max(r.first, space.first), std::min(r.last, space.last)};
      if (part.first <= part.last) parts.push_back(part);
    }
  }
  std::ranges::sort(parts, {}, &IdRange::first);
  std::vector<IdRange> merged;
  for (const auto& r : parts) {
    if (!merged.empty() && r.first <= merged.back().last + 1) {
      merged.back().last = std::max(merged.back().last, r.last);
    } else {
      merged.push_back(r);
    }
  }
  return merged;
}

bool contains(std::span<const IdRange> ranges, std::uint32_t key) noexcept {
  const auto after = std::ranges::upper_bound(ranges, key, {}, &IdRange::first);
  return after != ranges.begin() && key <= std::prev(after)->last;
}

bool covers(std::span<const IdRange> outer, std::span<const IdRange> inner) noexcept {
  return std::ranges::all_of(inner, [outer](const IdRange& r) {
    const auto after = std::ranges::upper_bound(outer, r.first, {}, &IdRange::first);
    return after != outer.begin() && r.last <= std::prev(after)->last;
  });
}

}  // namespace berth::can

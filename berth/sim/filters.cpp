#include "berth/sim/filters.hpp"

#include <algorithm>

namespace berth::sim {

void Filters::grow(std::size_t slots) {
  const std::size_t words = (slots + 63) / 64;
  if (words <= words_) return;
  std::vector<std::uint64_t> larger(2048 * words);
  for (std::size_t key = 0; words_ > 0 && key < 2048; ++key) {
    std::copy_n(base_.begin() + static_cast<std::ptrdiff_t>(key * words_), words_,
                larger.begin() + static_cast<std::ptrdiff_t>(key * words));
  }
  base_.swap(larger);
  words_ = words;
  for (auto& cached : cache_) cached.key = 0;
}

void Filters::set(std::uint32_t slot, const std::vector<can::IdRange>& before,
                  const std::vector<can::IdRange>& accept) {
  // Only differences are applied: services add and remove single identifiers. Ranges that overlap are all set anew.
  const std::uint64_t mask = 1ULL << (slot % 64);
  const auto put = [&](const std::vector<can::IdRange>& ranges, const std::vector<can::IdRange>& kept, bool on) {
    for (const auto& range : ranges) {
      if (range.first > can::base_mask || std::ranges::find(kept, range) != kept.end()) continue;
      for (std::uint32_t key = range.first; key <= std::min(range.last, can::base_mask); ++key) {
        auto& word = base_[key * words_ + slot / 64];
        word = on ? word | mask : word & ~mask;
      }
    }
  };
  const auto overlap = [](const can::IdRange& a, const can::IdRange& b) { return b.first <= a.last; };
  const bool plain = std::ranges::adjacent_find(before, overlap) == before.end();
  put(before, plain ? accept : std::vector<can::IdRange>{}, false);
  put(accept, plain ? before : std::vector<can::IdRange>{}, true);
  std::vector<can::IdRange> extended;
  for (const auto& range : accept) {
    if (range.last >= can::extended_flag) extended.push_back(range);
  }
  const auto known = std::ranges::find(extended_, slot, &Extended::slot);
  if (known != extended_.end() ? known->ranges == extended : extended.empty()) return;
  if (known != extended_.end()) extended_.erase(known);
  if (!extended.empty()) extended_.push_back({slot, std::move(extended)});
  for (auto& cached : cache_) cached.key = 0;
}

const std::uint64_t* Filters::find(std::uint32_t key) noexcept {
  if ((key & can::extended_flag) == 0) return base_.data() + key * words_;
  Cached& cached = cache_[(key ^ (key >> 6U) ^ (key >> 18U)) % cache_.size()];
  if (cached.key == key) return cached.nodes.data();
  cached.key = key;
  cached.nodes.assign(words_, 0);
  for (const auto& node : extended_) {
    for (const auto& range : node.ranges) {
      if (range.contains(key)) cached.nodes[node.slot / 64] |= 1ULL << (node.slot % 64);
    }
  }
  return cached.nodes.data();
}

}  // namespace berth::sim

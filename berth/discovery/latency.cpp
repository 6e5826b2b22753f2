#include "berth/discovery/latency.hpp"

#include <algorithm>

namespace berth::discovery {
namespace {
constexpr std::size_t outlier_every = 32;
constexpr rt::Duration grain = std::chrono::microseconds(100);  // what clocks and drivers add
}  // namespace

void Latency::note(rt::Duration sample) noexcept {
  samples_[next_] = std::max(sample, rt::Duration{0});
  next_ = (next_ + 1) % kept;
  count_ = std::min(count_ + 1, kept);
}

// The largest of n samples spread evenly over [a, b] is (b - a) / (n + 1) below b on average. Six times that margin is
// exceeded once in 400 times.
rt::Duration Latency::response(rt::Duration shortest, rt::Duration longest) const noexcept {
  if (count_ == 0) return std::max(shortest, longest);
  auto sorted = samples_;
  std::sort(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(count_));
  std::size_t last = count_ - 1;
  const rt::Duration usual = 2 * sorted[count_ * 3 / 4];
  for (std::size_t i = count_ / outlier_every; i > 0 && sorted[last] > usual; --i) --last;
  const rt::Duration most = sorted[last];
  const auto n = static_cast<std::int64_t>(count_);
  const rt::Duration margin = (n < 3 ? (5 - n) * most : 6 * (most - sorted[0]) / (n - 1)) + grain;
  return std::clamp(most + margin, shortest, std::max(shortest, longest));
}

}  // namespace berth::discovery

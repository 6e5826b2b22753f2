/// Which seeds a campaign has.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace berth::campaign {

/// From `first` to `last`, both included; `last` is not below `first`.
struct Seeds {
  std::uint64_t first = 1;
  std::uint64_t last = 1;
  /// 0 when there are 2^64 of them.
  [[nodiscard]] std::uint64_t count() const noexcept { return last - first + 1; }
  [[nodiscard]] bool has(std::uint64_t seed) const noexcept { return seed >= first && seed <= last; }
};

/// "1..1000" or "17". None: it is neither, or the first is above the last.
[[nodiscard]] std::optional<Seeds> parse_seeds(std::string_view text) noexcept;

}  // namespace berth::campaign

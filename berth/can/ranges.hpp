/// Sets of keys as ranges, for a port's listener.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "berth/can/frame.hpp"

namespace berth::can {

/// The same keys in order, in ranges that neither overlap nor touch. Omits keys that no frame has (above 7FFh, above
/// 1FFF FFFFh of an extended one) and ranges that end before they begin.
[[nodiscard]] std::vector<IdRange> normalised(std::span<const IdRange> ranges);
/// Whether a key is in normalised ranges.
[[nodiscard]] bool contains(std::span<const IdRange> ranges, std::uint32_t key) noexcept;
/// Whether all of `inner` is in `outer`, both normalised.
[[nodiscard]] bool covers(std::span<const IdRange> outer, std::span<const IdRange> inner) noexcept;

}  // namespace berth::can

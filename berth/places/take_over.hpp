/// What a running machine takes over from a changed machine file without a restart.
#pragma once

#include <array>
#include <string_view>

#include "berth/places/slot.hpp"

namespace berth::places {

/// The keys of `[[slot]]` that `take_over` copies.
inline constexpr std::array<std::string_view, 4> taken_over{"spares", "also", "replacement", "when_ambiguous"};

/// Copies what these keys say from `now` into `own`.
void take_over(SlotSpec& own, const SlotSpec& now);

}  // namespace berth::places

/// Live frames for pages: one binary message (docs/api.md). Pure. Internal to room `studio`.
#pragma once

#include <cstdint>
#include <string>

#include "berth/studio/frame_ring.hpp"

namespace berth::studio {

/// Appends the frames from `first` to before `end`, at most 65,535; nothing if none is left. Returns the number of
/// frames overwritten meanwhile.
[[nodiscard]] std::uint64_t append_batch(const FrameRing& ring, std::uint64_t first, std::uint64_t end,
                                         std::string& out);

}  // namespace berth::studio

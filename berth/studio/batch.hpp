/// Frames as pages get them live: one binary message (docs/api.md). Pure. Inside of room `studio`.
#pragma once

#include <cstdint>
#include <string>

#include "berth/studio/frame_ring.hpp"

namespace berth::studio {

/// The frames from `first` to before `end`, at most 65,535 of them; nothing is appended when none is there any more.
/// The number of those that were overwritten meanwhile.
[[nodiscard]] std::uint64_t append_batch(const FrameRing& ring, std::uint64_t first, std::uint64_t end,
                                         std::string& out);

}  // namespace berth::studio

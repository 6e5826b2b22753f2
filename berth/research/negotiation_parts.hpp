/// Shared by the sources of the negotiation.
#pragma once

#include "berth/rt/executor.hpp"

namespace berth::research {

/// Pause before a frame that could not be queued is offered again.
inline constexpr rt::Duration requeue_pause = std::chrono::milliseconds(10);

}  // namespace berth::research

/// Between the sources of the negotiation.
#pragma once

#include "berth/rt/executor.hpp"

namespace berth::research {

/// Before a frame is offered again that could not be queued.
inline constexpr rt::Duration requeue_pause = std::chrono::milliseconds(10);

}  // namespace berth::research

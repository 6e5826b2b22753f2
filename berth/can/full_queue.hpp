/// While the port's queue is full, a service offers its request again until its own time to send is over.
#pragma once

#include <algorithm>
#include <chrono>

#include "berth/rt/executor.hpp"

namespace berth::can {

inline constexpr rt::Duration full_retry = std::chrono::milliseconds(1);

/// When to offer a request again that found the queue full.
[[nodiscard]] inline rt::Time again_at(rt::Time now, rt::Time give_up) noexcept {
  return std::min(now + full_retry, give_up);
}

}  // namespace berth::can

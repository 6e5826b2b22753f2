/// The time of a world.
#pragma once

#include <chrono>

namespace berth::rt {

/// Nanoseconds since the world's beginning; never the wall clock.
using Time = std::chrono::time_point<struct WorldClock, std::chrono::nanoseconds>;
using Duration = std::chrono::nanoseconds;

/// No deadline.
inline constexpr Time never = Time::max();

}  // namespace berth::rt

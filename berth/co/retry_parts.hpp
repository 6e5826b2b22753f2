/// How soon a service offers a frame again after its port refused it.
#pragma once

#include "berth/can/full_queue.hpp"
#include "berth/rt/executor.hpp"

namespace berth::co {

using can::full_retry;                                                           ///< the port is full
inline constexpr rt::Duration dead_port_retry = std::chrono::milliseconds(100);  ///< bus-off, or closed

}  // namespace berth::co

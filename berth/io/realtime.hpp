/// Real-time priority and memory that stays in RAM, for a master of a bus with deadlines of milliseconds.
#pragma once

#include <string>
#include <tl/expected.hpp>

namespace berth::io {

struct RealTime {
  int priority = 0;  ///< SCHED_FIFO, 1 (low) to 99; 0 = leave the scheduling as it is. The kernel's interrupts have 50
  bool lock_memory = false;  ///< present and future memory of the process is never paged out
};

/// For the calling thread (priority; threads that it starts do not inherit it) and the whole process (memory). If a
/// part is refused, nothing is changed; the error says what the system requires.
[[nodiscard]] tl::expected<void, std::string> go_real_time(const RealTime& wanted);

}  // namespace berth::io

#include "berth/fleet/clock.hpp"

#include <algorithm>

namespace berth::fleet {

using std::chrono::duration_cast;
using std::chrono::milliseconds;

sparkplug::Now SystemClock::now() const noexcept {
  const auto utc = duration_cast<milliseconds>(std::chrono::system_clock::now().time_since_epoch()).count();
  return {.utc = {static_cast<std::uint64_t>(std::max<std::int64_t>(utc, 0))},
          .steady = duration_cast<milliseconds>(std::chrono::steady_clock::now().time_since_epoch())};
}

}  // namespace berth::fleet

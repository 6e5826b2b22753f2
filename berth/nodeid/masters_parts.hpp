/// What the masters of RAND and AND and the walk have in common.
#pragma once

namespace berth::nodeid {

/// One address that is found so often in one discovery cannot be silenced.
inline constexpr unsigned most_times_found = 4;

}  // namespace berth::nodeid

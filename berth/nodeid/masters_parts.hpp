/// Shared by the masters of RAND and AND and the walk.
#pragma once

namespace berth::nodeid {

/// A device whose address is found this often in one discovery cannot be silenced.
inline constexpr unsigned most_times_found = 4;

}  // namespace berth::nodeid

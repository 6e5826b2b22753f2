/// What `berth up` and `berth demo` share.
#pragma once

#include "rig.hpp"

namespace berth::cli {

/// Runs the main job, prints what it does and how it ended; the exit status.
int bring_up(const Options& options, const Sources& sources);

/// "(0000000000.215000) field 7E5#0400000000000000".
[[nodiscard]] std::string candump_line(const Recorded& frame);

}  // namespace berth::cli

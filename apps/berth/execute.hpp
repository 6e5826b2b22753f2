/// Carries out one request by the session of a machine run.
#pragma once

#include "interrupt.hpp"
#include "machine_run.hpp"

namespace berth::cli {

/// False, with an empty `reply`, when it was not done:
/// - `limit` passed, or a signal came;
/// - `goes_on` (asked after each instant) said no;
/// - a dry run on real ports, which cannot know what comes next.
[[nodiscard]] bool execute_in(
    MachineRun& run, const command::Request& request, command::Reply& reply, rt::Duration limit,
    const std::function<bool()>& goes_on = [] { return true; });

}  // namespace berth::cli

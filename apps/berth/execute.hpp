/// One request, carried out by the session of a machine run.
#pragma once

#include "interrupt.hpp"
#include "machine_run.hpp"

namespace berth::cli {

/// False when it was not done after `limit`, by a signal, because `goes_on` (asked after each instant) said no, or
/// because a dry run on real ports cannot know what comes next; `reply` is empty then.
[[nodiscard]] bool execute_in(
    MachineRun& run, const command::Request& request, command::Reply& reply, rt::Duration limit,
    const std::function<bool()>& goes_on = [] { return true; });

}  // namespace berth::cli

/// Carries a request out: asks for a confirmation where one is needed, then runs the verb of the table (verbs.hpp).
#pragma once

#include <cstdint>

#include "berth/command/reply.hpp"
#include "berth/rt/task.hpp"
#include "berth/tree/session.hpp"

namespace berth::command {

/// Who has a network's turn, without which nothing of LSS is sent there (`operate::BusServices::turn`).
enum class Turn : std::uint8_t {
  taken_for_it,  ///< by the command, and given back at its end
  held           ///< by who asks, for several LSS services in a row
};

/// Runs one command. `request` and `reply` must stay until the task is done. It waits until the main job has nothing to
/// do on the bus, and may wait for devices: give it a limit from outside, by destroying the task.
[[nodiscard]] rt::Task<void> execute(tree::Session& session, const Request& request, Reply& reply,
                                     Turn turn = Turn::taken_for_it);

}  // namespace berth::command

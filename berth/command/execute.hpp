/// Carries a request out: asks for a confirmation if needed, then runs the verb of the table (verbs.hpp).
#pragma once

#include <cstdint>

#include "berth/command/reply.hpp"
#include "berth/rt/task.hpp"
#include "berth/tree/session.hpp"

namespace berth::command {

/// Which party holds a network's turn, without which no LSS is sent there (`operate::BusServices::turn`).
enum class Turn : std::uint8_t {
  taken_for_it,  ///< the command takes it, and gives it back at its end
  held           ///< the caller holds it, for several LSS services in a row
};

/// Runs one command. `request` and `reply` must outlive the task. It waits until the main job has nothing to do on the
/// bus, and may wait for devices: limit it from outside, by destroying the task.
[[nodiscard]] rt::Task<void> execute(tree::Session& session, const Request& request, Reply& reply,
                                     Turn turn = Turn::taken_for_it);

}  // namespace berth::command

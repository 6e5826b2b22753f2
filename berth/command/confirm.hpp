/// Confirmations by a user before a command is carried out.
#pragma once

#include "berth/command/reply.hpp"
#include "berth/tree/session.hpp"

namespace berth::command {

/// On a real bus (`Session::careful`) a command that disturbs operational devices needs "yes"; "bind" from scratch
/// needs it on every bus. False: it is missing, and `reply` says so.
[[nodiscard]] bool confirmed(tree::Session& session, const Request& request, Reply& reply);

}  // namespace berth::command

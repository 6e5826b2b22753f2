/// What a person confirms before it is carried out.
#pragma once

#include "berth/command/reply.hpp"
#include "berth/tree/session.hpp"

namespace berth::command {

/// On a real bus (`Session::careful`) a command that disturbs operational devices needs "yes", and on every bus so does
/// "bind" from scratch; false: `reply` says so.
[[nodiscard]] bool confirmed(tree::Session& session, const Request& request, Reply& reply);

}  // namespace berth::command

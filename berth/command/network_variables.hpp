/// Network variables of linked machines by their names, as the links name them.
#pragma once

#include <optional>
#include <string>

#include "berth/command/known_object.hpp"
#include "berth/command/nodes.hpp"
#include "berth/design/machine.hpp"

namespace berth::command {

/// The variable that the machine's links make on this node's device, at its place in `link_plan =`, else where the
/// linker puts it now. `word`: its name, in either case. Empty: there is none, or the links are not possible.
[[nodiscard]] std::optional<KnownObject> network_variable(const design::Machine& machine, const NodeArgument& node,
                                                          const std::string& word);

}  // namespace berth::command

/// Machines of a fleet as JSON, for `berth fleet --json` and for Studio's pages. Pure.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "berth/fleet/machines.hpp"

namespace berth::fleet {

/// {"group", "machine", "online", ..., "slots": [...]}
[[nodiscard]] nlohmann::ordered_json machine_json(const MachineView& machine);
/// Back from `machine_json`. Members that are missing or of another kind are empty.
[[nodiscard]] MachineView machine_of_json(const nlohmann::ordered_json& json);

}  // namespace berth::fleet

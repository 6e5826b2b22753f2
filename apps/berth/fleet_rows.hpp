/// Machines of a fleet as rows for people and as JSON for programs. Pure.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "berth/fleet/machines.hpp"
#include "board.hpp"

namespace berth::cli {

/// "2 of 3 machines need somebody", or "all 3 machines are operational".
[[nodiscard]] std::string fleet_headline(const std::vector<fleet::MachineView>& machines);
/// A heading, then a line for each machine; those that need somebody come first, with the reason broken into further
/// lines. `now_ms`: UTC. No line is wider than `columns`.
[[nodiscard]] std::vector<BoardLine> fleet_lines(const std::vector<fleet::MachineView>& machines, std::uint64_t now_ms,
                                                 std::size_t columns);
/// One machine with all its slots.
[[nodiscard]] std::vector<std::string> machine_lines(const fleet::MachineView& machine, std::uint64_t now_ms);

[[nodiscard]] nlohmann::ordered_json machine_json(const fleet::MachineView& machine);
/// Back from `machine_json`. Members that are missing or of another kind are empty.
[[nodiscard]] fleet::MachineView machine_of_json(const nlohmann::ordered_json& json);

}  // namespace berth::cli

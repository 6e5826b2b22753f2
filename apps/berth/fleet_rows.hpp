/// Machines of a fleet as rows for people. Pure.
#pragma once

#include <cstdint>
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

}  // namespace berth::cli

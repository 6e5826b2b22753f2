/// A device's network variables from a plan, for its process image (process/load.hpp).
#pragma once

#include <string_view>
#include <vector>

#include "berth/linker/plan.hpp"
#include "berth/process/network_variables.hpp"

namespace berth::linker {

/// In the plan's order; none: the plan has no variable for that slot.
[[nodiscard]] std::vector<process::NetworkVariable> variables_of(const Earlier& plan, std::string_view slot);

}  // namespace berth::linker

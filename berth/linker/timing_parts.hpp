/// Inhibit and event times from deadlines, and whether the bus keeps them. Internal to room `linker`.
#pragma once

#include "berth/linker/packing_parts.hpp"

namespace berth::linker {

/// Sets the times of `pdos` and each bus's load. True if every deadline is kept.
[[nodiscard]] bool set_times(const LinkNetwork& network, const std::vector<DevicePdos>& devices,
                             const std::vector<Signal>& signals, const std::vector<bool>& linked, Plan& plan,
                             Findings& findings);

}  // namespace berth::linker

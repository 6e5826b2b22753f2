/// Inhibit and event times from deadlines, and whether the bus keeps them. Between the sources of room `linker`.
#pragma once

#include "berth/linker/packing_parts.hpp"

namespace berth::linker {

/// Sets the times of `pdos` and what became of each bus. True when every deadline is kept.
[[nodiscard]] bool set_times(const LinkNetwork& network, const std::vector<DevicePdos>& devices,
                             const std::vector<Signal>& signals, const std::vector<bool>& linked, Plan& plan,
                             Findings& findings);

}  // namespace berth::linker

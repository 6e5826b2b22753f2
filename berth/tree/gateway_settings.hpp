/// The upstream dictionaries of a machine's gateways, so that they follow the machine file for the buses beneath them,
/// whichever master starts them: 5F00h for each of these buses (paper 3: mandatory or optional), 5F03h the layout of
/// EMCYs, 5F04h the gateways beneath them, whose EMCYs have the same layout. Part of their slots' configuration. Pure.
#pragma once

#include <string>

#include "berth/design/machine.hpp"
#include "berth/multilevel/emcy_layout.hpp"
#include "berth/operate/configuring.hpp"

namespace berth::tree {

/// The layout of EMCYs that are forwarded to this bus, on which Berth has a port: by the number of bus levels beneath
/// it.
[[nodiscard]] multilevel::EmcyLayout layout_of(const design::Machine& machine, const std::string& top);

/// The slot is a gateway to a bus on which Berth has no port.
[[nodiscard]] bool is_gateway(const design::Machine& machine, const design::Slot& slot) noexcept;

/// `settings` of the slots of one bus, with those of its gateways added.
[[nodiscard]] manager::SlotSettings with_gateways(const design::Machine& machine, const std::string& bus,
                                                  const manager::SlotSettings& settings);

}  // namespace berth::tree

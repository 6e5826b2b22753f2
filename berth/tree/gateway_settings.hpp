/// What the gateways of a machine shall have in their upstream dictionaries, so that they do what the machine file says
/// of the buses beneath them whoever starts them: 5F00h for each of these buses (paper 3: mandatory or optional), 5F03h
/// the layout of emergencies, 5F04h the gateways beneath them, whose emergencies have it too. Part of what their slots
/// are configured with. Pure.
#pragma once

#include <string>

#include "berth/design/machine.hpp"
#include "berth/multilevel/emcy_layout.hpp"
#include "berth/operate/configuring.hpp"

namespace berth::tree {

/// Of the emergencies that come up to this bus, on which Berth has a port: by the number of buses one beneath the
/// other.
[[nodiscard]] multilevel::EmcyLayout layout_of(const design::Machine& machine, const std::string& top);

/// The slot is a gateway to a bus on which Berth has no port.
[[nodiscard]] bool is_gateway(const design::Machine& machine, const design::Slot& slot) noexcept;

/// `settings` of the slots of one bus, and over them what is wanted of its gateways.
[[nodiscard]] manager::SlotSettings with_gateways(const design::Machine& machine, const std::string& bus,
                                                  const manager::SlotSettings& settings);

}  // namespace berth::tree

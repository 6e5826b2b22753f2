/// The content of a gateway's own NMT master's dictionary for the bus beneath it (CiA 302-2, 302-3): the network list,
/// made from the slots of that bus. Pure.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/design/machine.hpp"
#include "berth/manager/configuration.hpp"
#include "berth/operate/configuring.hpp"

namespace berth::tree {

/// 1016h, 1F22h, 1F26h, 1F27h, 1F80h, 1F81h, 1F84h to 1F87h, 1F89h, 102Ah, 5F02h where expected, and a date for 1020h
/// that changes with any of the others. For each slot, 1F22h has its heartbeat (1017h) and the values of `config =` and
/// `settings`; an unreadable file is reported in `findings` and omitted. A slot of `held_back` is in the list, so that
/// it gets its node-ID, but is not booted. `settings` of `design::gateway_node_name` are further values for the
/// master's own device: its PDOs of links.
[[nodiscard]] manager::Wanted network_list(const design::Bus& bus, std::span<const places::SlotSpec> slots,
                                           std::span<const NodeId> held_back, const manager::SlotSettings& settings,
                                           Findings& findings);

}  // namespace berth::tree

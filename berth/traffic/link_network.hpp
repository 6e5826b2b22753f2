/// A machine file's links and their devices, as input of the object linker.
#pragma once

#include "berth/base/finding.hpp"
#include "berth/design/machine.hpp"
#include "berth/linker/network.hpp"
#include "berth/linker/plan.hpp"
#include "berth/manager/configuration.hpp"

namespace berth::traffic {

struct LinkNetwork {
  linker::LinkNetwork network;
  Findings findings;  ///< errors: description and configuration files that cannot be used
};

/// Reads the slots' configurations (`config =`, a DCF or XDC), else their descriptions (`eds =`, or the library's);
/// applies a concise DCF's values to the description. Other messages on the buses are those of `messages_of`.
[[nodiscard]] LinkNetwork link_network(const design::Machine& machine);

/// The plan on which this machine's links are based (`link_plan =`). An empty one without the key, or if the file does
/// not exist yet; none if a finding is an error.
[[nodiscard]] std::optional<linker::Earlier> earlier_plan(const design::Machine& machine, Findings& findings);

/// The links as `berth up` plans them.
struct LinkPlan {
  linker::LinkNetwork network;  ///< nodes and links as the machine's slots and links, in their order;
                                ///< after them gateways' own nodes on buses beneath (`design::gateway_node_name`)
  linker::Plan plan;            ///< usable only without errors
  Findings findings;            ///< errors: unusable files, impossible links
};
[[nodiscard]] LinkPlan plan_links(const design::Machine& machine);

/// The settings that the links need in the devices, for `berth up`. For a plan without errors.
[[nodiscard]] manager::SlotSettings settings_of(const LinkPlan& links);

}  // namespace berth::traffic

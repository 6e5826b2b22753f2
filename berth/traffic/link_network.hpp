/// The links of a machine file, and the devices that they lead to, as the object linker wants them.
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

/// Reads the slots' configurations (`config =`, a DCF or XDC), else their descriptions (`eds =`, or the library's); a
/// concise DCF's values go into the description. What else is on the buses is as `messages_of` has it.
[[nodiscard]] LinkNetwork link_network(const design::Machine& machine);

/// The plan that this machine's links go on from (`link_plan =`). Without the key, and where the file is not there yet,
/// an empty one; none with a finding that is an error.
[[nodiscard]] std::optional<linker::Earlier> earlier_plan(const design::Machine& machine, Findings& findings);

/// What `berth up` makes of the links.
struct LinkPlan {
  linker::LinkNetwork network;  ///< nodes and links as the machine's slots and links, in their order;
                                ///< after them gateways' own nodes on buses beneath (`design::gateway_node_name`)
  linker::Plan plan;            ///< of use without errors only
  Findings findings;            ///< errors: files that cannot be used, links that cannot be
};
[[nodiscard]] LinkPlan plan_links(const design::Machine& machine);

/// What the links want of the devices, so that `berth up` brings it into them. Of a plan without errors.
[[nodiscard]] manager::SlotSettings settings_of(const LinkPlan& links);

}  // namespace berth::traffic

/// The links of a machine file, and the devices that they lead to, as the object linker wants them.
#pragma once

#include "berth/base/finding.hpp"
#include "berth/design/machine.hpp"
#include "berth/linker/network.hpp"

namespace berth::command {

struct LinkNetwork {
  linker::Network network;
  Findings findings;  ///< errors: description and configuration files that cannot be used
};

/// Reads the slots' configurations (`config =`, a DCF or XDC), else their descriptions (`eds =`, or the library's); a
/// concise DCF's values go into the description. What else is on the buses is as `messages_of` has it.
[[nodiscard]] LinkNetwork link_network(const design::Machine& machine);

}  // namespace berth::command

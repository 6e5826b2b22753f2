/// The diagnosis and error interface of paper 5 §4 for who runs the manager in his own program: the state of a bus and
/// of its nodes as one structure without pointers, the same that a device's process image has (process/process.h).
///
///     const auto now = tree::diagnosis_of(session, "field");
///     if (now.nodes[5].configuration == BERTH_CONFIGURED) ...
///     image.network().diagnosis() = now;                          // for a run-time system in another process
#pragma once

#include <string_view>

#include "berth/process/process.h"
#include "berth/tree/session.hpp"

namespace berth::tree {

/// As it is now; an empty name means the only bus. Of a bus that the machine does not have: nothing is known. Nodes
/// without a slot, and the manager's own device, have `nmt_state` 255; of EMCY equal ones, one after the other, are
/// counted. Each entry of `configuration` is of a slot's state:
/// empty, absent: `BERTH_NO_DEVICE`; binding, present, configuring: `BERTH_CONFIGURING`; operational:
/// `BERTH_CONFIGURED`; question, power cycle, failed, duplicate, wrong type: `BERTH_REFUSED`.
[[nodiscard]] berth_diagnosis diagnosis_of(Session& session, std::string_view bus);

}  // namespace berth::tree

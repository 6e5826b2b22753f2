/// The diagnosis and error interface of paper 5 §4 for programs that run the manager themselves: the state of a bus
/// and its nodes as one structure without pointers, like that in a device's process image (process/process.h).
///
///     const auto now = tree::diagnosis_of(session, "field");
///     if (now.nodes[5].configuration == BERTH_CONFIGURED) ...
///     image.network().diagnosis() = now;                          // for a run-time system in another process
#pragma once

#include <string_view>

#include "berth/process/process.h"
#include "berth/tree/session.hpp"

namespace berth::tree {

/// The present state; an empty name means the only bus. Of an unknown bus nothing is known. Nodes without a slot, and
/// the manager's own device, have `nmt_state` 255; equal EMCYs, one after the other, are counted. Each entry of
/// `configuration` follows from a slot's state:
/// - empty, absent: `BERTH_NO_DEVICE`
/// - binding, present, configuring: `BERTH_CONFIGURING`
/// - operational: `BERTH_CONFIGURED`
/// - question, power cycle, failed, duplicate, wrong type: `BERTH_REFUSED`
[[nodiscard]] berth_diagnosis diagnosis_of(Session& session, std::string_view bus);

}  // namespace berth::tree

/// Helpers that build and word findings. Only the sources of `diagnose` and `silence` include this.
#pragma once

#include <string>
#include <vector>

#include "berth/doctor/diagnosis.hpp"
#include "berth/doctor/heard.hpp"

namespace berth::doctor {

/// With the name of the node's slot, if it has one.
[[nodiscard]] Diagnosis finding(const Expected& expected, Kind kind, Certainty certainty, NodeId node = NodeId());
/// Adds how often it was heard, and when first and last.
void when(Diagnosis& diagnosis, const Count& count);

/// "node 4 (valve)", "node 127 (the master)".
[[nodiscard]] std::string who(const Expected& expected, NodeId node);
/// "3 times, from 0.100 s to 2.500 s".
[[nodiscard]] std::string times(const Count& count);
/// "2, 3".
[[nodiscard]] std::string list(const std::vector<NodeId>& nodes);
[[nodiscard]] double in_seconds(rt::Time at) noexcept;
[[nodiscard]] double in_ms(rt::Duration time) noexcept;

}  // namespace berth::doctor

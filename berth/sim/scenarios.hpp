/// Two textbook scenes of fault confinement, step by step, as `berth sim` prints them (facts page G.2, G.3).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "berth/sim/controller.hpp"

namespace berth::sim {

struct NodeStep {
  std::string name;
  std::uint16_t tec = 0;
  std::uint16_t rec = 0;
  ErrorState state = ErrorState::active;
};

/// One event and the counters after it.
struct Step {
  std::uint64_t bit = 0;  ///< bit times since the beginning
  std::string event;
  std::vector<NodeStep> nodes;
};

[[nodiscard]] const char* name(ErrorState state) noexcept;  ///< "active", "passive", "bus-off"

/// Two nodes send different data under one identifier at the same instant; a third listens. 16 collisions raise both
/// transmitters to TEC 128; in the 17th the one that detects first signals passively and the other succeeds.
[[nodiscard]] std::vector<Step> two_with_one_id();

/// One node sends on a bus without others: nobody acknowledges; TEC rises to 128 in 16 attempts and stays there, never
/// bus-off. `attempts` are shown.
[[nodiscard]] std::vector<Step> lone_node(unsigned attempts = 20);

}  // namespace berth::sim

/// One seeded world from beginning to end, with its invariants checked after every change (docs/faults.md).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/harness/world_plan.hpp"

namespace berth::harness {

struct Outcome {
  std::string failure;  ///< empty: good
  std::uint64_t hash = 0;
  rt::Duration bus_time{0};                   ///< of the whole world
  std::optional<rt::Duration> operational{};  ///< bus time at which every bus was operational for the first time
  std::uint64_t frames = 0;                   ///< on all buses, without error
  std::uint64_t lost = 0;                     ///< receptions that devices lost: overrun, or deaf
  std::array<std::array<unsigned, columns>, world_fault_kinds> hits{};
  std::array<std::array<unsigned, steps>, step_kinds> step_hits{};
  std::vector<plant::PlantEvent> events;  ///< what happened, when: replays this run
  std::string log;
};

/// Runs it; the same plan gives the same outcome. `frames`: the log has every frame too.
[[nodiscard]] Outcome run_world(const WorldPlan& plan, bool frames = false);

}  // namespace berth::harness

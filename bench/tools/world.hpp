/// Worlds of simulated devices for the benches.
#pragma once

#include <memory>
#include <string>

#include "berth/design/machine.hpp"
#include "berth/plant/world.hpp"
#include "berth/rt/scope.hpp"

namespace berth::bench {

inline constexpr const char* bus_name = "bench";

/// A plant of `count` devices on one bus, all of one type with serial numbers 1, 2, ...; node-IDs 1, 2, ... when
/// `configured`, else blank.
[[nodiscard]] plant::PlantFile plant_of(unsigned count, bool configured, plant::Duration response);
/// The machine for such a plant: slots s1, s2, ... with node-IDs 1, 2, ..., each for any of its devices.
[[nodiscard]] design::Machine machine_of(unsigned slots, std::uint32_t bit_rate);
/// A plant's world, started; ends the program when it cannot be made.
[[nodiscard]] std::unique_ptr<plant::World> start(const plant::PlantFile& plant, std::uint32_t bit_rate);

/// Runs a task to its end; false when it took longer than `limit` in the world.
bool run(sim::World& world, rt::Task<void> task, rt::Duration limit);

/// The folder with vendors' device descriptions: BERTH_EDS_DIR, else ../shared/eds; empty when there is none.
[[nodiscard]] std::string eds_folder();

}  // namespace berth::bench

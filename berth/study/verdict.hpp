/// Compares a run's result with the truth of its world: a figure counts only if every device is as the run was to make
/// it.
#pragma once

#include <string>
#include <vector>

#include "berth/places/slot.hpp"
#include "berth/study/reproduce.hpp"
#include "berth/study/stage.hpp"

namespace berth::study {

/// How permanently a device must have its node-ID at the end.
enum class Hold : std::uint8_t {
  pending,  ///< comes into use at the next reset communication
  active,   ///< in use
  stored,   ///< in use, and loaded at the next power-on
};

/// A line for each device that lacks the node-ID it was given, has one without being given it, or shares one: "d3:
/// node-ID 30 pending, 3 was given". Empty: no differences.
[[nodiscard]] std::vector<std::string> differences(Stage& stage, const std::vector<places::Assignment>& given,
                                                   Hold hold);
/// A line for each device that is not in `found`, and for each of `found` that is not a device.
[[nodiscard]] std::vector<std::string> differences(Stage& stage, const std::vector<LssAddress>& found);

/// Node-IDs from `first` on for the devices of a stage, in the order of the plant.
[[nodiscard]] std::vector<places::Assignment> seats_from(Stage& stage, unsigned first);

/// Records the errors of the run with this name; false if there are any.
bool right(Figures& figures, const std::string& name, const std::vector<std::string>& differences);

}  // namespace berth::study

/// What a run has come to, held against the truth of its world: a figure counts only when every device is what the run
/// was to make of it.
#pragma once

#include <string>
#include <vector>

#include "berth/places/slot.hpp"
#include "berth/study/reproduce.hpp"
#include "berth/study/stage.hpp"

namespace berth::study {

/// How firmly a device has to have its node-ID at the end.
enum class Hold : std::uint8_t {
  pending,  ///< it would come into use at the next reset communication
  active,   ///< in use
  stored,   ///< in use, and what the next power-on would load
};

/// A line for each device that has not the node-ID it was given, that has one and was given none, or that shares one:
/// "d3: node-ID 30 pending, 3 was given". Empty: all is as it should be.
[[nodiscard]] std::vector<std::string> differences(Stage& stage, const std::vector<places::Assignment>& given,
                                                   Hold hold);
/// A line for each device that is not among `found`, and for each of `found` that is no device.
[[nodiscard]] std::vector<std::string> differences(Stage& stage, const std::vector<LssAddress>& found);

/// Node-IDs from `first` on for the devices of a stage, in the order of the plant.
[[nodiscard]] std::vector<places::Assignment> seats_from(Stage& stage, unsigned first);

/// Keeps what is wrong with the run of this name; false when anything is.
bool right(Figures& figures, const std::string& name, const std::vector<std::string>& differences);

}  // namespace berth::study

/// Whether a configuration fits the device of a slot.
#pragma once

#include <string>

#include "berth/manager/configuration.hpp"
#include "berth/places/slot.hpp"

namespace berth::operate {

/// Why the configuration does not fit the slot's device: it names another type, device type or revision. Empty: it
/// fits.
[[nodiscard]] std::string not_for(const places::SlotSpec& slot, const manager::Configuration& configuration);

}  // namespace berth::operate

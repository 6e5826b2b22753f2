/// Whether a configuration is one for the device of a slot.
#pragma once

#include <string>

#include "berth/manager/configuration.hpp"
#include "berth/places/slot.hpp"

namespace berth::operate {

/// Why this is no configuration for the slot's device: of another type, device type or revision, as far as it says
/// them. Empty: it is one.
[[nodiscard]] std::string not_for(const places::SlotSpec& slot, const manager::Configuration& configuration);

}  // namespace berth::operate

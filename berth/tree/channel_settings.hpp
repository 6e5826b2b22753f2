/// What the devices of the machine's `[[channel]]`s shall have in their SDO parameters: part of what their slots are
/// configured with, so that a replacement has them, too. Pure.
#pragma once

#include <string>

#include "berth/design/machine.hpp"
#include "berth/operate/configuring.hpp"

namespace berth::tree {

/// `settings` of the slots of one bus, and over them the channels that begin or end there. A slot without `config =`
/// whose description is known has no other channel on a bus that has planned ones: it may have saved an earlier one.
[[nodiscard]] manager::SlotSettings with_channels(const design::Machine& machine, const std::string& bus,
                                                  manager::SlotSettings settings);

/// The slot's device is configured for them: it is an end of one, or may still have an end of another.
[[nodiscard]] bool has_channels(const design::Machine& machine, const design::Slot& slot);

}  // namespace berth::tree

/// The SDO parameters for the devices of the machine's `[[channel]]`s. They are part of their slots' configuration, so
/// that a replacement gets them, too. Pure.
#pragma once

#include <string>

#include "berth/design/machine.hpp"
#include "berth/operate/configuring.hpp"

namespace berth::tree {

/// `settings` of the slots of one bus, with the channels that begin or end there added. On a bus with planned channels,
/// a slot without `config =` whose description is known gets no other channel: it may have saved an earlier one.
[[nodiscard]] manager::SlotSettings with_channels(const design::Machine& machine, const std::string& bus,
                                                  manager::SlotSettings settings);

/// The slot's device is configured for them: it is an end of one, or may still have an end of another.
[[nodiscard]] bool has_channels(const design::Machine& machine, const design::Slot& slot);

}  // namespace berth::tree

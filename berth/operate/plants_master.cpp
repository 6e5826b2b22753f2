#include "berth/operate/plants_master.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth::operate {

bool may_be_plants_master(const BusServices& services, const SlotTable& slots, const places::Found& found,
                          bool awaited) {
  if (!found.active.configured() || found.clone || services.boots.beats(found.active) == 0) return false;
  const bool in_the_way = found.active == services.bus.master || slots.at(found.active) != nullptr;
  if (in_the_way && services.may_command()) return false;
  const bool ours = slots.of(found.device) != nullptr || awaited;
  return !ours && std::ranges::none_of(slots.seats(), [&](const auto& seat) {
    const auto& spec = seat->slot.spec;
    return spec.type == found.device.type() || places::fits(spec, found.device);
  });
}

std::string text_of_plants_master(const places::Found& found) {
  return fmt::format(
      "node {} ({}) sends a heartbeat, and this machine has no slot for its type: it may be the master of this plant, "
      "and is left alone; add a slot if it is a device of this machine",
      found.active.value(), to_string(found.device));
}

}  // namespace berth::operate

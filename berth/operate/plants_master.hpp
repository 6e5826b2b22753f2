/// A node that may be the master of the plant: taking it off the bus, or its node-ID away, stops a plant.
#pragma once

#include "berth/operate/bus_services.hpp"
#include "berth/operate/slot_table.hpp"
#include "berth/places/plan.hpp"

namespace berth::operate {

/// It has a node-ID, sends a heartbeat, and no slot takes its type. Berth sends it nothing by LSS, unless it is in the
/// way of a Berth that is the master. `awaited`: work begun with it on this bus is unfinished.
[[nodiscard]] bool may_be_plants_master(const BusServices& services, const SlotTable& slots, const places::Found& found,
                                        bool awaited);

/// The advice for such a node instead of "take it off the bus".
[[nodiscard]] std::string text_of_plants_master(const places::Found& found);

}  // namespace berth::operate

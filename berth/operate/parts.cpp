#include "berth/operate/parts.hpp"

#include <utility>

namespace berth::operate {

NetworkParts::NetworkParts(rt::Executor& executor, can::Port& port, std::string machine, const design::Bus& line,
                           std::vector<places::SlotSpec> specs, places::SlotStore& store, NetworkObserver observer,
                           co::HeartbeatConsumer::Observer& heartbeats, co::GuardingMaster::Observer& guarding,
                           co::EmcyConsumer::Observer& emcys)
    : bus(executor, port, line, heartbeats, guarding, emcys),
      slots(bus, std::move(machine), std::move(specs), store, std::move(observer)),
      agenda(executor, line.discovery),
      startup(bus, slots),
      loans(store, slots.bus()),
      found(bus, slots, loans),
      asking(bus, slots, found),
      lending(bus, slots, agenda, found, loans, asking),
      duplicates(bus, slots, agenda, found, asking),
      places(bus, slots, agenda, found, asking, lending),
      configuring(bus, slots),
      presence(bus, slots, agenda, found, erased, asking, places, configuring),
      planning(bus, slots, agenda, found, loans),
      finding{ConfiguredFinder(bus, slots, agenda, found, loans, asking, duplicates, presence, planning),
              Search(bus, slots, agenda, found, lending),
              Finder(bus, slots, agenda, found, asking, places, finding.configured, finding.search)},
      seating(bus, slots, agenda, found, loans, asking, lending, places, presence, planning, erased),
      recipes(bus, slots, found, asking),
      spares(bus, slots, agenda, asking, configuring, presence, planning, seating, erased),
      starter(bus, slots, agenda, startup, asking, configuring, spares, presence),
      supervision(bus, slots, agenda, loans, startup, presence, seating, spares) {
  configuring.set_asker(presence);
  seating.set_starter(starter);
}

}  // namespace berth::operate

#include "berth/tree/way.hpp"

namespace berth::tree {

Way way_to(const design::Machine& machine, const std::string& bus) {
  Way way{bus};
  const design::Bus* at = machine.bus(bus);
  while (at != nullptr && !at->own_port && at->gateway) {
    way.gateways.insert(way.gateways.begin(), {at->gateway->slot, at->gateway->port});
    way.bus = at->gateway->bus;
    at = machine.bus(way.bus);
  }
  return way;
}

const design::Bus* bus_at(const design::Machine& machine, const Way& way) noexcept {
  const design::Bus* at = machine.bus(way.bus);
  for (const auto& hop : way.gateways) {
    if (at != nullptr) at = machine.bus_beneath(*at, hop.gateway.value(), hop.port);
  }
  return at;
}

}  // namespace berth::tree

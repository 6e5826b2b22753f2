#include "berth/tree/emcy_origins.hpp"

#include <algorithm>
#include <span>

#include "berth/tree/way.hpp"

namespace berth::tree {

EmcyOrigins origins_of(const design::Machine& machine, const std::string& top, multilevel::EmcyLayout layout,
                       const multilevel::EmcyReading& reading) {
  EmcyOrigins origins;
  // Invalid sub-net bytes identify only the node that was heard.
  const auto path = std::span(reading.path).first(reading.garbled ? 1 : reading.path.size());
  origins.may_be_deeper = reading.garbled || path.size() >= multilevel::levels(layout);
  for (const auto& bus : machine.beneath) {
    const Way way = way_to(machine, bus.name);
    const auto common = std::min(way.gateways.size(), path.size());
    const auto hops = std::span(way.gateways).first(common);
    if (way.bus != top || !std::ranges::equal(hops, path.first(common), {}, &multilevel::Hop::gateway)) continue;
    const bool is_beneath = way.gateways.size() >= path.size();
    if (!is_beneath && way.gateways.size() + 1 != path.size()) continue;
    for (const auto& slot : machine.slots) {
      if (slot.spec.name.bus != bus.name) continue;
      if (is_beneath) origins.beneath.push_back(&slot);
      if (!is_beneath && slot.spec.id == path.back()) origins.named.push_back(&slot);
    }
  }
  return origins;
}

}  // namespace berth::tree

#include "berth/studio/stock.hpp"

#include <algorithm>

namespace berth::studio {

Stock::Stock(tree::Session& session, const Link& link) : session_(&session), link_(&link) {
  for (const auto* const bus : session.machine().all_buses()) buses_.emplace_back(bus->name);
  for (const auto& slot : session.machine().slots)
    optional_.emplace(std::pair(std::string_view(slot.spec.name.bus), slot.spec.id.value()), slot.spec.optional);
}

BusFigures Stock::bus(std::size_t index) const {
  BusFigures figures{.name = std::string(buses_[index])};
  auto* const network = session_->network(buses_[index]);
  if (network == nullptr || index >= Link::most_buses) return figures;
  const BusHealth& health = link_->health[index];
  figures.has_port = true;
  if (const auto state = BusHealth::unpacked(health.state.load(std::memory_order_relaxed))) {
    figures.state = state->word();
    if (state->counts) figures.tec = state->tec, figures.rec = state->rec;
  }
  figures.errors = health.errors.load(std::memory_order_relaxed);
  figures.lost = network->services().port.status().lost;
  figures.bus_offs = statistics_of(*network).bus_offs;
  return figures;
}

Figures Stock::take(const std::vector<operate::SlotReport>& slots) const {
  Figures figures{.lateness = lateness_};
  std::vector<const operate::BusStatistics*> statistics;
  for (std::size_t i = 0; i < buses_.size(); ++i) {
    figures.buses.push_back(bus(i));
    auto* const network = session_->network(buses_[i]);
    statistics.push_back(network == nullptr ? nullptr : &statistics_of(*network));
  }
  figures.slots.reserve(slots.size());
  for (const auto& slot : slots) {
    const auto at = std::ranges::find(buses_, std::string_view(slot.bus));
    if (at == buses_.end()) continue;
    SlotFigures line{
        .bus = static_cast<std::size_t>(at - buses_.begin()), .id = slot.id, .name = slot.name, .state = slot.state};
    const auto known = optional_.find({std::string_view(slot.bus), slot.id.value()});
    line.required = known == optional_.end() || !known->second;
    if (const auto* const told = statistics[line.bus]) {
      const auto& tally = told->tallies[slot.id.value() & 127U];
      line.heartbeats_lost = tally.losses;
      line.emergencies = tally.emergencies;
      line.boots = tally.boots;
      line.mismatches = tally.differences;
      line.differs = tally.differs;
    }
    figures.slots.push_back(std::move(line));
  }
  return figures;
}

}  // namespace berth::studio

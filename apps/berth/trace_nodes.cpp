#include "trace_nodes.hpp"

#include <algorithm>

namespace berth::cli {

// The bus's gateways are those of the machine file, and those that `--node` names as such.
void TraceNodes::add_bus(const std::string& machine_bus) {
  auto gateways = known_->gateways(machine_bus);
  for (const auto& view : wanted_) {
    if (view.bus.empty() && !view.path.gateways.empty()) gateways.set(view.path.gateways.front().gateway.value());
  }
  buses_.push_back({machine_bus, multilevel::Carried(gateways)});
}

void TraceNodes::look(const trace::Entry& entry) {
  about_ = buses_[entry.bus].carried.about(entry.frame);
  now_ = entry.at;
}

std::optional<multilevel::Path> TraceNodes::about(const decode::Row& row) const {
  return row.entry->at == now_ ? about_ : std::nullopt;
}

bool TraceNodes::wants(const decode::Row& row) const {
  if (wanted_.empty()) return true;
  const std::string& bus = buses_[row.entry->bus].name;
  const bool ports_told = row.meaning.service != decode::Service::emcy;
  return std::ranges::any_of(
      wanted_, [&](const NodeView& view) { return view.has(bus, row.meaning.node, about(row), ports_told); });
}

}  // namespace berth::cli

#include "berth/sim/integration.hpp"

namespace berth::sim {

void Integration::count(rt::Time until) noexcept {
  for (BusNode* node : nodes_->slots()) {
    if (node == nullptr || !node->access.integrating()) continue;
    if (node->access.count(until, bit_time_of(node->bit_rate))) owner_->integrated(*node);
  }
}

void Integration::dominant_until(rt::Time at) noexcept {
  for (BusNode* node : nodes_->slots()) {
    if (node != nullptr) node->access.dominant_until(at);
  }
}

void Integration::schedule(rt::Time start) noexcept {
  cancel();
  if (!nodes_->any_integrating()) return;
  rt::Time first = rt::never;
  for (const BusNode* node : nodes_->slots()) {
    if (node == nullptr || !node->access.integrating() || !node->powered) continue;
    first = std::min(first, node->access.due(bit_time_of(node->bit_rate)));
  }
  if (first > start) return;
  executor_->at(first, *this);
}

}  // namespace berth::sim

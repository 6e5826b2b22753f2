#include "berth/sim/deliveries.hpp"

#include <algorithm>

namespace berth::sim {

void Deliveries::run() noexcept {
  std::size_t done = 0;
  for (; done < pending_.size() && pending_[done].at <= executor_->now(); ++done) {
    const Pending& due = pending_[done];
    if (due.sent) {
      owner_->sent(*due.node, due.at);
    } else if (due.node->host.listened()) {
      due.node->deliver(due.frame, due.at);
    }
  }
  pending_.erase(pending_.begin(), pending_.begin() + static_cast<std::ptrdiff_t>(done));
  schedule();
}

void Deliveries::settle(BusNode& node) noexcept {
  const auto sent = std::ranges::find_if(pending_, [&](const Pending& p) { return p.node == &node && p.sent; });
  if (sent != pending_.end()) node.confirm(sent->at);
  std::erase_if(pending_, [&](const Pending& pending) { return pending.node == &node; });
}

void Deliveries::hand_over(const BusNode& node, Deliveries& to) {
  for (const auto& pending : pending_) {
    if (pending.node == &node) to.pending_.push_back(pending);
  }
  std::erase_if(pending_, [&](const Pending& pending) { return pending.node == &node; });
  to.schedule();
}

}  // namespace berth::sim

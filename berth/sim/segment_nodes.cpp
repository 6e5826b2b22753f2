#include "berth/sim/segment_nodes.hpp"

namespace berth::sim {

void SegmentNodes::join(BusNode& node) {
  const auto hole = std::ranges::find(slots_, nullptr);
  node.slot = static_cast<std::uint32_t>(hole - slots_.begin());
  if (hole == slots_.end()) {
    slots_.push_back(&node);
  } else {
    *hole = &node;
  }
  node.peers = this;
  ++count_;
  if (!node.errors.clean()) ++noisy_;
}

void SegmentNodes::leave(BusNode& node) noexcept {
  if (!node.errors.clean()) --noisy_;
  slots_[node.slot] = nullptr;
  node.slot = BusNode::no_slot;
  node.peers = nullptr;
  --count_;
}

void SegmentNodes::recount() noexcept {
  acknowledgers_ = integrating_ = suspended_ = present_ = 0;
  mixed_ = false;
  std::uint32_t rate = 0;
  for (const BusNode* node : slots_) {
    if (node == nullptr || !node->powered) continue;
    if (node->acknowledges()) ++acknowledgers_;
    if (node->access.integrating()) ++integrating_;
    if (node->access.excluded()) continue;
    ++present_;
    if (node->access.suspends()) ++suspended_;
    if (rate != 0 && rate != node->bit_rate) mixed_ = true;
    rate = node->bit_rate;
  }
  if (rate != 0) bit_ = bit_time_of(rate);
}

std::uint32_t SegmentNodes::find(const Controller* controller) const noexcept {
  const auto found = std::ranges::find_if(
      slots_, [=](const BusNode* node) { return node != nullptr && node->controller == controller; });
  return found == slots_.end() ? BusNode::no_slot : (*found)->slot;
}

rt::Duration SegmentNodes::shortest_bit() const noexcept {
  rt::Duration shortest = bit_;
  for (const BusNode* node : slots_) {
    if (node != nullptr && node->powered) shortest = std::min(shortest, bit_time_of(node->bit_rate));
  }
  return shortest;
}

void SegmentNodes::count_good_frame(std::span<BusNode* const> senders, rt::Time free) noexcept {
  for (BusNode* node : slots_) {
    if (node == nullptr || !node->acknowledges()) continue;
    const auto tec = node->errors.tec();
    const auto rec = node->errors.rec();
    if (std::ranges::find(senders, node) != senders.end()) {
      if (tec > 0) node->set_counters(static_cast<std::uint16_t>(tec - 1), rec);
      if (node->errors.passive()) {
        node->access.suspend(free + 8 * bit_);
        ++suspended_;
      }
    } else if (rec > 0) {
      node->set_counters(tec, rec > 127 ? std::uint16_t{127} : static_cast<std::uint16_t>(rec - 1));
    }
    node->tell_if_changed();
  }
}

void BusNode::set_counters(std::uint16_t tec, std::uint16_t rec) noexcept {
  const bool was_clean = errors.clean();
  errors.set(tec, rec);
  if (was_clean != errors.clean()) peers->counters_changed(!was_clean);
}

}  // namespace berth::sim

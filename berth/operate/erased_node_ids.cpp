#include "berth/operate/erased_node_ids.hpp"

#include <fmt/format.h>

namespace berth::operate {

NodeId ErasedNodeIds::forget(const Identity& device) {
  const auto it = devices_.find(device);
  if (it == devices_.end()) return {};
  const NodeId used = it->second.uses;
  devices_.erase(it);
  return used;
}

bool ErasedNodeIds::rests(const Identity& device, NodeId active, bool& told_one) noexcept {
  const auto it = devices_.find(device);
  const bool still = it != devices_.end() && it->second.uses == active;
  return still && !tells_again(it->second.looked_at, told_one);
}

bool ErasedNodeIds::tells_again(unsigned& looks, bool& told_one) noexcept {
  const bool due = is_time(looks + 1);
  const bool tells = due && !told_one;
  if (!due || tells) ++looks;  // otherwise it is told in the next round
  told_one = told_one || tells;
  return tells;
}

bool ErasedNodeIds::uses(const Identity& device, NodeId id) const noexcept {
  const auto it = devices_.find(device);
  return it != devices_.end() && it->second.uses == id;
}

const Identity* ErasedNodeIds::user_of(NodeId id) const noexcept {
  for (const auto& [device, each] : devices_) {
    if (each.uses == id) return &device;
  }
  return nullptr;
}

const Identity* ErasedNodeIds::waits_for(const places::SlotSpec& slot) const noexcept {
  for (const auto& [device, each] : devices_) {
    if (places::fits(slot, device)) return &device;
  }
  return nullptr;
}

std::string ErasedNodeIds::reason(const Identity& device) {
  return fmt::format("{} uses its node-ID, too, until it is switched off and on: switch that one off and on",
                     to_string(device));
}

}  // namespace berth::operate

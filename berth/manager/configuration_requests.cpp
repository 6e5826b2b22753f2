#include "berth/manager/configuration_requests.hpp"

#include <algorithm>

#include "berth/od/cia302.hpp"

namespace berth::manager {

using od::AbortCode;

AbortCode ConfigurationRequests::request(std::uint8_t sub, std::uint32_t value) {
  const bool node = sub >= 1 && sub <= 127;
  if (!node && sub != od::cia302::all_nodes) return AbortCode::no_sub_index;
  if (value != signature) return AbortCode::not_stored;
  if (network_->phase() == NetworkBoot::Phase::off) return AbortCode::device_state;
  const auto& slaves = network_->plan().slaves;
  if (sub == od::cia302::all_nodes) {
    const auto begun = std::ranges::count_if(slaves, [this](const NetworkSlave& slave) { return begin(slave); });
    return begun > 0 ? AbortCode::none : AbortCode::device_state;
  }
  const auto slave = std::ranges::find(slaves, NodeId(sub), &NetworkSlave::node);
  if (slave == slaves.end()) return AbortCode::invalid_value;
  return begin(*slave) ? AbortCode::none : AbortCode::device_state;
}

void ConfigurationRequests::end() noexcept {
  scope_.cancel();
  busy_ = {};
}

bool ConfigurationRequests::begin(const NetworkSlave& slave) {
  const auto* const status = network_->find(slave.node);
  const bool boots = status == nullptr || status->phase == SlavePhase::booting || status->phase == SlavePhase::idle;
  if (boots || std::exchange(busy_[slave.node.value()], true)) return false;
  scope_.spawn(configure(slave.node, *slave.target, *slave.source, slave.rules));
  return true;
}

rt::Task<void> ConfigurationRequests::configure(NodeId node, BootTarget& target, BootSource& source, SlaveRules rules) {
  const auto done = co_await source.configure(target, rules);
  busy_[node.value()] = false;
  if (callback_) callback_(node, done);
}

}  // namespace berth::manager

#include "berth/network/configuration_requests.hpp"

#include "berth/network/slave_requests.hpp"

namespace berth::network {

using od::AbortCode;

AbortCode ConfigurationRequests::request(std::uint8_t sub, std::uint32_t value) {
  return request_of_slaves(*network_, sub, value, signature,
                           [this](const NetworkSlave& slave) { return begin(slave); });
}

void ConfigurationRequests::end() noexcept {
  scope_.cancel();
  busy_ = {};
}

bool ConfigurationRequests::begin(const NetworkSlave& slave) {
  const bool boots = !is_settled(*network_, slave.node);
  if (boots || std::exchange(busy_[slave.node.value()], true)) return false;
  scope_.spawn(configure(slave.node, *slave.target, *slave.source, slave.rules));
  return true;
}

rt::Task<void> ConfigurationRequests::configure(NodeId node, BootTarget& target, BootSource& source,
                                                manager::SlaveRules rules) {
  const auto done = co_await source.configure(target, rules);
  busy_[node.value()] = false;
  if (callback_) callback_(node, done);
}

}  // namespace berth::network

#include "berth/manager/sdo_connections.hpp"

#include <algorithm>

namespace berth::manager {

SdoConnections::SdoConnections(can::IdRange pool) noexcept
    : first_(pool.first), pairs_(std::min<std::uint32_t>((pool.last + 1 - pool.first) / 2, most)), holders_(pairs_) {}

std::optional<ConnectionIds> SdoConnections::take() noexcept {
  for (std::uint32_t pair = 0; pair < pairs_; ++pair) {
    if (!is_free(pair)) continue;
    taken_.set(pair);
    return ConnectionIds{first_ + 2 * pair, first_ + 2 * pair + 1};
  }
  return std::nullopt;
}

bool SdoConnections::claim(const ConnectionIds& ids) noexcept {
  const bool is_pair = in_pool(ids.request) && (ids.request - first_) % 2 == 0 && ids.response == ids.request + 1;
  if (!is_pair || taken_.test(pair_of(ids.request))) return false;
  taken_.set(pair_of(ids.request));
  return true;
}

void SdoConnections::put_back(const ConnectionIds& ids) noexcept {
  if (in_pool(ids.request)) taken_.reset(pair_of(ids.request));
}

void SdoConnections::hold(std::uint32_t id, NodeId node) noexcept {
  if (in_pool(id)) holders_[pair_of(id)].set(node.value());
}

void SdoConnections::unhold(NodeId node) noexcept {
  for (auto& holders : holders_) holders.reset(node.value());
}

bool SdoConnections::holds(NodeId node) const noexcept {
  return std::ranges::any_of(holders_, [&](const auto& holders) { return holders.test(node.value()); });
}

std::size_t SdoConnections::free() const noexcept {
  std::size_t count = 0;
  for (std::size_t pair = 0; pair < pairs_; ++pair) count += is_free(pair) ? 1 : 0;
  return count;
}

void SdoConnections::remove(NodeId client, NodeId server) noexcept {
  std::erase_if(all_, [&](const SdoConnection& c) { return c.client == client && c.server == server; });
}

SdoConnection* SdoConnections::find(NodeId client, NodeId server) noexcept {
  const auto it =
      std::ranges::find_if(all_, [&](const SdoConnection& c) { return c.client == client && c.server == server; });
  return it == all_.end() ? nullptr : &*it;
}

bool SdoConnections::uses(NodeId node, std::uint16_t object) const noexcept {
  return std::ranges::any_of(all_, [&](const SdoConnection& c) {
    return (c.client == node && c.client_object == object) || (c.server == node && c.server_object == object);
  });
}

void SdoConnections::clear() noexcept {
  taken_.reset();
  all_.clear();
  for (auto& holders : holders_) holders.reset();
}

}  // namespace berth::manager

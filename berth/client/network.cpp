#include "berth/client/network.hpp"

#include <algorithm>

#include "berth/client/remote_node.hpp"

namespace berth::client {

Network::Network(can::Dispatcher& dispatcher, const co::SdoOptions& options)
    : dispatcher_(&dispatcher), sdo_(dispatcher, options), nmt_(dispatcher), heartbeats_(dispatcher, *this) {
  heartbeats_.hear_all_boot_ups(true);
}

Network::~Network() {
  for (RemoteNode* node : nodes_) node->network_gone();
}

void Network::add(RemoteNode& node) {
  nodes_.push_back(&node);
  // A node without a heartbeat time is never lost, but its states are reported.
  const bool limited = node.options_.heartbeat > rt::Duration::zero();
  const auto time = limited ? node.options_.heartbeat : co::HeartbeatConsumer::unlimited;
  if (node.id().configured()) heartbeats_.supervise(node.id(), time);
}

void Network::remove(RemoteNode& node) noexcept {
  std::erase(nodes_, &node);
  if (!node.id().configured()) return;
  if (std::ranges::none_of(nodes_, [&](const RemoteNode* other) { return other->id() == node.id(); })) {
    heartbeats_.supervise(node.id(), rt::Duration::zero());
  }
}

void Network::heartbeat(const co::HeartbeatEvent& event, rt::Time at) noexcept {
  const bool mine = std::ranges::any_of(nodes_, [&](const RemoteNode* node) { return node->id() == event.node; });
  if (!mine) return;
  // A device that boots does not answer earlier requests any more.
  if (event.kind == co::HeartbeatEvent::Kind::boot_up) sdo_.cancel(event.node);
  for (RemoteNode* node : nodes_) {
    if (node->id() == event.node) node->heard(event, at);
  }
}

can::Queued Network::send_sync() noexcept { return dispatcher_->send(can::Frame::base(co::sync_id, {})); }

void Network::produce_sync(rt::Duration period) noexcept {
  sync_.period = period;
  sync_.cancel();
  sync_.next = executor().now();
  if (period > rt::Duration::zero()) executor().post(sync_);
}

void Network::Sync::run() noexcept {
  if (!pending()) network_->dispatcher_->send(can::Frame::base(co::sync_id, {}), *this);
  next += period;
  network_->executor().at(next, *this);
}

}  // namespace berth::client

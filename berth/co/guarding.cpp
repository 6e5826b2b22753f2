#include "berth/co/guarding.hpp"

#include <algorithm>

#include "berth/co/cob_id.hpp"
#include "berth/co/retry_parts.hpp"

namespace berth::co {

namespace {
constexpr std::uint8_t toggle_bit = 0x80;
constexpr std::uint8_t remote_dlc = 1;
}  // namespace

// ---- slave

void GuardingSlave::start(NodeId node, NmtState state) {
  stop();
  node_ = node;
  state_ = state;
  dispatcher_->add(can::only(error_control_id(node)), *this);
}

void GuardingSlave::stop() noexcept {
  dispatcher_->remove(*this);
  cancel();
  node_ = NodeId();
  toggle_ = guarded_ = lost_ = false;
}

void GuardingSlave::set_life_time(rt::Duration guard_time, std::uint8_t life_time_factor) noexcept {
  life_time_ = guard_time * life_time_factor;
  arm();
}

void GuardingSlave::set_heartbeat_active(bool active) noexcept {
  heartbeat_ = active;
  if (active) guarded_ = lost_ = false;
  arm();
}

void GuardingSlave::arm() noexcept {
  if (heartbeat_ || !guarded_ || lost_ || life_time_ <= rt::Duration::zero()) return cancel();
  dispatcher_->executor().after(life_time_, *this);
}

void GuardingSlave::received(const can::Frame& frame, rt::Time at) noexcept {
  if (!frame.remote || heartbeat_) return;
  const auto byte = static_cast<std::uint8_t>(static_cast<std::uint8_t>(state_) | (toggle_ ? toggle_bit : 0));
  if (dispatcher_->send(can::Frame::base(error_control_id(node_), {byte})) == can::Queued::yes) toggle_ = !toggle_;
  const bool recovered = std::exchange(lost_, false);
  guarded_ = true;
  arm();
  if (recovered) observer_->life_guarding(false, at);
}

void GuardingSlave::run() noexcept {
  lost_ = true;
  observer_->life_guarding(true, dispatcher_->executor().now());
}

// ---- master

const char* name(GuardingEvent::Kind kind) noexcept {
  using Kind = GuardingEvent::Kind;
  switch (kind) {
    case Kind::started: return "started";
    case Kind::state_changed: return "state changed";
    case Kind::toggle_error: return "toggle error";
    case Kind::lost: return "lost";
    case Kind::recovered: return "recovered";
    case Kind::boot_up: return "boot-up";
  }
  return "unknown";
}

GuardingMaster::Node* GuardingMaster::find(NodeId id) noexcept {
  const auto it = std::ranges::find(nodes_, id, &Node::node);
  return it == nodes_.end() ? nullptr : &*it;
}

void GuardingMaster::guard(NodeId id, rt::Duration guard_time, std::uint8_t retry_factor) {
  if (!id.configured() || guard_time <= rt::Duration::zero()) return;
  end(id);
  Node node;
  node.node = id;
  node.guard_time = guard_time;
  node.factor = std::max<std::uint8_t>(retry_factor, 1);
  node.next = dispatcher_->executor().now();
  nodes_.push_back(node);
  dispatcher_->add(can::only(error_control_id(id)), *this);
  arm();
}

void GuardingMaster::end(NodeId id) noexcept {
  if (std::erase_if(nodes_, [&](const Node& n) { return n.node == id; }) == 0) return;
  listen();
  arm();
}

void GuardingMaster::listen() noexcept {
  dispatcher_->remove(*this);
  for (const Node& node : nodes_) dispatcher_->add(can::only(error_control_id(node.node)), *this);
}

bool GuardingMaster::guarded(NodeId id) const noexcept {
  return std::ranges::find(nodes_, id, &Node::node) != nodes_.end();
}

std::optional<NmtState> GuardingMaster::state(NodeId id) const noexcept {
  const auto it = std::ranges::find(nodes_, id, &Node::node);
  if (it == nodes_.end() || !it->seen || it->lost) return std::nullopt;
  return it->state;
}

void GuardingMaster::arm() noexcept {
  if (nodes_.empty()) return cancel();
  dispatcher_->executor().at(std::ranges::min_element(nodes_, {}, &Node::next)->next, *this);
}

GuardingMaster::Node* GuardingMaster::first_due(rt::Time now) noexcept {
  const auto it = std::ranges::find_if(nodes_, [&](const Node& n) { return n.next <= now; });
  return it == nodes_.end() ? nullptr : &*it;
}

void GuardingMaster::run() noexcept {
  // The search begins anew after each node: an observer may add or remove nodes meanwhile.
  while (Node* node = first_due(dispatcher_->executor().now())) due(*node);
  arm();
}

void GuardingMaster::due(Node& node) noexcept {
  const auto id = node.node;
  node.next += node.guard_time;
  const bool missed = std::exchange(node.waits, true);
  if (missed && node.missed < 0xFF) ++node.missed;
  const bool lost = node.missed >= node.factor && !node.lost;
  if (lost) node.lost = true;
  const auto state = node.state;
  static_cast<void>(dispatcher_->send(can::Frame::request(error_control_id(id), remote_dlc)));
  if (lost) report(GuardingEvent::Kind::lost, id, state, state, dispatcher_->executor().now());
}

void GuardingMaster::received(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.remote || frame.fd || frame.size != 1) return;
  const auto state = nmt_state(frame.data[0]);
  Node* node = find(NodeId(static_cast<std::uint8_t>(frame.id & 0x7FU)));
  if (node == nullptr || !state) return;
  if (*state != NmtState::initialising) return answered(*node, frame.data[0], *state, at);
  if ((frame.data[0] & toggle_bit) != 0) return;  // no answer to guarding: an initialising node does not answer
  node->waits = false;
  node->seen = false;
  node->missed = 0;
  node->toggle = false;
  node->toggle_known = true;
  const auto previous = std::exchange(node->state, NmtState::initialising);
  report(GuardingEvent::Kind::boot_up, node->node, NmtState::initialising, previous, at);
}

void GuardingMaster::answered(Node& node, std::uint8_t byte, NmtState state, rt::Time at) noexcept {
  const bool toggle = (byte & toggle_bit) != 0;
  const bool wrong = node.toggle_known && toggle != node.toggle;
  node.toggle = !toggle;
  node.toggle_known = true;
  const auto id = node.node;
  if (wrong) return report(GuardingEvent::Kind::toggle_error, id, state, node.state, at);
  node.waits = false;
  node.missed = 0;
  const auto previous = std::exchange(node.state, state);
  const bool first = !std::exchange(node.seen, true);
  if (std::exchange(node.lost, false)) return report(GuardingEvent::Kind::recovered, id, state, previous, at);
  if (first) return report(GuardingEvent::Kind::started, id, state, previous, at);
  if (previous != state) report(GuardingEvent::Kind::state_changed, id, state, previous, at);
}

void GuardingMaster::report(GuardingEvent::Kind kind, NodeId node, NmtState state, NmtState previous,
                            rt::Time at) noexcept {
  observer_->guarding({.kind = kind, .node = node, .state = state, .previous = previous}, at);
}

// ---- one question

bool GuardRequest::start() {
  if (!node_.configured() || tries_ == 0) {
    result_ = fail(Errc::invalid, "guarding an unconfigured node-ID");
    return false;
  }
  dispatcher_->add(can::only(error_control_id(node_)), *this);
  ask();
  return true;
}

void GuardRequest::ask() noexcept {
  asked_ = false;
  --tries_;
  give_up_ = dispatcher_->executor().now() + timeout_;
  send();
}

void GuardRequest::send() noexcept {
  auto& executor = dispatcher_->executor();
  switch (dispatcher_->send(can::Frame::request(error_control_id(node_), remote_dlc), *this)) {
    case can::Queued::yes: executor.at(give_up_, *this); break;
    case can::Queued::full: executor.at(std::min(executor.now() + full_retry, give_up_), *this); break;
    default: end(fail(Error{.code = Errc::bus, .node = node_.value(), .text = "the port does not send node guarding"}));
  }
}

void GuardRequest::sent(rt::Time at) noexcept {
  asked_ = true;
  dispatcher_->executor().at(at + timeout_, *this);
}

void GuardRequest::received(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.remote || frame.fd || frame.size != 1 || !asked_) return;
  const auto state = nmt_state(frame.data[0]);
  if (!state) return;
  end(GuardAnswer{.state = *state, .toggle = (frame.data[0] & toggle_bit) != 0, .at = at});
}

void GuardRequest::run() noexcept {
  if (!asked_) {
    if (!pending() && dispatcher_->executor().now() < give_up_) return send();
    return end(fail(Error{.code = Errc::bus, .node = node_.value(), .text = "the guarding request never left"}));
  }
  if (tries_ > 0) return ask();
  end(fail(Error{.code = Errc::timeout, .node = node_.value(), .text = "no answer to node guarding"}));
}

void GuardRequest::end(const Result<GuardAnswer>& result) noexcept {
  result_ = result;
  cancel();
  if (pending()) dispatcher_->withdraw(*this);
  dispatcher_->remove(*this);
  finish();
}

}  // namespace berth::co

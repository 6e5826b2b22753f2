#include "berth/co/heartbeat.hpp"

#include <algorithm>

#include "berth/co/cob_id.hpp"

namespace berth::co {

void HeartbeatProducer::start(NodeId node, NmtState state) noexcept {
  stop();
  node_ = node;
  state_ = state;
  set_period(period_);
}

void HeartbeatProducer::stop() noexcept {
  cancel();
  node_ = NodeId();
  if (pending()) dispatcher_->withdraw(*this);
}

void HeartbeatProducer::set_period(rt::Duration period) noexcept {
  period_ = period;
  cancel();
  if (period_ <= rt::Duration::zero() || !node_.configured()) return;
  next_ = dispatcher_->executor().now() + period_;
  dispatcher_->executor().at(next_, *this);
}

void HeartbeatProducer::run() noexcept {
  // The period counts from the time when the frame was due, so that late jobs do not make it drift.
  next_ += period_;
  dispatcher_->executor().at(next_, *this);
  const can::Frame frame = can::Frame::base(error_control_id(node_), {static_cast<std::uint8_t>(state_)});
  static_cast<void>(dispatcher_->send(frame, *this));
}

const char* name(HeartbeatEvent::Kind kind) noexcept {
  using Kind = HeartbeatEvent::Kind;
  switch (kind) {
    case Kind::started: return "started";
    case Kind::state_changed: return "state changed";
    case Kind::lost: return "lost";
    case Kind::recovered: return "recovered";
    case Kind::boot_up: return "boot-up";
    case Kind::never_seen: return "never seen";
  }
  return "unknown";
}

namespace {
constexpr std::uint8_t entry_node(std::uint32_t value) noexcept { return static_cast<std::uint8_t>(value >> 16); }
constexpr bool entry_used(std::uint32_t value) noexcept {
  return (value & 0xFFFFU) != 0 && entry_node(value) >= 1 && entry_node(value) <= 127;
}
constexpr std::uint8_t made_by_supervise = 0;
// Up to this number of nodes, each identifier is filtered by itself; above it, filtering the whole range costs less.
constexpr unsigned few = 8;
}  // namespace

HeartbeatConsumer::HeartbeatConsumer(can::Dispatcher& dispatcher, Observer& observer, unsigned most)
    : dispatcher_(&dispatcher), observer_(&observer) {
  most = std::clamp(most, 1U, entries);
  nodes_.reserve(most);
  entry_values_.resize(most + 1);
  places_.fill(nowhere);
}

od::AbortCode HeartbeatConsumer::set_entry(std::uint8_t sub, std::uint32_t value) noexcept {
  if (sub == 0 || sub >= entry_values_.size()) return od::AbortCode::no_sub_index;
  if ((value >> 24) != 0) return od::AbortCode::invalid_value;
  const auto node = entry_node(value);
  if (entry_used(value)) {
    for (unsigned other = 1; other < entry_values_.size(); ++other) {
      const auto held = entry_values_[other];
      if (other != sub && entry_used(held) && entry_node(held) == node) return od::AbortCode::parameter_incompatible;
    }
  }
  const auto old = entry_values_[sub];
  entry_values_[sub] = value;
  if (entry_used(old) && (!entry_used(value) || entry_node(old) != node)) end(entry_node(old));
  if (entry_used(value)) begin(node, std::chrono::milliseconds(value & 0xFFFFU), sub);
  return od::AbortCode::none;
}

std::uint32_t HeartbeatConsumer::entry(std::uint8_t sub) const noexcept {
  return sub >= 1 && sub < entry_values_.size() ? entry_values_[sub] : 0;
}

void HeartbeatConsumer::supervise(NodeId node, rt::Duration time) noexcept {
  if (!node.configured()) return;
  if (time <= rt::Duration::zero()) return end(node.value());
  begin(node.value(), time, made_by_supervise);
}

void HeartbeatConsumer::clear() noexcept {
  nodes_.clear();
  places_.fill(nowhere);
  std::ranges::fill(entry_values_, 0U);
  cancel();
  listen();
}

void HeartbeatConsumer::begin(std::uint8_t number, rt::Duration time, std::uint8_t entry) noexcept {
  Node* held = find(number);
  const bool fresh = held == nullptr;
  if (fresh) {
    places_[number] = static_cast<std::uint8_t>(nodes_.size());
    held = &nodes_.emplace_back();
  }
  Node& node = *held;
  const auto kept = entry == made_by_supervise ? node.entry : entry;
  node = {};
  node.number = number;
  node.time = time;
  node.entry = kept;
  node.deadline = never_seen_at(node, dispatcher_->executor().now());
  arm(node.deadline);
  if (fresh) listen();
}

void HeartbeatConsumer::end(std::uint8_t number) noexcept {
  Node* node = find(number);
  if (node == nullptr) return;
  *node = nodes_.back();
  places_[node->number] = places_[number];
  places_[number] = nowhere;
  nodes_.pop_back();
  listen();
}

rt::Time HeartbeatConsumer::never_seen_at(const Node& node, rt::Time since) const noexcept {
  if (never_seen_time_ <= rt::Duration::zero()) return rt::never;
  return since + (node.time < unlimited ? std::max(never_seen_time_, node.time) : never_seen_time_);
}

void HeartbeatConsumer::set_never_seen_time(rt::Duration time) noexcept {
  never_seen_time_ = time;
  const auto now = dispatcher_->executor().now();
  for (Node& node : nodes_) {
    if (node.watched != Watched::waiting) continue;
    node.deadline = never_seen_at(node, now);
    arm(node.deadline);
  }
}

void HeartbeatConsumer::hear_all_boot_ups(bool on) noexcept {
  hear_all_ = on;
  listen();
}

void HeartbeatConsumer::listen() noexcept {
  dispatcher_->remove(*this);
  if (hear_all_ || nodes_.size() > few) return dispatcher_->add(all_error_control, *this);
  for (const Node& node : nodes_) dispatcher_->add(can::only(error_control_id(NodeId(node.number))), *this);
}

// The timer never fires after the earliest deadline. Heartbeats only move deadlines later and do not touch the timer.
void HeartbeatConsumer::arm(rt::Time deadline) noexcept {
  if (deadline == rt::never || (timed() && due() <= deadline)) return;
  dispatcher_->executor().at(deadline, *this);
}

void HeartbeatConsumer::received(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.remote || frame.fd || frame.size != 1) return;
  const auto state = nmt_state(frame.data[0]);
  if (!state) return;
  const auto number = static_cast<std::uint8_t>(frame.id & 0x7FU);
  if (*state == NmtState::initialising) {
    booted(number, at);
  } else {
    heard(number, *state, at);
  }
}

void HeartbeatConsumer::heard(std::uint8_t number, NmtState state, rt::Time at) noexcept {
  Node* found = find(number);
  if (found == nullptr) return;
  Node& node = *found;
  node.deadline = at + node.time;
  const auto previous = std::exchange(node.state, state);
  if (node.watched == Watched::active) {
    if (previous != state) report(HeartbeatEvent::Kind::state_changed, number, previous, at);
    return;
  }
  node.watched = Watched::active;
  const bool was_lost = std::exchange(node.was_lost, false);
  arm(node.deadline);
  report(was_lost ? HeartbeatEvent::Kind::recovered : HeartbeatEvent::Kind::started, number, previous, at);
}

void HeartbeatConsumer::booted(std::uint8_t number, rt::Time at) noexcept {
  Node* found = find(number);
  if (found == nullptr) {
    if (hear_all_) report(HeartbeatEvent::Kind::boot_up, number, NmtState::initialising, at);
    return;
  }
  Node& node = *found;
  const auto previous = std::exchange(node.state, NmtState::initialising);
  node.watched = Watched::waiting;
  node.deadline = never_seen_at(node, at);
  arm(node.deadline);
  report(HeartbeatEvent::Kind::boot_up, number, previous, at);
}

void HeartbeatConsumer::run() noexcept {
  const auto now = dispatcher_->executor().now();
  // Each number is looked up anew: an observer may end or begin supervision.
  for (unsigned number = 1; number < places_.size(); ++number) {
    Node* found = find(number);
    if (found == nullptr || found->deadline > now) continue;
    Node& node = *found;
    node.deadline = rt::never;
    if (node.watched == Watched::active) {
      node.watched = Watched::lost;
      node.was_lost = true;
      report(HeartbeatEvent::Kind::lost, node.number, node.state, now);
    } else {
      report(HeartbeatEvent::Kind::never_seen, node.number, node.state, now);
    }
  }
  auto earliest = rt::never;
  for (const Node& node : nodes_) earliest = std::min(earliest, node.deadline);
  arm(earliest);
}

void HeartbeatConsumer::report(HeartbeatEvent::Kind kind, std::uint8_t number, NmtState previous,
                               rt::Time at) noexcept {
  const Node* node = find(number);
  observer_->heartbeat({.kind = kind,
                        .node = NodeId(number),
                        .supervised = node != nullptr,
                        .state = node != nullptr ? node->state : NmtState::initialising,
                        .previous = previous},
                       at);
}

bool HeartbeatConsumer::supervised(NodeId node) const noexcept { return find(node) != nullptr; }

bool HeartbeatConsumer::lost(NodeId node) const noexcept {
  const Node* found = find(node);
  return found != nullptr && found->was_lost;
}

std::optional<NmtState> HeartbeatConsumer::state(NodeId node) const noexcept {
  const Node* found = find(node);
  if (found == nullptr || found->watched != Watched::active) return std::nullopt;
  return found->state;
}

bool HeartbeatConsumer::all_active() const noexcept {
  return std::ranges::all_of(nodes_, [](const Node& n) { return n.watched == Watched::active; });
}

bool HeartbeatConsumer::all_operational() const noexcept {
  return std::ranges::all_of(
      nodes_, [](const Node& n) { return n.watched == Watched::active && n.state == NmtState::operational; });
}

}  // namespace berth::co

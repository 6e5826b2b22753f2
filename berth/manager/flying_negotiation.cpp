#include "berth/manager/flying_negotiation.hpp"

#include <array>

namespace berth::manager {

can::Frame to_frame(const FlyingMessage& message) noexcept {
  const auto id = static_cast<std::uint32_t>(message.service);
  if (message.service != FlyingService::active_master) return can::Frame::base(id, {});
  return can::Frame::base(id, {message.sender.priority, message.sender.node.value()});
}

std::optional<FlyingMessage> parse_flying(const can::Frame& frame) noexcept {
  const auto key = frame.key();
  if (key < flying_master_ids.first || key > flying_master_ids.last || frame.remote || frame.fd) return std::nullopt;
  FlyingMessage message{.service = static_cast<FlyingService>(key), .sender = {}};
  const bool names = message.service == FlyingService::active_master;
  if (frame.size != (names ? 2 : 0)) return std::nullopt;
  if (!names) return message;
  const auto node = NodeId::make(frame.data[1]);
  if (!node || !node->configured()) return std::nullopt;
  message.sender = {frame.data[0], *node};
  return message;
}

const char* name(FlyingNegotiation::State state) noexcept {
  constexpr std::array<const char*, 8> names{"off",      "waiting", "detecting", "negotiating",
                                             "claiming", "master",  "standby",   "checking"};
  return names[static_cast<std::size_t>(state)];
}

// ---- from outside ---------------------------------------------------------------------------------------------------

void FlyingNegotiation::begin(const FlyingOptions& options, rt::Time now) noexcept {
  options_ = options;
  wait(now);
}

void FlyingNegotiation::end() noexcept {
  if (state_ != State::off) cold_ = false;
  // After its own reset of all nodes it is waiting.
  const bool by_another = state_ != State::off && state_ != State::waiting;
  if (by_another) all_reset_ = false;
  enter(State::off, rt::never);
}

void FlyingNegotiation::power_off() noexcept {
  enter(State::off, rt::never);
  cold_ = true;
  all_reset_ = false;
}

std::optional<MasterRank> FlyingNegotiation::active() const noexcept {
  if (is_master()) return options_.own;
  return stands_by() ? std::optional(active_) : std::nullopt;
}

FlyingNegotiation::Step FlyingNegotiation::received(const FlyingMessage& message, rt::Time now) noexcept {
  if (state_ == State::off) return {};
  switch (message.service) {
    case FlyingService::active_master: return heard_master(message.sender, now);
    case FlyingService::negotiation:
      if (is_master()) return {.send = FlyingService::active_master};
      if (state_ != State::claiming) negotiate(now);
      return {};
    case FlyingService::detect_active: return is_master() ? Step{.send = FlyingService::active_master} : Step{};
    case FlyingService::detect_capable: return {.send = FlyingService::capable};
    case FlyingService::force_negotiation: return step_down(now);
    case FlyingService::capable: break;
  }
  return {};
}

// 076. A node that is detecting, or waits to detect, negotiates soon anyway.
FlyingNegotiation::Step FlyingNegotiation::step_down(rt::Time now) noexcept {
  const bool has_begun = is_master() || state_ == State::negotiating || state_ == State::claiming;
  if (has_begun) wait(now);
  return {};
}

FlyingNegotiation::Step FlyingNegotiation::heard_master(const MasterRank& sender, rt::Time now) noexcept {
  const MasterRank& own = options_.own;
  if (sender.node == own.node) return {};  // another device under this node-ID: this cannot be resolved here
  const bool yields = sender.priority <= own.priority;
  switch (state_) {
    case State::off: break;
    case State::waiting:
      if (yields) stand_by(sender, now);
      break;
    case State::standby:
      if (yields) stand_by(sender, now);
      break;
    case State::detecting:
    case State::checking:
    case State::negotiating:
      if (yields) {
        stand_by(sender, now);
        break;
      }
      cold_ = false;
      wait(now);
      return {.send = FlyingService::force_negotiation};
    case State::claiming:
      if (sender.better_than(own)) stand_by(sender, now);
      break;
    case State::master:
      if (!sender.better_than(own)) return {.send = FlyingService::active_master};
      stand_by(sender, now);
      break;
  }
  return {};
}

FlyingNegotiation::Step FlyingNegotiation::booted(NodeId node, rt::Time now) noexcept {
  if (is_master()) return {.send = FlyingService::active_master};
  return stands_by() && node == active_.node ? lost(now) : Step{};
}

FlyingNegotiation::Step FlyingNegotiation::commanded(rt::Time now) noexcept {
  const bool again = is_master() && now - forced_ >= options_.timing.detection;
  return again ? due(now) : Step{};
}

FlyingNegotiation::Step FlyingNegotiation::lost(rt::Time now) noexcept {
  if (!stands_by()) return {};
  negotiate(now);
  return {.send = FlyingService::negotiation};
}

void FlyingNegotiation::claimed(rt::Time now) noexcept {
  if (state_ == State::claiming) enter(State::master, now + options_.timing.cycle_of(options_.own.node));
}

FlyingNegotiation::Step FlyingNegotiation::due(rt::Time now) noexcept {
  const FlyingTiming& timing = options_.timing;
  switch (state_) {
    case State::off: break;
    case State::waiting: enter(State::detecting, now + timing.detection); return {.send = FlyingService::detect_active};
    case State::standby: enter(State::checking, now + timing.detection); return {.send = FlyingService::detect_active};
    case State::detecting:
      if (cold_ && options_.resets_when_cold) {
        cold_ = false;
        all_reset_ = true;
        wait(now);
        return {.send = {}, .reset_all = true};
      }
      [[fallthrough]];
    case State::checking: negotiate(now); return {.send = FlyingService::negotiation};
    case State::negotiating:
    case State::claiming:  // it was not sent yet
      enter(State::claiming, now + timing.detection);
      return {.send = FlyingService::active_master};
    case State::master:
      forced_ = now;
      enter(State::master, now + timing.cycle_of(options_.own.node));
      return {.send = FlyingService::force_negotiation};
  }
  return {};
}

// ---- states ---------------------------------------------------------------------------------------------------------

void FlyingNegotiation::wait(rt::Time now) noexcept {
  if (is_master()) all_reset_ = false;
  enter(State::waiting, now + options_.timing.delay);
}

void FlyingNegotiation::negotiate(rt::Time now) noexcept {
  cold_ = false;
  enter(State::negotiating, now + options_.timing.slot_of(options_.own));
}

void FlyingNegotiation::stand_by(const MasterRank& active, rt::Time now) noexcept {
  cold_ = all_reset_ = false;
  active_ = active;
  enter(State::standby, now + quiet_cycles * options_.timing.cycle_of(active.node));
}

void FlyingNegotiation::enter(State state, rt::Time deadline) noexcept {
  state_ = state;
  deadline_ = deadline;
}

}  // namespace berth::manager

#include "berth/manager/flying_master.hpp"

#include <utility>

#include "berth/co/cob_id.hpp"

namespace berth::manager {

FlyingMaster::FlyingMaster(can::Dispatcher& dispatcher, Owner& owner)
    : dispatcher_(&dispatcher), owner_(&owner), heartbeats_(dispatcher, *this, 1) {
  dispatcher.add(flying_master_ids, *this);
  dispatcher.add(co::all_error_control, *this);
  dispatcher.add({co::nmt_command_id, co::nmt_command_id}, *this);
}

FlyingMaster::~FlyingMaster() = default;

Result<void> FlyingMaster::begin(const FlyingOptions& options, HeartbeatOf heartbeat_of) {
  constexpr std::uint8_t lowest_priority = 2;
  if (!options.own.node.configured()) return fail(Errc::invalid, "a flying master without a node-ID");
  if (options.own.priority > lowest_priority) return fail(Errc::invalid, "1F90h:03: the priority is above 2");
  if (!options.timing.sound()) {
    return fail(Errc::invalid, "1F90h: a time of 0, or a priority time slot not above 127 device time slots");
  }
  heartbeat_of_ = std::move(heartbeat_of);
  was_master_ = false;
  known_.reset();
  rules_.begin(options, dispatcher_->executor().now());
  carry_out({});
  return {};
}

void FlyingMaster::end() noexcept {
  rules_.end();
  was_master_ = false;
  known_.reset();
  carry_out({});
}

void FlyingMaster::power_off() noexcept {
  end();
  rules_.power_off();
}

// ---- received frames ------------------------------------------------------------------------------------------------

void FlyingMaster::received(const can::Frame& frame, rt::Time at) noexcept {
  if (rules_.state() == FlyingNegotiation::State::off) return;
  if (const auto message = parse_flying(frame)) return carry_out(rules_.received(*message, at));
  const auto command = co::parse_nmt(frame);
  if (command && is_master()) {
    owner_->overheard(*command);
    return carry_out(rules_.commanded(at));
  }
  const auto key = frame.key();
  const bool error_control = key >= co::all_error_control.first && key <= co::all_error_control.last;
  const bool boot_up = error_control && !frame.remote && frame.size == 1 && frame.data[0] == 0;
  if (boot_up) carry_out(rules_.booted(NodeId(static_cast<std::uint8_t>(key & 0x7FU)), at));
}

void FlyingMaster::heartbeat(const co::HeartbeatEvent& event, rt::Time at) noexcept {
  using Kind = co::HeartbeatEvent::Kind;
  const bool gone = event.kind == Kind::lost || event.kind == Kind::never_seen;
  if (gone && event.node == supervised_) carry_out(rules_.lost(at));
}

void FlyingMaster::sent(rt::Time at) noexcept {
  rules_.claimed(at);
  carry_out({});
}

void FlyingMaster::run() noexcept {
  const auto now = dispatcher_->executor().now();
  if (now >= rules_.deadline()) carry_out(rules_.due(now));
}

// ---- actions --------------------------------------------------------------------------------------------------------

void FlyingMaster::carry_out(const FlyingNegotiation::Step& step) noexcept {
  const bool claims = rules_.state() == FlyingNegotiation::State::claiming;
  // A claim of its own that still waits is void, or is repeated.
  const bool repeats = claims && step.send == FlyingService::active_master;
  if (pending() && (!claims || repeats)) dispatcher_->withdraw(*this);
  if (step.send) send(*step.send);
  if (rules_.deadline() == rt::never) {
    cancel();
  } else {
    dispatcher_->executor().at(rules_.deadline(), *this);
  }
  const auto active = rules_.active();
  const bool other = rules_.stands_by();
  supervise(other ? std::optional(active->node) : std::nullopt);
  const bool changed = active != known_ || was_master_ != rules_.is_master();
  known_ = active;
  was_master_ = rules_.is_master();
  if (changed && rules_.state() != FlyingNegotiation::State::off) owner_->role_changed();
  if (step.reset_all) owner_->reset_all();
}

void FlyingMaster::send(FlyingService service) noexcept {
  const can::Frame frame = to_frame({service, rules_.options().own});
  if (rules_.state() == FlyingNegotiation::State::claiming && service == FlyingService::active_master) {
    static_cast<void>(dispatcher_->send(frame, *this));
  } else {
    static_cast<void>(dispatcher_->send(frame));
  }
}

void FlyingMaster::supervise(std::optional<NodeId> node) noexcept {
  const NodeId wanted = node.value_or(NodeId());
  if (wanted == supervised_) return;
  if (supervised_.configured()) heartbeats_.supervise(supervised_, rt::Duration{0});
  supervised_ = wanted;
  if (!node) return;
  const rt::Duration time = heartbeat_of_ ? heartbeat_of_(*node) : rt::Duration{0};
  heartbeats_.set_never_seen_time(time);
  heartbeats_.supervise(*node, time);
}

}  // namespace berth::manager

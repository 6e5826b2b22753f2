#include "berth/operate/supervision.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/operate/duplicates.hpp"
#include "berth/operate/error_control.hpp"

namespace berth::operate {

namespace {

// Why a slot keeps its state: a user's command caused it.
std::string made(NmtState state, NodeId id) {
  return fmt::format("NMT {} by command; `berth nmt start {}` starts it", berth::name(state), id.value());
}

// Stopped was commanded. Pre-operational may be the device's reaction to an error: it is started again.
bool stays(const Seat& seat, NmtState state) noexcept { return seat.held || state == NmtState::stopped; }

const char* silence_of(const Seat& seat) noexcept {
  if (seat.life == Life::unfit) return "it no longer answers SDO";
  if (seat.is_unheard()) return "it no longer answers SDO, and never sent a heartbeat";
  if (seat.rate.by_sdo) return "it no longer answers SDO, and has no error control";
  return seat.guarded ? "it no longer answers guarding" : "heartbeat lost";
}

std::string text_of_leaving(const Seat& seat, NmtState state) {
  return stays(seat, state) ? made(state, seat.id())
                            : fmt::format("it left operational by itself: {}", berth::name(state));
}

}  // namespace

// Shows at once what a slot's device reports. What must be asked first waits for the turn.
void Supervision::show(Seat& seat, const Wake& wake, NmtState state) {
  if (seat.life == Life::suspect && wake.kind == Wake::Kind::state) seat.last.left = wake.at;
  if (seat.life != Life::operational) return;
  if (wake.kind == Wake::Kind::lost) {
    lost(seat);
  } else if (wake.kind == Wake::Kind::boot_up) {
    slots_.happened(seat, SlotEvent::boots, "rebooted; checking identity");
  } else if (wake.kind == Wake::Kind::state && state != NmtState::operational) {
    slots_.happened(seat, SlotEvent::leaves, text_of_leaving(seat, state));
    if (!stays(seat, state)) doubt_who_leaves(seat);
  }
}

void Supervision::heartbeat(const co::HeartbeatEvent& event, rt::Time at) {
  using Kind = co::HeartbeatEvent::Kind;
  Wake wake{Wake::Kind::look, event.node, at};
  if (event.kind == Kind::boot_up) {
    slots_.diagnosis().booted(event.node);
    emergencies_.booted(event.node);
  }
  if (event.kind == Kind::lost) slots_.diagnosis().lost(event.node);
  switch (event.kind) {
    case Kind::boot_up: wake.kind = Wake::Kind::boot_up; break;
    case Kind::lost:
    case Kind::never_seen: wake.kind = Wake::Kind::lost; break;
    case Kind::recovered: wake.kind = Wake::Kind::recovered; break;
    case Kind::started:
    case Kind::state_changed: wake.kind = Wake::Kind::state; break;
  }
  Seat* seat = slots_.at(event.node);
  const bool runs = event.state == NmtState::operational && wake.kind == Wake::Kind::state;
  if (runs && seat != nullptr && seat->is_booted() && slots_.happened(*seat, SlotEvent::operational)) {
    seat->slave.status.phase = network::SlavePhase::started;
    seat->rate.ran = at;
    if (slots_.operational()) slots_.events().reach(Milestone::operational);
    return;
  }
  if (seat != nullptr) show(*seat, wake, event.state);
  // Such a boot-up interrupts a search.
  const bool boots = wake.kind == Wake::Kind::boot_up;
  const bool ours = boots && loans_.of_ours(event.node, at);
  const bool sits = seat != nullptr && seat->slot.record.confirmed;
  const bool comes = boots && !ours && !sits && comes_anew(event.node, seat, at);
  if (comes) agenda_.comes.set(event.node.value());
  if (sits && !ours) agenda_.calls = true;
  agenda_.wakes.push(wake);
}

// A slot may wait for this device. If it boots again and again and is not taken, it does not interrupt the search each
// time, and a slot's report does not wait for it. A device that Berth gives its node-ID at this moment is known.
bool Supervision::comes_anew(NodeId node, const Seat* seat, rt::Time at) noexcept {
  if (seat != nullptr && seat->life == Life::binding) return false;
  const bool waits = std::ranges::any_of(slots_.seats(), [](const auto& s) { return !s->slot.record.device(); });
  if (!waits) return false;
  std::optional<rt::Time>& last = came_[node.value()];
  const bool lately = last && at < *last + 8 * s_.bus.timing.probe_period;
  if (!lately) last = at;
  return !lately;
}

// Treated like the report of a heartbeat. Boot-ups are received from all nodes.
void Supervision::guarding(const co::GuardingEvent& event, rt::Time at) {
  using Guard = co::GuardingEvent::Kind;
  using Beat = co::HeartbeatEvent::Kind;
  co::HeartbeatEvent told{.kind = Beat::started, .node = event.node, .state = event.state, .previous = event.previous};
  switch (event.kind) {
    case Guard::started: break;
    case Guard::state_changed: told.kind = Beat::state_changed; break;
    case Guard::lost: told.kind = Beat::lost; break;
    case Guard::recovered: told.kind = Beat::recovered; break;
    case Guard::toggle_error:
    case Guard::boot_up: return;
  }
  heartbeat(told, at);
}

void Supervision::check_rates() {
  for (auto& seat : slots_.seats()) {
    const auto beats = s_.boots.beats(seat->id());
    const auto elapsed = s_.executor.now() - seat->rate.at;
    const auto period = heartbeat_period(s_.bus.timing, *seat);
    if (seat->guarded || seat->life == Life::unfit) continue;  // `ask_the_unwatched` decides when it is asked next
    if (seat->life != Life::operational || period.count() == 0 || elapsed < 4 * period) {
      if (seat->life != Life::operational) {
        seat->rate.beats = beats;
        seat->rate.at = s_.executor.now();
      }
      continue;
    }
    const auto expected = elapsed / period + 1;
    seat->rate.fast = static_cast<std::int64_t>(beats - seat->rate.beats) * 2 > expected * 3 ? seat->rate.fast + 1 : 0;
    seat->rate.beats = beats;
    seat->rate.at = s_.executor.now();
    const auto steady = s_.boots.steady(seat->id());
    const bool seldom = steady && *steady > period + period / 4;
    if (seldom) ErrorControl(s_, slots_).take_period(*seat, *steady);
  }
}

// Two devices answer each question twice. A device with a steady heartbeat period of its own is alone.
rt::Task<bool> Supervision::beats_alone(Seat& seat) {
  const bool steady = s_.boots.steady(seat.id()).has_value();
  if (!steady || s_.only_observes()) co_return false;
  constexpr int looks = 3;
  for (int look = 0; look < looks; ++look) {
    const auto answer = co_await places::identify(s_.sdo, seat.id(), places::second_answer);
    if (!answer.who || answer.by_two || !seat.sits(*answer.who)) co_return false;
  }
  co_return true;
}

rt::Task<void> Supervision::ask_who_beats_fast() {
  constexpr unsigned often = 2;
  for (const auto& each : slots_.seats()) {
    Seat& seat = *each;
    if (seat.rate.fast < often || seat.life != Life::operational) continue;
    const bool alone = co_await beats_alone(seat);
    const auto steady = s_.boots.steady(seat.id());
    if (alone && steady) {
      ErrorControl(s_, slots_).take_period(seat, *steady);
      continue;
    }
    doubt_alone(seat, agenda_);
    slots_.happened(seat, SlotEvent::doubted,
                    "its heartbeat comes too often: a second device holds this node-ID; take one of them off the bus");
  }
}

void Supervision::commanded(co::NmtCommand command, co::NmtTarget target, bool listens) {
  for (auto& seat : slots_.seats()) {
    if (!target.includes(seat->id())) continue;
    const bool stops = command == co::NmtCommand::stop;
    seat->held = stops || command == co::NmtCommand::enter_pre_operational;
    // Its heartbeat reports its state. Without one, or if nothing listens any more, the commanded state counts.
    const bool unheard = seat->there() && (seat->guarded || !listens);
    if (!unheard) continue;
    if (seat->held && seat->life == Life::operational) {
      const NmtState state = stops ? NmtState::stopped : NmtState::pre_operational;
      slots_.happened(*seat, SlotEvent::pauses, made(state, seat->id()));
    } else if (command == co::NmtCommand::start && seat->life == Life::present) {
      seat->boot_again();  // it is started like any other, and asked by guarding
    }
  }
}

rt::Task<void> Supervision::handle(Wake wake) {
  Seat* const seat = slots_.at(wake.node);
  const bool booted_so = wake.kind == Wake::Kind::boot_up;
  const bool of_ours = booted_so && loans_.of_ours(wake.node, wake.at);
  if (of_ours && seat != nullptr && !seat->slot.record.confirmed) co_return;
  if (seat == nullptr) {
    // A boot-up under a node-ID without a slot, or under the master's own: find out which device it is.
    if (booted_so && !of_ours) agenda_.look_anew = true;
    co_return;
  }
  switch (wake.kind) {
    case Wake::Kind::boot_up: co_return co_await booted(*seat, wake.at);
    case Wake::Kind::lost:
      // It was asked meanwhile, with or without success; or no heartbeat is expected any more.
      if (wake.at <= seat->checked || seat->rate.by_sdo) co_return;
      lost(*seat);
      co_return;
    case Wake::Kind::recovered: {
      const auto steady = s_.boots.steady(seat->id());
      const bool seldom = steady && *steady > heartbeat_timeout(s_.bus.timing, *seat);
      if (seldom) ErrorControl(s_, slots_).take_period(*seat, *steady);
      const bool back = !seat->there() && wake.at > seat->checked;
      if (back) co_await came_back(*seat, wake.at);
      // It came back before its loss was handled; it may now report another state than before.
      co_return co_await told_state(*seat);
    }
    case Wake::Kind::state: co_return co_await told_state(*seat);
    case Wake::Kind::look: break;
  }
}

rt::Task<void> Supervision::booted(Seat& seat, rt::Time at) {
  if (at <= seat.checked) {
    const bool waits = seat.life == Life::present && !seat.held;
    if (waits && s_.watched_state(seat.id()) != NmtState::operational) seat.boot_again();
    co_return;
  }
  // It ran a moment ago: a second device may have booted, which sends no heartbeat and is not heard again.
  const bool was_there = seat.there() || seat.life == Life::asked;
  if (was_there && seat.slave.status.ready()) startup_.error_event(seat, "it booted by itself");
  if (was_there && seat.is_booted()) seat.doubt.shared = std::max(seat.doubt.shared, 1U);
  // The slot's own device, or one that sat here before?
  co_await spares_.isolate_former(seat);
  co_await came_back(seat, at);
}

void Supervision::lost(Seat& seat) {
  // A device that booted may send no heartbeat before it is configured; its boot-up shows whether it is there.
  const bool gone = s_.heartbeats.lost(seat.id()) || !s_.watched_state(seat.id());
  if (!seat.there() || !gone) return;
  const std::string why = silence_of(seat);
  if (seat.slave.status.ready()) startup_.error_event(seat, why);
  slots_.set_absent(seat, why);
  make_free(seat);
}

// The first heartbeat of a device with letter K shows its state. Its period is not known yet.
bool Supervision::hears_at_last(Seat& seat) {
  const auto heard = s_.boots.heard(seat.id());
  const bool beats = seat.is_unheard() && heard && *heard > seat.since;
  if (!beats) return false;
  seat.configuration.stuck = false;
  if (s_.boots.state(seat.id()) != NmtState::operational) {
    slots_.happened(seat, SlotEvent::tried_again, "trying again");
    seat.boot_again();
    return true;
  }
  seat.set_letter(manager::BootStatus::booted);
  seat.slave.status.phase = network::SlavePhase::started;
  slots_.happened(seat, SlotEvent::operational);
  if (slots_.operational()) slots_.events().reach(Milestone::operational);
  return true;
}

rt::Task<void> Supervision::ask_the_unwatched() {
  for (const auto& seat : slots_.seats()) {
    if (hears_at_last(*seat)) continue;
    const rt::Duration pause = heartbeat_timeout(s_.bus.timing, *seat);
    const auto steady = s_.boots.steady(seat->id());
    const bool beats = seat->rate.by_sdo && seat->life == Life::operational && steady;
    if (beats) ErrorControl(s_, slots_).take_period(*seat, *steady);
    // A device of another type was not configured to send heartbeats.
    const bool unfit = seat->life == Life::unfit && !s_.only_observes() && !s_.heard_within(seat->id(), pause);
    const bool watched = (seat->rate.by_sdo && seat->life == Life::operational) || seat->is_unheard() || unfit;
    if (!watched || s_.executor.now() < seat->rate.at + pause) continue;
    const auto type = co_await s_.sdo.read<std::uint32_t>(seat->id(), 0x1000, 0);
    seat->rate.at = s_.executor.now();
    // A device on a bus without acknowledgement is away, too.
    const bool silent = !type && (type.error().code == Errc::timeout || type.error().code == Errc::bus);
    if (silent && (seat->rate.by_sdo || unfit)) lost(*seat);
  }
}

void Supervision::give_up_silent() {
  const auto& timing = s_.bus.timing;
  const rt::Time long_ago = s_.executor.now() - std::max<rt::Duration>(timing.heartbeat_timeout, timing.boot_timeout);
  for (auto& seat : slots_.seats()) {
    const auto& record = seat->slot.record;
    const bool settled = record.confirmed && !record.intended;
    if (settled && seat->last.seen && seat->life == Life::absent && seat->since <= long_ago) make_free(*seat);
  }
}

void Supervision::look_at_voices() {
  for (auto& seat : slots_.seats()) {
    const bool lately = s_.heard_within(seat->id(), s_.bus.timing.heartbeat_timeout);
    const bool lent = loans_.to_another(seat->id(), Identity{}) != nullptr;
    if (seat->slot.record.device() || !lately || lent) continue;
    agenda_.look_anew = true;
    hurry(*seat);
  }
}

// With `replacement = "auto"` its slot is free for the next device of its type.
void Supervision::make_free(Seat& seat) {
  const bool automatic = seat.slot.spec.replacement == places::Replacement::automatic;
  if (!automatic || !seat.slot.record.device()) return;
  const auto cleared = slots_.clear(seat, "it fell silent, and the machine file says replacement = \"auto\"");
  if (!cleared) slots_.events().tell(EventKind::error, seat.name(), describe(cleared.error()));
  agenda_.look_anew = true;
  agenda_.anew_at = s_.executor.now();  // a device that waited for the slot is seated
  seat.last.hurried = {};
  // A replacement that comes now is heard at once; the long search for devices with a node-ID would delay it.
  agenda_.rest_at = std::max(agenda_.rest_at, s_.executor.now() + 8 * s_.bus.timing.probe_period);
}

// Two devices under one node-ID, one started and one not, look like one device that leaves operational at each
// heartbeat.
void Supervision::doubt_who_leaves(Seat& seat) {
  constexpr unsigned often = 3;
  const rt::Time now = s_.executor.now();
  const bool soon = seat.left_lately(now, heartbeat_period(s_.bus.timing, seat));
  if (now - seat.last.left > std::chrono::minutes(10)) seat.last.doubts = 0;
  seat.last.left = now;
  seat.last.leaves = soon ? seat.last.leaves + 1 : 1;
  if (seat.last.leaves < often) return;
  seat.last.leaves = 0;
  doubt_alone(seat, agenda_);
  // It was looked for before, and nobody was found: it hears nothing, or there is none.
  if (++seat.last.doubts < 2) return;
  slots_.happened(
      seat, SlotEvent::doubted,
      "its heartbeat reports operational and another state in turn: a second device, which answers nothing, "
      "holds this node-ID, or the device leaves operational again and again; take the second one off the bus, or "
      "replace the device");
}

rt::Task<void> Supervision::told_state(Seat& seat) {
  const auto state = s_.watched_state(seat.id());
  // It answers SDO now, and can be identified.
  const bool answers = seat.life == Life::stopped && state && *state != NmtState::stopped;
  if (answers) co_return co_await presence_.ask_seat(seat);
  const bool left = seat.life == Life::left && state && *state != NmtState::operational;
  if (!left) {
    // For example from stopped to pre-operational, as commanded.
    const bool made_else = seat.held && seat.life == Life::present && state;
    if (made_else) slots_.happened(seat, SlotEvent::pauses, made(*state, seat.id()));
    co_return;
  }
  // A second device under this node-ID reports its own state.
  const rt::Time told = s_.executor.now();
  const bool other = co_await spares_.isolate_former(seat);
  if (other) co_return co_await came_back(seat, told);
  if (!stays(seat, *state)) seat.boot_again();
  slots_.happened(seat, SlotEvent::pauses, text_of_leaving(seat, *state));
}

// A device that boots again and again, and is not taken, must not keep the bus busy.
void Supervision::hurry(Seat& seat) {
  const rt::Time now = s_.executor.now();
  const bool lately = seat.last.hurried != rt::Time{} && now < seat.last.hurried + 8 * s_.bus.timing.probe_period;
  if (lately) return;
  seat.last.hurried = now;
  agenda_.anew_at = std::min(agenda_.anew_at, now);
}

// A device booted, or was heard again, under the slot's node-ID: is it the slot's device?
rt::Task<void> Supervision::came_back(Seat& seat, rt::Time booted) {
  const bool told = std::exchange(seat.last.heard_again, s_.executor.now()) == s_.executor.now();
  if (!told)
    slots_.events().tell(EventKind::step, seat.name(), fmt::format("node-ID {} is heard again", seat.id().value()));
  const std::string cause = seat.reason;
  const unsigned restarts = restarts_by_configuration(seat.configuration, booted, s_.bus.timing.boot_timeout);
  slots_.happened_silently(seat, SlotEvent::heard_again);
  seat.held = seat.configuration.stuck = false;
  seat.polled = true;
  seat.doubt.other = {};
  seat.slave.forget();
  if (seat.power_cycle.binding) {
    co_await seating_.go_on_after_power_cycle(seat);
    co_return;
  }
  if (!seat.slot.record.confirmed) {
    agenda_.look_anew = true;
    hurry(seat);
    co_return;
  }
  co_await presence_.ask_seat(seat);
  // It was identified before it booted again: what was read is outdated.
  if (s_.boots.boot_up(seat.id()) && *s_.boots.boot_up(seat.id()) > booted) seat.checked = booted;
  if (restarts < most_restarts || seat.life != Life::present) co_return;
  seat.configuration.restarts = 0;
  seat.configuration.stuck = true;
  slots_.happened(seat, SlotEvent::boot_failed, restarted_each_time(cause, restarts), manager::BootStatus::j);
}

}  // namespace berth::operate

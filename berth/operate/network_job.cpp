// The main job, top to bottom.
#include <fmt/format.h>

#include <algorithm>

#include "berth/operate/master_device.hpp"
#include "berth/operate/network_seat.hpp"

namespace berth::operate {

using places::SlotState;

namespace {

// Why a slot stays as it is: a person's command did it.
std::string made(NmtState state, NodeId id) {
  return fmt::format("it was made {}; `berth nmt start {}` starts it", berth::name(state), id.value());
}

}  // namespace

rt::Task<void> Network::job() {
  for (bool first = true;; first = false) {
    co_await work(first);
    if (search_open_) {
      co_await handle_what_came();
    } else {
      co_await watch();
    }
  }
}

// Between two parts of a long search: what the bus told meanwhile, and a person's command, do not wait for its end.
rt::Task<void> Network::handle_what_came() {
  co_await turn_.take();
  const rt::Held held(turn_);
  while (wakes_.size() > 0) {
    const rt::Time now = executor_->now();
    const auto wake = co_await wakes_.next(now);
    if (!wake) break;
    const Wake w = *wake;
    co_await handle(w);
  }
}

// The turn is given back also when the job is ended in the middle.
rt::Task<void> Network::work(bool first) {
  co_await turn_.take();
  const rt::Held held(turn_);
  idle_ = false;
  if (first) {
    co_await opening();
    co_await prepare();
  }
  co_await round();
  // A search can take longer than the pause before the next one, which begins when it is over.
  const auto pause = std::exchange(retries_, false) ? 8 : 1;
  retry_at_ = std::max(retry_at_, executor_->now() + pause * bus_->timing.probe_period);
  anew_at_ = std::max(anew_at_, executor_->now() + 2 * bus_->timing.probe_period);
  idle_ = !search_open_;
}

// What failed may succeed later: the device was slow, deaf or resetting. Not at once, and not for ever in a hurry.
bool Network::retry_due() {
  const bool needs = std::ranges::any_of(seats_, [](const auto& s) {
    const bool asked = s->slot.record.asked.has_value();
    const bool silent = s->state == SlotState::absent && s->slot.record.confirmed;
    const bool waits = !s->slot.spec.optional && (s->state == SlotState::empty || s->state == SlotState::question);
    const bool doubled = s->state == SlotState::duplicate;
    const bool failed = s->state == SlotState::failed && !s->stuck;
    const bool powered = s->state == SlotState::power_cycle && !s->waits_since;
    return failed || powered || asked || silent || waits || doubled;
  });
  // One that failed left a device under a node-ID that is not its own, the master's say.
  const bool blanks =
      std::ranges::any_of(plan_.actions, [](const auto& a) { return a.kind == places::Action::Kind::blank; });
  if ((!needs && !blanks) || executor_->now() < retry_at_) return false;
  retry_at_ = executor_->now() + 8 * bus_->timing.probe_period;
  retries_ = true;
  look_anew_ = true;
  for (auto& seat : seats_) {
    const bool again = seat->state == SlotState::failed && seat->there && !seat->stuck;
    const auto heard = boots_.heard(seat->id());
    const bool beats = heard && executor_->now() - *heard <= bus_->timing.heartbeat_timeout;
    if (again && beats) set_state(*seat, SlotState::present, "trying again");
    const bool troubled = seat->state == SlotState::absent || seat->state == SlotState::duplicate || seat->misplaced;
    const bool silent = again && !beats;  // it may have left before its heartbeat was waited for
    seat->ask_again = (troubled || silent) && seat->slot.record.confirmed && !seat->slot.record.asked;
    if (seat->state == SlotState::duplicate && !seat->slot.record.device())
      set_state(*seat, SlotState::empty, "looking again");
  }
  return true;
}

rt::Task<void> Network::round() {
  for (auto& seat : seats_) {
    const bool again = std::exchange(seat->ask_again, false);
    const bool twins = again && seat->state == SlotState::duplicate;
    if (twins) {
      const LssAddress device = seat->slot.record.confirmed->device;
      const auto id = co_await active_id(device);
      const bool still = !id && id.error().code == Errc::duplicate;
      if (still) continue;
    }
    const bool troubled = again || seat->suspect;
    if (troubled) {
      const bool other = co_await isolate_former(*seat);
      const bool asks = other || again;
      if (asks) co_await ask_seat(*seat);
    }
    const bool elsewhere = again && !seat->there;
    if (elsewhere) co_await look_by_lss(*seat);
  }
  if (bus_->role != design::Role::observer) {
    for (auto& seat : seats_) {
      const bool fixed = seat->slot.spec.assign == places::Assign::fixed && !seat->slot.record.confirmed;
      if (fixed) co_await adopt_fixed(*seat);
    }
    const bool everybody = false;
    co_await discover();
    co_await tell_seats_apart();
    co_await carry_out();
    const bool others = co_await find_configured(everybody);
    co_await bind_by_recipe();
    if (others) co_await carry_out();
    speak();
  }
  for (auto& seat : seats_) {
    const bool none = seat->state == SlotState::unknown && !search_open_;
    if (none) set_state(*seat, SlotState::empty, "no device of its type was found");
  }
  co_await check_and_start();
}

// An interrupted run may have left one device in configuration state with a node-ID pending: the next `04 00` would
// bring it into use. The device that listens gives it up first (berth/places/binding.hpp).
rt::Task<void> Network::opening() {
  phase_ = Phase::opening;
  if (bus_->role == design::Role::observer) co_return;
  const bool unfinished = std::ranges::any_of(seats_, [](const auto& s) { return s->slot.record.asked.has_value(); }) ||
                          !unfinished_here().empty();
  if (unfinished) tell("step", "", "finishing what an earlier run began");
  const auto loaded = loans_.load();
  if (!loaded) tell("error", "", "the slot table cannot be read: " + describe(loaded.error()));
  const bool lends = !loans_.empty();
  if (unfinished || lends) {
    const auto reverted = co_await lss_.configure_node_id(NodeId());
    if (!reverted && reverted.error().code == Errc::bus) tell("error", "", describe(reverted.error()));
  }
  const auto quiet = co_await lss_.switch_global(lss::State::waiting);
  // One that keeps what it was lent pending would be silent until the next reset of all.
  const bool wakes = lends && quiet && may_command();
  if (wakes) {
    co_await rt::sleep_for(bus_->timing.rand_response);  // a single-slot receive buffer would lose it behind `04 00`
    places::wake_unconfigured(dispatcher_);
  }
  alone_ = !quiet;
  if (alone_) tell("error", "", "the bus: " + describe(quiet.error()));
}

// Returns when something is to be done about the bus as a whole: somebody new, or a slot that became free.
rt::Task<void> Network::watch() {
  for (;;) {
    phase_ = Phase::watch;
    const rt::Time deadline = executor_->now() + look_period();
    const auto wake = co_await wakes_.next(deadline);
    co_await turn_.take();
    const rt::Held held(turn_);
    idle_ = false;
    bool look = false;
    if (wake) {
      const Wake w = *wake;
      co_await handle(w);
      look = w.kind == Wake::Kind::look;
    } else {
      check_rates();
      const bool anybody = co_await anybody_new();
      look = anybody;
    }
    const bool due = look || (look_anew_ && executor_->now() >= anew_at_) || retry_due();
    const bool starts = std::ranges::any_of(
        seats_, [](const auto& s) { return s->there && !s->started && s->state == SlotState::present; });
    if (due || starts) co_return;
    idle_ = wakes_.size() == 0;
  }
}

// While a slot waits for its device, who comes is looked for more often: machine and devices are switched on together.
rt::Duration Network::look_period() const noexcept {
  const bool waits =
      std::ranges::any_of(seats_, [](const auto& s) { return s->state == SlotState::empty && !s->slot.spec.optional; });
  return waits ? bus_->timing.probe_period / 8 : bus_->timing.probe_period;
}

rt::Task<void> Network::handle(Wake wake) {
  Seat* const seat = seat_at(wake.node);
  const bool of_ours = wake.kind == Wake::Kind::boot_up && loans_.of_ours(wake.node, wake.at);
  if (of_ours && seat != nullptr && !seat->slot.record.confirmed) co_return;
  if (seat == nullptr) {
    // A boot-up under a node-ID of nobody here, or under the master's own: look who it is.
    const bool lent = loans_.of_ours(wake.node, wake.at);
    if (wake.kind == Wake::Kind::boot_up && !lent) look_anew_ = true;
    co_return;
  }
  switch (wake.kind) {
    case Wake::Kind::boot_up:
      if (wake.at > seat->checked) {
        // It was at work a moment ago: what booted may be a second device, which beats no heart and is not heard again.
        if (seat->there && seat->started) seat->shared = std::max(seat->shared, 1U);
        // The slot's own device, or one that sat here before?
        co_await isolate_former(*seat);
        co_await came_back(*seat, wake.at);
      }
      break;
    case Wake::Kind::lost: {
      const bool gone = heartbeats_.lost(seat->id()) || !heartbeats_.state(seat->id());
      if (!seat->there || !gone) break;
      seat->there = seat->started = false;
      set_state(*seat, SlotState::absent, "its heartbeat stopped; switch the device on, or `berth replace` it");
      const bool automatic = seat->slot.spec.replacement == places::Replacement::automatic;
      if (automatic && seat->slot.record.device()) {
        const auto cleared = clear_seat(*seat, "it fell silent, and the machine file says replacement = \"auto\"");
        if (!cleared) tell("error", seat->name(), describe(cleared.error()));
        look_anew_ = true;
        anew_at_ = executor_->now();  // who waited for the slot is seated
        seat->hurried = {};
        // A replacement that comes now is heard at once; the long search for devices with a node-ID would be in its
        // way.
        rest_at_ = std::max(rest_at_, executor_->now() + 8 * bus_->timing.probe_period);
      }
      break;
    }
    case Wake::Kind::recovered:
      if (!seat->there && wake.at > seat->checked) co_await came_back(*seat, wake.at);
      // It came back before its loss was dealt with; what it tells now may be another state than before.
      [[fallthrough]];
    case Wake::Kind::state: {
      const auto state = heartbeats_.state(seat->id());
      const bool left =
          seat->there && seat->state == SlotState::operational && state && *state != NmtState::operational;
      if (!left) {
        // From stopped to pre-operational, say, as it was told.
        const bool made_else = seat->there && seat->held && seat->state == SlotState::present && state;
        if (made_else) set_state(*seat, SlotState::present, made(*state, seat->id()));
        break;
      }
      // A second device under this node-ID tells its own state.
      const rt::Time told = executor_->now();
      const bool other = co_await isolate_former(*seat);
      if (other) {
        co_await came_back(*seat, told);
        break;
      }
      // Stopped is what somebody told it to be; pre-operational may be its answer to an error, and is started again.
      const bool stays = seat->held || *state == NmtState::stopped;
      seat->started = stays;
      set_state(
          *seat, SlotState::present,
          stays ? made(*state, seat->id()) : fmt::format("it left operational by itself: {}", berth::name(*state)));
      break;
    }
    case Wake::Kind::look: break;
  }
}

// A device that boots again and again, and is not taken, does not keep the bus busy.
void Network::hurry(Seat& seat) {
  const rt::Time now = executor_->now();
  const bool lately = seat.hurried != rt::Time{} && now < seat.hurried + 8 * bus_->timing.probe_period;
  if (lately) return;
  seat.hurried = now;
  anew_at_ = std::min(anew_at_, now);
}

// Somebody booted, or spoke again, under the slot's node-ID: is it the slot's device?
rt::Task<void> Network::came_back(Seat& seat, rt::Time booted) {
  tell("step", seat.name(), fmt::format("node-ID {} is heard again", seat.id().value()));
  seat.there = seat.started = seat.held = seat.stuck = false;
  if (seat.waiting) {
    places::Binding binding = *seat.waiting;
    binding.heard_again();
    const places::Binder::Options options = binder_options();
    places::Binder binder(services(), options);
    const std::string reason = "after its power cycle";
    const places::SlotId slot = seat.slot.record.slot;
    co_await binder.run(binding, slot, reason);
    refresh(seat);
    if (binding.step() == places::Step::done) {
      bound(seat, binding);
    } else {
      not_bound(seat, binding);
    }
    co_return;
  }
  if (!seat.slot.record.confirmed) {
    look_anew_ = true;
    hurry(seat);
    co_return;
  }
  co_await ask_seat(seat);
  // Identified before it booted again: what was read belongs to the life before.
  if (boots_.boot_up(seat.id()) && *boots_.boot_up(seat.id()) > booted) seat.checked = booted;
}

}  // namespace berth::operate

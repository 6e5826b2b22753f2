#include "berth/operate/main_job.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/can/empty_bus.hpp"
#include "berth/operate/error_control.hpp"

namespace berth::operate {

using places::Assign;
using places::SlotState;

const char* name(Phase phase) noexcept {
  switch (phase) {
    case Phase::opening: return "opening";
    case Phase::preparation: return "preparation";
    case Phase::discovery: return "discovery";
    case Phase::binding: return "binding";
    case Phase::start: return "start";
    case Phase::watch: return "watch";
  }
  return "";
}

bool SearchPace::look(const View& now) noexcept {
  if (now == seen_) return false;
  seen_ = now;
  in_vain_ = 0;
  return true;
}

int SearchPace::round() noexcept {
  int periods = usual;
  for (unsigned i = eager; i < in_vain_ && periods < longest; ++i) periods *= 2;
  ++in_vain_;
  return periods;
}

rt::Task<void> MainJob::run() {
  for (bool first = true;; first = false) {
    co_await work(first);
    if (p_.agenda.search_open) {
      co_await handle_what_came();
    } else {
      co_await watch();
    }
  }
}

// The turn is also given back if the job is interrupted.
rt::Task<void> MainJob::work(bool first) {
  co_await p_.bus.turn.take();
  const rt::Held held(p_.bus.turn);
  idle_ = false;
  if (first) {
    p_.startup.begin();
    co_await opening();
    co_await p_.presence.prepare();
  }
  co_await round(first);
  // The pause before the next search begins at the end of this one, which may take longer than the pause.
  Agenda& agenda = p_.agenda;
  const rt::Time now = p_.bus.executor.now();
  const rt::Duration period = p_.bus.bus.timing.probe_period;
  const int pause = std::exchange(agenda.retries, false) ? retry_pause_ : 1;
  agenda.retry_at = std::max(agenda.retry_at, now + pause * period);
  agenda.anew_at = std::max(agenda.anew_at, now + 2 * period);
  idle_ = !agenda.search_open;
}

// An interrupted run may have left one device in configuration state with a node-ID pending: the next `04 00` would
// activate it. A listening device gives it up first (berth/places/binding.hpp).
rt::Task<void> MainJob::opening() {
  BusServices& s = p_.bus;
  p_.agenda.phase = Phase::opening;
  if (s.only_observes()) co_return;
  const bool unfinished =
      std::ranges::any_of(p_.slots.seats(), [](const auto& seat) { return seat->slot.record.intended.has_value(); }) ||
      !p_.slots.unfinished_here().empty();
  const bool other_masters = s.bus.flying.has_value();  // each keeps its unfinished work in its own slot table
  if (unfinished) p_.slots.events().tell(EventKind::step, "", "finishing what an earlier run began");
  if (unfinished) s.foreign_stores.earlier_run_stores_until(s.executor.now() + s.bus.timing.store_timeout);
  const auto loaded = p_.loans.load();
  if (!loaded)
    p_.slots.events().tell(EventKind::error, "", "the slot table cannot be read: " + describe(loaded.error()));
  const bool lends = !p_.loans.empty();
  if (unfinished || lends || other_masters) {
    const auto reverted = co_await s.lss.configure_node_id(NodeId());
    if (!reverted && reverted.error().code == Errc::bus)
      p_.slots.events().tell(EventKind::error, "", describe(reverted.error()));
  }
  const auto quiet = co_await s.lss.switch_global(lss::State::waiting);
  // A device whose lent node-ID stays pending would be silent until the next reset of all.
  const bool wakes = (lends || other_masters) && quiet && s.may_command();
  // A single receive buffer would lose the frame after `04 00`.
  if (quiet) co_await rt::sleep_for(s.bus.timing.rand_response);
  if (wakes) {
    places::wake_unconfigured(s.dispatcher);
    co_await rt::sleep_for(s.bus.timing.rand_response);
  }
  p_.agenda.alone = !quiet;
  if (p_.agenda.alone) p_.slots.events().tell_failure("the bus", quiet.error());
}

namespace {

// A device booted and may be the one that a slot waits for.
bool waits_for_an_answer(const NetworkParts& p) { return p.agenda.comes.any() && !p.bus.only_observes(); }

// The search was interrupted for this device. Seating the found devices takes long: it is asked now and seated with
// them.
rt::Task<void> ask_who_came(NetworkParts& p) {
  if (!p.agenda.search_open || !waits_for_an_answer(p)) co_return;
  const bool all = false;
  co_await p.finding.configured.find(all);
}

}  // namespace

rt::Task<void> MainJob::round(bool first) {
  co_await ask_the_troubled();
  // Before a search, which takes long. The first search finds devices under the node-ID of a slot's own device.
  if (!first) co_await act_on_wakes(p_.agenda.wakes.pop());
  if (!p_.bus.only_observes()) {
    co_await p_.presence.adopt_all_fixed();
    co_await p_.finding.finder.discover();
    co_await ask_who_came(p_);
    co_await p_.duplicates.tell_seats_apart();
    co_await carry_out();
    co_await seat_the_configured();
    port_.speak();
  }
  for (const auto& seat : p_.slots.seats()) tell_whether_empty(*seat);
  co_await start();
}

namespace {

// An earlier run assigned the slot's device its node-ID, or began to: the slot is kept for it.
bool is_kept(const Seat& seat) {
  const auto& record = seat.slot.record;
  const bool by_lss = seat.slot.spec.assign == Assign::lss;
  return by_lss && record.intended && !record.confirmed && !seat.power_cycle.binding;
}

bool is_vacant(const Seat& seat) { return seat.slot.spec.assign == Assign::lss && !seat.slot.record.device(); }

// A device that gave up another node-ID but still uses it counts as known. Null: the slot waits for none.
const Identity* who_fades(const NetworkParts& p, const Seat& seat) {
  if (is_vacant(seat)) return p.erased.waits_for(seat.slot.spec);
  const auto& intended = seat.slot.record.intended;
  const bool own = is_kept(seat) && p.erased.contains(intended->device);
  return own ? &intended->device : nullptr;
}

// The plan of this round is carried out. A device that it still has for this slot did not give up another node-ID, or
// failed in another slot.
const Identity* who_is_left(const NetworkParts& p, const Seat& seat) {
  const auto& actions = p.planning.plan().actions;
  const auto left = std::ranges::find_if(actions, [&](const places::Action& a) {
    return a.kind == places::Action::Kind::bind && p.slots.seats()[a.slot].get() == &seat;
  });
  return left == actions.end() ? nullptr : &left->device;
}

// Found devices count as known: one that is silent now, until a search for all is over, and one that could not be
// seated yet. Empty: there is none.
std::string who_is_known(const NetworkParts& p, const Seat& seat) {
  if (!is_vacant(seat)) return {};
  const Identity* const left = who_is_left(p, seat);
  if (left != nullptr) return fmt::format("{} was found and could not be bound: Berth tries again", to_string(*left));
  const Identity* const silent = p.found.silent_for(seat.slot.spec);
  if (silent != nullptr)
    return fmt::format("{} was found and no longer answers: Berth looks for it", to_string(*silent));
  const auto equal = std::ranges::find_if(p.found.all(), [&](const auto& f) {
    return !f.device.has_serial() && !f.clone && p.slots.of(f.device) == nullptr &&
           places::fits(seat.slot.spec, f.device);
  });
  if (equal == p.found.all().end()) return {};
  return fmt::format("{} has no serial number: it may be the one that another slot waits for",
                     to_string(equal->device));
}

// A node that booted and was recently heard. One that left again is no reason to wait.
bool one_is_asked_next(const NetworkParts& p) {
  if (!waits_for_an_answer(p)) return false;
  for (std::uint8_t i = 1; i <= 127; ++i) {
    if (p.agenda.comes.test(i) && p.bus.heard_within(NodeId(i), p.bus.bus.timing.boot_timeout)) return true;
  }
  return false;
}

// `news`: not reported yet.
void tell_nobody(NetworkParts& p, Seat& seat, bool news) {
  std::string why = who_is_known(p, seat);
  const bool stale = seat.misses_one && why.empty() && seat.life == Life::empty && !p.agenda.search_open;
  if (!news && !stale) return;
  if (why.empty() && one_is_asked_next(p)) return;
  // Not every round searches for all.
  constexpr unsigned rounds_in_vain = 4;
  const bool were_two = why.empty() && seat.last.failed == SlotState::duplicate;
  if (were_two && ++seat.doubt.in_vain < rounds_in_vain) return;
  seat.misses_one = !why.empty();
  if (were_two) why = "two devices were found for it, and none answers now: Berth looks for them";
  // A device may lack the services of every search; then it only answers to its full address.
  if (why.empty())
    why = "no device of its type was found; one that answers no search needs its slot's `spares` and `revision`";
  if (p.bus.only_observes()) why = "an observer sends nothing, and the slot table has no device for this slot";
  if (p.agenda.alone) why = can::no_acknowledge;
  p.slots.happened(seat, SlotEvent::nobody, why);
}

}  // namespace

void MainJob::tell_whether_empty(Seat& seat) {
  const Identity* const waits = who_fades(p_, seat);
  const bool none = seat.life == Life::unknown && !p_.agenda.search_open;
  if (waits != nullptr && (none || seat.life == Life::empty)) {
    p_.slots.happened(
        seat, SlotEvent::waits_for_power,
        fmt::format("{} has its type and released another node-ID: switch it off and on, then Berth binds it",
                    to_string(*waits)));
    return;
  }
  const bool shared = p_.erased.user_of(seat.id()) != nullptr;
  // The wait ended, perhaps after this round's plan: the next look at all devices shows the slot's state.
  const bool over = (is_vacant(seat) || is_kept(seat)) && waits == nullptr && !shared && seat.life == Life::waits;
  const bool fits_one = over && std::ranges::any_of(p_.found.all(), [&](const auto& f) {
                          return p_.slots.of(f.device) == nullptr && !f.clone && places::fits(seat.slot.spec, f.device);
                        });
  if (over && (fits_one || !p_.agenda.retries)) p_.agenda.look_anew = true;
  if (fits_one) {
    p_.slots.happened(seat, SlotEvent::nobody, "looking again");
    return;
  }
  tell_nobody(p_, seat, none || (over && p_.agenda.retries));
}

rt::Task<void> MainJob::ask_the_troubled() {
  for (const auto& seat : p_.slots.seats()) {
    const bool asks = seat->ask_again || seat->doubt.suspect;
    if (asks) co_await look_again_at(*seat);
  }
}

rt::Task<void> MainJob::look_again_at(Seat& seat) {
  const bool again = std::exchange(seat.ask_again, false);
  const bool clones = again && seat.state() == SlotState::duplicate;
  if (clones) {
    const Identity device = seat.slot.record.confirmed->device;
    const auto id = co_await p_.asking.active_id(device);
    const bool still = !id && id.error().code == Errc::duplicate;
    if (still) co_return;
  }
  const bool other = co_await p_.spares.isolate_former(seat);
  if (other || again) co_await p_.presence.ask_seat(seat);
  const bool elsewhere = again && !seat.there();
  if (elsewhere) co_await p_.presence.look_by_lss(seat);
}

rt::Task<void> MainJob::carry_out() {
  co_await p_.seating.carry_out();
  p_.finding.finder.rest_from_searching();
}

// Devices that only SDO finds, and those without LSS.
rt::Task<void> MainJob::seat_the_configured() {
  const bool all = false;
  const bool others = co_await p_.finding.configured.find(all);
  co_await p_.recipes.bind_all();
  if (others) co_await carry_out();
}

rt::Task<void> MainJob::start() {
  const bool operational = co_await p_.starter.check_and_start();
  if (operational) p_.startup.network_operational();
}

// ---- between the rounds ----

// Between two parts of a long search: messages from the bus and a user's command do not wait for its end. A device that
// booted does not either: it is asked by SDO, and by LSS if it has to be moved, as no device of the search is in LSS
// configuration now.
rt::Task<void> MainJob::handle_what_came() {
  co_await p_.bus.turn.take();
  const rt::Held held(p_.bus.turn);
  co_await act_on_wakes(p_.agenda.wakes.pop());
  if (!waits_for_an_answer(p_)) co_return;
  co_await seat_the_configured();
  co_await act_on_wakes(p_.agenda.wakes.pop());
}

// `wake` first, then all others. True: a round is wanted.
rt::Task<bool> MainJob::act_on_wakes(std::optional<Wake> wake) {
  bool wants_round = false;
  p_.agenda.calls = false;
  for (; wake; wake = p_.agenda.wakes.pop()) {
    wants_round = wants_round || wake->kind == Wake::Kind::look;
    co_await p_.supervision.handle(*wake);
    co_await p_.startup.act_on_error();
  }
  // A second device under a node-ID is separated from the slot's own before anything is written there; one that
  // answered, or was found, is left to the next round.
  const auto doubted = [](const auto& s) { return s->doubt.shared > 1; };
  const auto shared = [&](const auto& s) { return s->there() && p_.found.any_at(s->id()); };
  if (!p_.starter.is_due() || std::ranges::any_of(p_.slots.seats(), doubted)) co_return wants_round;
  if (!p_.bus.only_observes()) co_await p_.duplicates.tell_seats_apart();
  if (std::ranges::none_of(p_.slots.seats(), shared)) co_await start();
  co_return wants_round;
}

// Returns when something is to be done for the whole bus: a new device, or a slot that became free.
rt::Task<void> MainJob::watch() {
  bool due = false;
  while (!due) {
    p_.agenda.phase = Phase::watch;
    due = co_await look();
  }
}

namespace {

// A device of another type, or one that does not report its type, does not end the search: it may leave.
bool lacks_one(const Seat& seat) {
  const bool has_other = seat.life == Life::stranger || seat.life == Life::absent;
  const bool fixed = seat.slot.spec.assign == Assign::fixed && !seat.slot.record.confirmed;
  return seat.life == Life::empty || seat.state() == SlotState::question || (fixed && has_other);
}

// It waits for a device that was never seen.
bool waits_for_one(const Seat& seat) { return !seat.slot.spec.optional && lacks_one(seat); }

// Something was tried for the slot without success.
bool is_troubled(const Seat& seat) {
  const bool asked = seat.slot.record.intended.has_value();
  const bool silent = seat.life == Life::absent && seat.slot.record.confirmed;
  const bool doubled = seat.shown_state() == SlotState::duplicate;
  const bool failed = seat.state() == SlotState::failed && !seat.configuration.stuck;
  const bool powered = seat.state() == SlotState::power_cycle && !seat.configuration.waits_since;
  return failed || powered || asked || silent || doubled;
}

// Two devices under the node-ID of a slot without a device stay until a user removes one.
bool waits_for_a_hand(const NetworkParts& p) {
  const auto is_other = [](const auto& s) {
    return is_troubled(*s) && (s->life != Life::doubled || s->slot.record.device());
  };
  return std::ranges::none_of(p.slots.seats(), is_other) && !p.planning.has_blanks();
}

// The slot's reported state stays until the look has ended.
void look_anew(SlotTable& slots, Seat& seat) {
  const SlotState before = seat.shown_state();
  if (seat.life == Life::doubled) seat.doubt.in_vain = 0;
  if (slots.happened_silently(seat, SlotEvent::rests)) seat.last.failed = before;
}

SearchPace::View view_of(const NetworkParts& p) {
  SearchPace::View view{.found = p.found.size()};
  for (const auto& seat : p.slots.seats()) view.lives = view.lives * 31 + static_cast<unsigned>(seat->life);
  for (std::uint8_t i = 1; i <= 127; ++i) {
    const NodeId id(i);
    view.boot_ups += p.bus.boots.boot_ups(id);
    view.heard += p.bus.boots.heard(id) ? 1U : 0U;
  }
  return view;
}

}  // namespace

rt::Task<bool> MainJob::look() {
  Agenda& agenda = p_.agenda;
  const rt::Time deadline = p_.bus.executor.now() + look_period();
  const auto wake = co_await agenda.wakes.next(deadline);
  co_await p_.bus.turn.take();
  const rt::Held held(p_.bus.turn);
  idle_ = false;
  p_.supervision.tell_repeated_emcys();
  bool wanted = co_await act_on_wakes(wake);
  if (wanted) pace_.hurry();  // a user's command
  if (!wake) {
    p_.supervision.check_rates();
    co_await p_.supervision.ask_who_beats_fast();
    p_.supervision.give_up_silent();
    co_await p_.supervision.ask_the_unwatched();
    p_.supervision.look_at_voices();
    const bool untold = co_await p_.spares.look_for_formers();
    if (untold) co_await p_.duplicates.tell_seats_apart();
    const bool anybody = co_await p_.finding.finder.anybody_new();
    wanted = wanted || anybody;
  }
  const rt::Time now = p_.bus.executor.now();
  if (pace_.look(view_of(p_)))
    agenda.retry_at = std::min(agenda.retry_at, now + SearchPace::usual * p_.bus.bus.timing.probe_period);
  const bool anew = agenda.look_anew && now >= agenda.anew_at;
  const bool again = retry_due();  // also if a search is due: each look finds two of one address
  const bool untold = waits_for_an_answer(p_) &&
                      std::ranges::any_of(p_.slots.seats(), [](const auto& s) { return s->life == Life::unknown; });
  if (wanted || anew || again || untold || p_.starter.is_due()) co_return true;
  idle_ = agenda.wakes.size() == 0;
  co_return false;
}

// While a slot waits for its device, new devices are looked for more often: machine and devices are often switched on
// together.
rt::Duration MainJob::look_period() const noexcept {
  const bool waits = std::ranges::any_of(
      p_.slots.seats(), [](const auto& s) { return s->life == Life::empty && !s->slot.spec.optional; });
  const rt::Duration period = p_.bus.bus.timing.probe_period;
  return waits && pace_.is_eager() ? period / 8 : period;
}

bool MainJob::has_trouble() const {
  const bool slots = std::ranges::any_of(p_.slots.seats(), [](const auto& s) { return is_troubled(*s); });
  // A failed blanking left a device under a node-ID that is not its own, for example the master's. It may have been
  // storing.
  return slots || p_.planning.has_blanks() || waits_for_unfinished() || p_.finding.finder.waits_for_forgotten();
}

bool MainJob::lacks_optional() const {
  return std::ranges::any_of(p_.slots.seats(), [](const auto& s) { return s->slot.spec.optional && lacks_one(*s); });
}

// An absent device is not asked forever.
bool MainJob::waits_for_unfinished() const {
  constexpr unsigned enough = 3;
  return unfinished_looks_ < enough && !p_.slots.unfinished_here().empty();
}

// Failed work may succeed later: the device was slow, deaf or resetting. It is retried after a pause, which grows.
bool MainJob::retry_due() {
  const rt::Time now = p_.bus.executor.now();
  const auto& timing = p_.bus.bus.timing;
  const bool optional_due = now >= optional_at_ && lacks_optional();
  const bool trouble = has_trouble();
  const bool waits = std::ranges::any_of(p_.slots.seats(), [](const auto& s) { return waits_for_one(*s); });
  if (now < p_.agenda.retry_at || !(trouble || waits || optional_due)) return false;
  const bool hurries = trouble && (waits_for_unfinished() || !waits_for_a_hand(p_));
  if (hurries) pace_.hurry();
  retry_pause_ = pace_.round();
  p_.agenda.retry_at = now + retry_pause_ * timing.probe_period;
  optional_at_ = now + 64 * timing.probe_period;
  const unsigned blanks = p_.seating.blanks();
  unfinished_looks_ = std::exchange(blanks_, blanks) == blanks ? unfinished_looks_ + 1 : 1;
  p_.agenda.retries = true;
  p_.agenda.look_anew = true;
  for (const auto& seat : p_.slots.seats()) {
    const bool again = seat->life == Life::failed && !seat->configuration.stuck;
    const bool beats = p_.bus.heard_within(seat->id(), heartbeat_timeout(timing, *seat));
    // A gateway stops itself when a mandatory bus beneath it failed, and a stopped device answers no SDO.
    const bool stopped_itself = again && beats && !seat->held && p_.bus.boots.state(seat->id()) == NmtState::stopped;
    if (stopped_itself) p_.bus.nmt.queue(co::NmtCommand::enter_pre_operational, seat->id());
    if (again && beats) {
      p_.slots.happened(*seat, SlotEvent::tried_again, "trying again");
      seat->boot_again();  // it may have been started, and obeyed too late
    }
    const bool troubled =
        seat->life == Life::absent || seat->state() == SlotState::duplicate || seat->life == Life::misplaced;
    const bool silent = again && !beats;  // it may have left before its heartbeat was watched
    const bool two_voices = seat->life == Life::suspect && seat->left_lately(now, heartbeat_period(timing, *seat));
    seat->ask_again = (troubled || silent) && seat->polled && seat->slot.record.confirmed &&
                      !seat->slot.record.intended && !two_voices;
    const bool unknown_duplicate = seat->life == Life::doubled && !seat->slot.record.device();
    if (unknown_duplicate) look_anew(p_.slots, *seat);
  }
  return true;
}

// ---- once ----

namespace {

// Resets the agenda, also if the command is interrupted.
class Once {
 public:
  Once(Agenda& agenda, std::string method) : agenda_(agenda) {
    agenda_.of_command = std::move(method);
    agenda_.once = agenda_.look_anew = true;
  }
  ~Once() {
    agenda_.of_command.clear();
    agenda_.once = false;
  }
  Once(const Once&) = delete;
  Once& operator=(const Once&) = delete;

 private:
  Agenda& agenda_;
};

}  // namespace

rt::Task<Result<void>> MainJob::bind_once(std::string method) {
  co_await p_.bus.turn.take();
  const rt::Held held(p_.bus.turn);
  const Once once(p_.agenda, std::move(method));
  co_await opening();
  co_await p_.presence.prepare();
  co_await p_.finding.finder.discover();
  co_await carry_out();
  co_await p_.presence.adopt_all_fixed();
  co_await seat_the_configured();
  co_return all_there();
}

rt::Task<Result<void>> MainJob::bind_from_scratch(bool confirmed) {
  co_await p_.bus.turn.take();
  const rt::Held held(p_.bus.turn);
  if (!confirmed) co_return fail(Errc::invalid, "every device would lose its node-ID; confirm it with --yes");
  if (!p_.bus.may_command()) co_return fail(Errc::unsupported, "this bus is not commanded by Berth (role)");
  const auto halted = co_await p_.bus.nmt.send(co::NmtCommand::enter_pre_operational, co::NmtTarget::all());
  if (!halted) co_return fail(halted.error());
  co_await opening();
  const auto blanked = co_await blank_all();
  if (!blanked) co_return fail(blanked.error());
  co_await p_.presence.adopt_all_fixed();
  co_await p_.recipes.bind_all();
  co_await carry_out();
  co_return all_there();
}

rt::Task<Result<void>> MainJob::blank_all() {
  const std::string reason(places::from_scratch);
  for (const auto& seat : p_.slots.seats()) {
    if (!seat->slot.record.device()) continue;
    const auto cleared = p_.slots.clear(*seat, reason);
    if (!cleared) co_return fail(cleared.error());
  }
  p_.found.clear();
  p_.agenda.look_anew = true;
  co_await p_.finding.finder.discover();
  const bool all = true;
  co_await p_.seating.inquire_found(all);
  co_await p_.finding.configured.find(all);
  const std::vector<places::Found> found = p_.found.all();
  for (const auto& f : found) {
    const bool blanks = f.active.configured() && !f.clone && !p_.planning.never_by_lss(f.device);
    if (!blanks) continue;
    const Identity device = f.device;
    co_await p_.seating.blank(device, reason);
  }
  co_return Result<void>{};
}

Result<void> MainJob::all_there() const {
  const bool all =
      std::ranges::all_of(p_.slots.seats(), [](const auto& s) { return s->slot.spec.optional || s->there(); });
  if (!all) return fail(Errc::not_found, "not every slot has its device; see the report");
  return {};
}

}  // namespace berth::operate

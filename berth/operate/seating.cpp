#include "berth/operate/seating.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/base/shell_word.hpp"
#include "berth/operate/plants_master.hpp"
#include "berth/places/odd_identity.hpp"

namespace berth::operate {

using places::Action;
using places::Binding;
using places::Mark;

namespace {

// The identities as which the device was found: one without a serial number has another node-ID now.
std::vector<Identity> names_of(const Binding& binding) {
  const Identity& device = binding.assignment().device;
  if (device.has_serial()) return {device};
  return {device, device.with(NodeId()), device.with(binding.old_id())};
}

// Returns the store's error.
rt::Task<std::optional<Error>> walk(places::Binder::Services services, places::Binder::Options options,
                                    Binding& binding, places::SlotId slot, std::string reason) {
  places::Binder binder(services, options);
  co_await binder.run(binding, slot, reason);
  co_return binder.store_said();
}

rt::Task<bool> recall(BusServices& services, Lending& lending, Identity device) {
  co_await services.lss_turn.take();
  const rt::Held lss(services.lss_turn);
  co_return co_await lending.recall(device);
}

// The device fits several free slots, and one takes devices that another does not: the choice decides whether both are
// filled.
bool may_choose(const SlotTable& slots, const Identity& device) {
  const places::SlotSpec* first = nullptr;
  for (const auto& seat : slots.seats()) {
    const auto& spec = seat->slot.spec;
    if (seat->slot.record.device() || !places::fits(spec, device)) continue;
    if (first == nullptr) first = &spec;
    if (spec.rule != first->rule || spec.revision != first->revision || spec.also != first->also) return true;
  }
  return false;
}

// Of an LSS address: it may be of a device that was found with a node-ID and reports less in 1018h.
bool may_be_known(const FoundDevices& found, const Identity& device) {
  return std::ranges::any_of(found.all(), [&](const places::Found& f) {
    return f.device.unknown != 0 && f.active.configured() && f.device.agrees(device);
  });
}

}  // namespace

rt::Task<void> Seating::carry_out() {
  agenda_.phase = Phase::binding;
  avoid_.clear();
  bool inquired_all = false;
  co_await unfinished_.look(avoid_);
  planning_.make(places_.readings());
  if (!found_.empty()) {
    co_await inquire_found(false);
    free_for_spares();
    equals_.seat_again();
    free_absent_slots();
    planning_.make(places_.readings());
  }
  // A device that must be read first is seated by the second plan; if it must give up a node-ID before, by the third.
  for (int pass = 0; pass < 3; ++pass) {
    co_await carry_out_actions(inquired_all);
    if (planning_.plan().probes.empty()) break;
    const bool read = co_await places_.read_places(planning_.plan().probes);
    planning_.make(places_.readings());
    if (!read) break;
  }
  places_.note_puzzling(planning_.plan().questions);
  // During the search devices keep their loans: otherwise it would find them all again.
  if (!agenda_.search_open) co_await lending_.take_back_all();
  planning_.report();
  const bool any =
      std::ranges::any_of(slots_.seats(), [](const auto& s) { return s->slot.record.confirmed.has_value(); });
  if (any) slots_.events().reach(Milestone::bound);
}

rt::Task<void> Seating::carry_out_actions(bool& inquired_all) {
  for (;;) {
    co_await lending_.take_back_what_is_in_the_way(planning_.plan().actions);
    co_await verify_vacancy();
    const std::vector<Action> actions = planning_.plan().actions;
    std::vector<Identity> failed;
    bool freed = false;  // node-IDs, since they were last asked
    for (const auto& action : actions) {
      if (action.kind != Action::Kind::blank || is_avoided(action.device)) continue;
      const bool good = co_await act(action);
      freed = freed || good;
      // Another device may have failed because of the node-ID that is free now.
      if (good) avoid_.clear();
      if (!good) failed.push_back(action.device);
      if (!good) break;
    }
    if (failed.empty()) {
      if (freed) co_await verify_vacancy();
      co_await bind_side_by_side(actions, failed);
    }
    std::ranges::copy(failed, std::back_inserter(avoid_));
    const bool asks = !failed.empty() && !inquired_all && !found_.empty();
    if (asks) {
      inquired_all = true;
      co_await inquire_found(true);
    }
    planning_.make(places_.readings());
    if (failed.empty()) break;
  }
}

// Asks all node-IDs to be assigned side by side: one timeout for all.
rt::Task<void> Seating::verify_vacancy() {
  const auto is_known = [this](NodeId id) {
    const auto& vacant = s_.vacancy[id.value()];
    return vacant && s_.boots.vacant_since(id, *vacant);
  };
  std::vector<NodeId> unknown;
  if (!agenda_.speaks && !is_known(s_.bus.master)) unknown.push_back(s_.bus.master);
  for (const auto& action : planning_.plan().actions) {
    if (action.kind != Action::Kind::bind) continue;
    const NodeId id = slots_.seats()[action.slot]->id();
    if (!is_known(id)) unknown.push_back(id);
  }
  if (unknown.empty()) co_return;
  // A single receive buffer would lose its question after the `04 00` of the last LSS service.
  co_await rt::sleep_for(s_.bus.timing.rand_response);
  rt::Scope asked(s_.executor, asking_.most_at_once());
  for (const NodeId id : unknown) asked.spawn(asking_.vacancy(id));
  co_await asked.join();
}

bool Seating::is_avoided(const Identity& device) const noexcept {
  return std::ranges::find(avoid_, device) != avoid_.end();
}

// While one device boots under its new node-ID, the next gets its own, and finished ones are started.
rt::Task<void> Seating::bind_side_by_side(const std::vector<Action>& actions, std::vector<Identity>& failed) {
  constexpr std::size_t most_bindings = 16;
  rt::Scope starts(s_.executor, asking_.most_at_once());
  rt::Scope bindings(s_.executor, std::min(most_bindings, asking_.most_at_once()));
  for (const auto& action : actions) {
    const bool binds = action.kind == Action::Kind::bind && !is_avoided(action.device);
    if (binds) bindings.spawn(act_aside(action, failed, starts));
  }
  co_await bindings.join();
  co_await starts.join();
}

rt::Task<void> Seating::act_aside(const Action& action, std::vector<Identity>& failed, rt::Scope& starts) {
  const bool good = co_await act(action);
  if (!good) failed.push_back(action.device);
  if (good && !agenda_.once) starts.spawn(starter_->start_early(*slots_.seats()[action.slot]));
}

rt::Task<bool> Seating::act(const Action& action) {
  const Identity device = action.device;
  const std::string reason = action.reason;
  if (action.kind == Action::Kind::blank) co_return co_await blank(device, reason);
  Seat& seat = *slots_.seats()[action.slot];
  const Identity* const other = erased_.user_of(seat.id());
  if (other != nullptr && *other != device) {
    slots_.happened(seat, SlotEvent::waits_for_power, ErasedNodeIds::reason(*other));
    co_return false;
  }
  // A silent device may have it pending, as Lely core's slaves do, and no question shows that.
  const auto* const loan = loans_.to_another(seat.id(), device);
  if (loan != nullptr && !found_.uses(device, seat.id())) {
    slots_.happened(seat, SlotEvent::nobody,
                    fmt::format("its node-ID was given temporarily to {}, which does not answer: switch that on, or "
                                "`berth forget {}` if it will not come back",
                                to_string(loan->device), to_string(loan->device)));
    co_return false;
  }
  co_return co_await bind_seat(seat, device, reason);
}

namespace {

// The slot's device was told to store its node-ID, and confirmed it.
bool has_stored(const Seat& seat, const Identity& device) {
  const auto& record = seat.slot.record;
  return seat.power_cycle.binding.has_value() || (record.confirmed && record.confirmed->device == device);
}

}  // namespace

rt::Task<bool> Seating::bind_seat(Seat& seat, Identity device, std::string reason) {
  const bool resumed = seat.slot.record.intended.has_value();
  const Identity seated = device.with(seat.id());
  const Identity comes = found_.one_for(device);
  const bool borrows = loans_.borrowed(comes);
  const bool home = !borrows && found_.uses(seated, seat.id());
  // It is in its place, and LSS cannot change that: it takes no node-ID, or cannot be distinguished from its equals.
  const bool stays = home && planning_.never_by_lss(device);
  if (stays) {
    const bool taken = co_await presence_.take_where_it_is(seat, seated);
    if (taken) co_return true;
  }
  // A device that waits for its power cycle seldom needs to be told again, and the others on the bus wait meanwhile.
  const bool waits = seat.power_cycle.binding && found_.active_of(comes) == seat.power_cycle.binding->old_id();
  const unsigned tries = waits ? 1 : s_.bus.timing.tries;
  Binding binding(Binding::Kind::bind, {seated, seat.id()}, tries, resumed);
  slots_.happened(seat, SlotEvent::binds, reason);
  places::Binder::Options options = asking_.binder_options();
  options.parts = asking_.parts_to_ask(device);
  options.uses = found_.active_of(comes);
  if (borrows) options.lent = options.uses;
  options.among_equals = asking_.has_equals(comes, seat.id());
  options.may_use_another = planning_.waits_for(comes);
  options.uncompared = &seat.uncompared;
  const places::Binder::Services services = asking_.binder_services();
  std::optional<Error> said = co_await walk(services, options, binding, seat.slot.record.slot, reason);
  if (binding.why() == places::Why::not_there) {
    const bool recalled = co_await recall(s_, lending_, comes);
    if (recalled) {
      binding = Binding(Binding::Kind::bind, {seated, seat.id()}, tries, resumed);
      options.uses = NodeId();
      said = co_await walk(services, options, binding, seat.slot.record.slot, reason);
    }
  }
  slots_.refresh(seat);
  const bool good = binding.step() == places::Step::done;
  const bool no_lss = binding.why() == places::Why::not_there || binding.why() == places::Why::refused;
  // A device in its place may have no LSS, or take no node-ID.
  if (home && no_lss) {
    const bool taken = co_await presence_.take_where_it_is(seat, device);
    if (taken) co_return true;
  }
  // Without a serial number it is known by its node-ID: a device with this identity and node-ID is the one.
  const bool untold = binding.why() == places::Why::occupied || binding.why() == places::Why::not_there;
  if (untold && !seated.has_serial() && has_stored(seat, seated)) {
    const bool taken = co_await presence_.take_where_it_is(seat, seated);
    if (taken) co_return true;
  }
  // Its loan belongs to another device now: the next reset of all would activate it.
  if (binding.why() == places::Why::occupied && loans_.of(comes) != nullptr) {
    co_await s_.lss_turn.take();
    const rt::Held lss(s_.lss_turn);
    const NodeId none;
    const auto given_up = co_await lending_.tell_pending(comes, none);
    if (given_up) lending_.end(comes);
  }
  ended(seat, binding, said);
  co_return good || binding.step() == places::Step::power_cycle;
}

void Seating::ended(Seat& seat, const Binding& binding, const std::optional<Error>& store_said) {
  if (binding.step() == places::Step::done) {
    bound(seat, binding);
  } else {
    not_bound(seat, binding, store_said);
  }
}

rt::Task<void> Seating::go_on_after_power_cycle(Seat& seat) {
  Binding binding = *seat.power_cycle.binding;
  binding.heard_again();
  const places::Binder::Options options = asking_.binder_options();
  places::Binder binder(asking_.binder_services(), options);
  const std::string reason = "after its power cycle";
  const places::SlotId slot = seat.slot.record.slot;
  co_await binder.run(binding, slot, reason);
  slots_.refresh(seat);
  ended(seat, binding, binder.store_said());
}

void Seating::bound(Seat& seat, const Binding& binding) {
  if (binding.old_id() != seat.id()) left_node_id(slots_, binding.old_id());
  left_node_id(slots_, erased_.forget(binding.assignment().device));
  if (seat.power_cycle.binding && seat.power_cycle.binding->old_id() != seat.id())
    left_node_id(slots_, seat.power_cycle.binding->old_id());
  for (const Identity& device : names_of(binding)) {
    lending_.end(device);
    loans_.bound(device);
    found_.no_clone(device);
    found_.not_shared(device);
    found_.forget(device);
    places_.forget(device);
  }
  seat.power_cycle = {};
  seat.fresh = true;
  seat.checked = s_.executor.now();
  slots_.events().tell(EventKind::bound, seat.name(),
                       fmt::format("bound to {} as node-ID {}{}", to_string(binding.assignment().device),
                                   seat.id().value(), binding.volatile_only() ? ", which it cannot store" : ""));
  if (seat.slot.spec.when_ambiguous == places::WhenAmbiguous::one_at_a_time) {
    const LssAddress& device = binding.assignment().device.address;
    slots_.events().tell(
        EventKind::new_device, seat.name(),
        fmt::format("new device: manufacturer {:08X}h, product {:08X}h, serial {:08X}h took slot {}, node-ID {}",
                    device.vendor, device.product, device.serial, seat.name(), seat.id().value()));
  }
  slots_.happened(seat, SlotEvent::bound);
  if (seat.uncompared.any())
    slots_.events().tell_once(EventKind::step, fmt::format("{}: {}", seat.name(), places::words_of(seat.uncompared)));
}

void Seating::not_bound(Seat& seat, const Binding& binding, const std::optional<Error>& store_said) {
  using places::Step;
  using places::Why;
  if (binding.step() == Step::power_cycle) {
    seat.power_cycle.binding = binding;
    for (const Identity& device : names_of(binding)) found_.forget(device);
    slots_.happened(seat, SlotEvent::waits_for_power, "node-ID stored; switch the device off and on");
    return;
  }
  learn_fixed(binding);
  const bool clone = binding.why() == Why::clone;
  const Identity was = binding.assignment().device.with(binding.old_id());
  if (clone) found_.note({was, binding.old_id(), true});
  if (binding.why() == Why::not_there) found_.forget(was);
  // The device came with this node-ID, and another one stays at it: its clone, which answers to the same address.
  const bool shares = binding.why() == Why::occupied && found_.active_of(binding.assignment().device) == seat.id();
  if (shares) found_.note_shared(binding.assignment().device);
  // Nothing in the device can have changed: the slot is free again. Otherwise the slot keeps it until it is seen.
  const bool fresh = !seat.slot.record.confirmed && binding.untouched();
  if (fresh && seat.slot.record.intended) {
    const auto cleared = slots_.store().clear(seat.slot.record.slot, places::name(binding.why()));
    if (!cleared)
      slots_.events().tell(EventKind::error, seat.name(),
                           "the slot table cannot be written: " + describe(cleared.error()));
    slots_.refresh(seat);
  }
  if (binding.why() == Why::not_there && seat.slot.record.intended) return unfinished_.keep(seat);
  const std::string reason =
      fmt::format("{}: {}", to_string(binding.assignment().device), places::words_of(binding.why(), store_said));
  if (clone || binding.why() == Why::other_device) {
    slots_.happened(seat, SlotEvent::two_answer, reason);
  } else if (binding.why() == Why::not_there && fresh) {
    slots_.happened(seat, SlotEvent::nobody, reason);
  } else if (binding.why() == Why::not_there) {
    slots_.set_absent(seat, reason);
  } else {
    slots_.happened(seat, SlotEvent::binding_failed, reason);
  }
}

// 11h was refused: LSS cannot set this node-ID. It is not tried again, to spare the device and to save time.
void Seating::learn_fixed(const places::Binding& binding) {
  if (binding.why() != places::Why::refused) return;
  const Identity device = binding.kind() == Binding::Kind::bind ? binding.assignment().device.with(binding.old_id())
                                                                : binding.assignment().device;
  slots_.set_mark(Mark::fixed, device, binding.old_id(), "LSS configure node-ID was refused");
  const auto found = found_.of(device);
  if (found != nullptr) found->active = binding.old_id();
}

namespace {

rt::Task<bool> answers_alone(co::SdoClient& sdo, NodeId id, Identity device) {
  const auto answer = co_await places::identify(sdo, id, places::second_answer);
  co_return answer.who && !answer.by_two && answer.who->agrees(device);
}

}  // namespace

rt::Task<bool> Seating::blank(Identity device, std::string reason) {
  ++blanks_;
  const auto known = slots_.unfinished_here();
  const bool resumed = std::ranges::find(known, device, &places::UnfinishedBlank::device) != known.end();
  Binding binding(Binding::Kind::blank, {device, NodeId()}, s_.bus.timing.tries, resumed);
  const auto had = found_.of(device);
  if (had != nullptr) binding.inquired(had->active);
  places::Binder::Options options = asking_.binder_options();
  options.parts = asking_.parts_to_ask(device);
  places::Binder binder(asking_.binder_services(), options);
  slots_.events().tell(EventKind::step, "", fmt::format("taking the node-ID of {}: {}", to_string(device), reason));
  const places::SlotId none;
  co_await binder.run(binding, none, reason);
  const bool good = binding.step() == places::Step::done;
  const bool fades = binding.step() == places::Step::power_cycle;
  const NodeId used = erased_.forget(device);
  if (fades) {
    erased_.note(device, binding.old_id());
    slots_.events().tell_once(
        EventKind::power_cycle_needed,
        fmt::format("{} has no node-ID in its memory any more, and uses {} until it is switched off and on",
                    to_string(device), binding.old_id().value()));
  } else if (good) {
    places::gave_up(s_.boots, s_.vacancy, binding.old_id());
    left_node_id(slots_, binding.old_id());
    left_node_id(slots_, used);
    lending_.end(device);
    const auto it = found_.of(device);
    if (it != nullptr && device.has_serial()) it->active = NodeId();
    if (it != nullptr && !device.has_serial()) found_.note({device, NodeId()});
  } else if (binding.why() == places::Why::not_there) {
    const NodeId uses = found_.active_of(device);
    bool answers = false;
    if (uses.configured()) answers = co_await answers_alone(s_.sdo, uses, device);
    if (answers) agenda_.out_of_lss.in_vain(device, s_.executor.now());
  } else {
    learn_fixed(binding);
    const bool clone = binding.why() == places::Why::clone;
    if (clone) found_.note({device, binding.old_id(), true});
    // Identified by its node-ID, it is found again as a single device.
    const bool among_equals = clone || binding.why() == places::Why::not_alone;
    if (among_equals && !device.has_serial()) agenda_.out_of_lss.in_vain(device, s_.executor.now());
    slots_.events().tell(EventKind::error, "",
                         fmt::format("{} keeps its node-ID: {}", to_string(device),
                                     places::words_of(binding.why(), binder.store_said())));
  }
  // It never got a command, or takes no node-ID: nothing is left to finish.
  const bool unreached = binding.why() == places::Why::not_there && planning_.never_by_lss(device);
  const bool ends = binding.untouched() || binding.why() == places::Why::refused || unreached;
  if (!good && ends) {
    const auto dropped = slots_.store().drop_blank(slots_.known(device), places::name(binding.why()));
    if (!dropped && dropped.error().code != Errc::not_found)
      slots_.events().tell(EventKind::error, "", describe(dropped.error()));
  }
  co_return good;
}

// A device was gone before this Berth began: its slot is freed only when there are as many new devices of its type as
// such slots, so that a slowly booting machine keeps its bindings.
void Seating::free_absent_slots() {
  const auto freed = [](const Seat& s) {
    return s.life == Life::absent && s.slot.spec.replacement == places::Replacement::automatic &&
           s.slot.record.confirmed && !s.slot.record.intended;
  };
  for (const auto& seat : slots_.seats()) {
    if (!freed(*seat)) continue;
    const TypeCode type = seat->slot.spec.type;
    std::vector<Seat*> group;
    for (const auto& each : slots_.seats()) {
      if (freed(*each) && each->slot.spec.type == type) group.push_back(each.get());
    }
    const auto devices = std::ranges::count_if(found_.all(), [&](const places::Found& f) {
      return !f.clone && f.device.type() == type && slots_.of(f.device) == nullptr;
    });
    if (std::ssize(group) != devices) continue;
    for (Seat* each : group) {
      const auto cleared =
          slots_.clear(*each, "it is silent, a new device is there, and the machine file says replacement = \"auto\"");
      if (!cleared) slots_.events().tell(EventKind::error, each->name(), describe(cleared.error()));
    }
  }
}

// A listed spare is the user's answer in advance: a slot whose device is silent goes to its spare when that appears.
void Seating::free_for_spares() {
  for (auto& seat : slots_.seats()) {
    const bool silent = seat->life == Life::absent && seat->slot.record.confirmed && !seat->slot.record.intended;
    if (!silent) continue;
    const auto spare = std::ranges::find_if(found_.all(), [&](const places::Found& f) {
      return !f.clone && slots_.of(f.device) == nullptr && places::listed_spare(seat->slot.spec, f.device);
    });
    if (spare == found_.all().end()) continue;
    const auto cleared =
        slots_.clear(*seat, fmt::format("it is silent, and its listed spare {} is there", to_string(spare->device)));
    if (!cleared) slots_.events().tell(EventKind::error, seat->name(), describe(cleared.error()));
  }
}

// RAND does not report node-IDs. A device to be bound is asked in its binding. The others must be known by their
// node-IDs, and so must bound devices that answered RAND: after a power-on they may be in their places. An address may
// be of no device, if RAND combined two; if it could choose between slots, it would take one that others need. Such
// addresses are asked first.
rt::Task<void> Seating::inquire_found(bool all) {
  const std::vector<places::Found> found = found_.all();
  for (const auto& f : found) {
    // The plant's master may have an LSS slave of its own: its SDO answers are enough.
    if (may_be_plants_master(s_, slots_, f, planning_.waits_for(f.device))) continue;
    const Seat* seat = slots_.of(f.device);
    const bool binds =
        std::ranges::any_of(planning_.plan().actions, [&](const Action& a) { return a.device == f.device; });
    const bool partly = !f.active.configured() && may_be_known(found_, f.device);
    const bool asks = all || seat != nullptr || !binds || partly || may_choose(slots_, f.device);
    if (f.clone) continue;
    if (asking_.has_equals(f.device)) {
      co_await equals_.look_for_another(f);
      continue;
    }
    if (!asks) continue;
    const auto id = co_await asking_.active_id(f.device);
    if (id) {
      places::Found heard{f.device, *id, false};
      heard.device = found_.known_as(heard);
      if (heard.device != f.device) found_.forget(f.device);
      found_.note(heard);
      co_await take_back(heard);
    } else if (id.error().code == Errc::duplicate) {
      found_.note({f.device, f.active, true});
    } else if (seat == nullptr && id.error().code == Errc::timeout && !f.active.configured()) {
      found_.fell_silent(f.device);  // it left; one found by its node-ID may have no LSS
    }
  }
}

// A slot's own device under its own node-ID, whose boot-up was not heard: it is checked and started like any other.
rt::Task<void> Seating::take_back(const places::Found& found) {
  const Identity device = found.device;
  Seat* const seat = slots_.of(device);
  const bool home =
      seat != nullptr && seat->slot.record.confirmed && !seat->slot.record.intended && found.active == seat->id();
  if (!home) co_return;
  // A device that booted is unknown to RAND, which finds it once: if its return was reported, this is no news. A
  // restart during an update was not reported.
  const auto booted = s_.boots.boot_up(seat->id());
  const bool known = seat->there() && booted && *booted <= seat->last.heard_again && *booted > seat->last.taken_back;
  seat->last.taken_back = s_.executor.now();
  if (!known) co_await presence_.ask_seat(*seat);
  if (seat->there()) found_.forget(device);
}

}  // namespace berth::operate

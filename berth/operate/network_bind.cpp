// Binding and start (paper 1 §III.c; S1.32 to S1.36).
#include <fmt/format.h>

#include <algorithm>

#include "berth/operate/master_device.hpp"
#include "berth/operate/network_seat.hpp"
#include "berth/operate/timing_options.hpp"

namespace berth::operate {

using places::Action;
using places::Binding;
using places::SlotState;

places::Binder::Services Network::services() noexcept {
  return {dispatcher_, lss_, sdo_, nmt_, boots_, *store_, vacancy_};
}

places::Binder::Options Network::binder_options() {
  places::Binder::Options options = operate::binder_options(bus_->timing);
  options.lss_turn = &lss_turn_;
  options.before_step = observer_.before_step;
  options.machine = machine_name();
  options.bus = bus_->name;
  return options;
}

// Every address that was seen on this bus, or sits in it: one that may be in LSS configuration unheard is among them.
lss::PartMask Network::parts_to_ask(const LssAddress& device) const {
  std::vector<LssAddress> others;
  for (const auto& [seen, at] : first_seen_) others.push_back(seen);
  for (const auto& f : found_) others.push_back(f.device);
  for (const auto& seat : seats_) {
    if (const auto sits = seat->slot.record.device()) others.push_back(*sits);
  }
  return lss::parts_to_ask(device, others);
}

// ---- binding ----

// A device that was gone before this Berth began to watch: its slot is freed only when as many new devices of its type
// are there as such slots, so that a machine whose devices boot slowly keeps its bindings.
void Network::free_absent_slots() {
  const auto freed = [](const Seat& s) {
    return s.state == SlotState::absent && s.slot.spec.replacement == places::Replacement::automatic &&
           s.slot.record.confirmed && !s.slot.record.asked;
  };
  for (const auto& seat : seats_) {
    if (!freed(*seat)) continue;
    const TypeCode type = seat->slot.spec.type;
    std::vector<Seat*> group;
    for (const auto& each : seats_) {
      if (freed(*each) && each->slot.spec.type == type) group.push_back(each.get());
    }
    const auto devices = std::ranges::count_if(found_, [&](const places::Found& f) {
      return !f.clone && f.device.type() == type && seat_of(f.device) == nullptr;
    });
    if (std::ssize(group) != devices) continue;
    for (Seat* each : group) {
      const auto cleared =
          clear_seat(*each, "it is silent, a new device is there, and the machine file says replacement = \"auto\"");
      if (!cleared) tell("error", each->name(), describe(cleared.error()));
    }
  }
}

rt::Task<void> Network::carry_out() {
  phase_ = Phase::binding;
  avoid_.clear();
  bool inquired_all = false;
  co_await look_for_unfinished();
  make_plan();
  if (!found_.empty()) {
    co_await inquire_found(false);
    free_for_spares();
    free_absent_slots();
    make_plan();
  }
  // Who must be read first is seated by the second plan; a device that has to give a node-ID up before that, the third.
  for (int pass = 0; pass < 3; ++pass) {
    co_await carry_out_actions(inquired_all);
    if (plan_.probes.empty()) break;
    const bool read = co_await read_places();
    make_plan();
    if (!read) break;
  }
  note_puzzling();
  // While the search goes on they keep what was lent: else it would find them all again.
  if (!search_open_) co_await take_ids_back();
  rest_from_searching();
  report_plan();
  const bool any = std::ranges::any_of(seats_, [](const auto& s) { return s->slot.record.confirmed.has_value(); });
  if (any) reach("bound");
}

rt::Task<void> Network::carry_out_actions(bool& inquired_all) {
  for (;;) {
    co_await take_back_what_is_in_the_way();
    co_await verify_vacancy();
    const std::vector<Action> actions = plan_.actions;
    std::vector<LssAddress> failed;
    bool freed = false;  // node-IDs, since they were asked for last
    for (const auto& action : actions) {
      if (action.kind != Action::Kind::blank || is_avoided(action.device)) continue;
      const bool good = co_await act(action);
      freed = freed || good;
      // A node-ID that was given up may be what another device failed for.
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
    make_plan();
    if (failed.empty()) break;
  }
}

bool Network::is_avoided(const LssAddress& device) const noexcept {
  return std::ranges::find(avoid_, device) != avoid_.end();
}

// While one device boots under its new node-ID the next is told its own.
rt::Task<void> Network::bind_side_by_side(const std::vector<Action>& actions, std::vector<LssAddress>& failed) {
  constexpr std::size_t most_bindings = 16;
  rt::Scope bindings(*executor_, most_bindings);
  for (const auto& action : actions) {
    const bool binds = action.kind == Action::Kind::bind && !is_avoided(action.device);
    if (binds) bindings.spawn(act_aside(action, failed));
  }
  co_await bindings.join();
}

rt::Task<void> Network::act_aside(const Action& action, std::vector<LssAddress>& failed) {
  const bool good = co_await act(action);
  if (!good) failed.push_back(action.device);
}

rt::Task<bool> Network::act(const Action& action) {
  const LssAddress device = action.device;
  const std::string reason = action.reason;
  if (action.kind == Action::Kind::blank) co_return co_await blank(device, reason);
  Seat& seat = *seats_[action.slot];
  // One that is silent may have it pending, as Lely core's slaves do, and no question finds that out.
  const auto* const loan = loans_.to_another(seat.id(), device);
  if (loan != nullptr && !uses(device, seat.id())) {
    set_state(
        seat, SlotState::empty,
        fmt::format("its node-ID was lent to {}, which does not answer: switch that on, or `berth forget {}` when it "
                    "is gone for good",
                    to_string(loan->device), to_string(loan->device)));
    co_return false;
  }
  co_return co_await bind_seat(seat, device, reason);
}

// It was found, as the only one of its address, with this node-ID in use.
bool Network::uses(const LssAddress& device, NodeId id) const noexcept {
  return std::ranges::any_of(found_,
                             [&](const places::Found& f) { return f.device == device && f.active == id && !f.clone; });
}

rt::Task<bool> Network::bind_seat(Seat& seat, LssAddress device, std::string reason) {
  const bool resumed = seat.slot.record.asked.has_value();
  const bool borrows = loans_.borrowed(device);
  const bool home = !borrows && uses(device, seat.id());
  Binding binding(Binding::Kind::bind, {device, seat.id()}, bus_->timing.tries, resumed);
  set_state(seat, SlotState::binding, reason);
  places::Binder::Options options = binder_options();
  options.parts = parts_to_ask(device);
  places::Binder binder(services(), options);
  const places::SlotId slot = seat.slot.record.slot;
  co_await binder.run(binding, slot, reason);
  refresh(seat);
  const bool good = binding.step() == places::Step::done;
  const bool no_lss = binding.why() == places::Why::not_there || binding.why() == places::Why::refused;
  // A device that sits where it belongs may speak no LSS, or take no node-ID.
  if (home && no_lss) {
    const bool taken = co_await take_where_it_is(seat, device);
    if (taken) co_return true;
  }
  // What it was lent is another's by now: the next reset of all would bring it into use.
  if (binding.why() == places::Why::occupied && loans_.of(device) != nullptr) {
    co_await lss_turn_.take();
    const rt::Held lss(lss_turn_);
    const NodeId none;
    const auto given_up = co_await tell_pending(device, none);
    if (given_up) end_loan(device);
  }
  if (good) {
    bound(seat, binding);
  } else {
    not_bound(seat, binding);
  }
  co_return good || binding.step() == places::Step::power_cycle;
}

void Network::bound(Seat& seat, const Binding& binding) {
  end_loan(binding.seat().device);
  loans_.bound(binding.seat().device);
  std::erase(clones_, binding.seat().device);
  forget_found(binding.seat().device);
  forget_readings(binding.seat().device);
  seat.there = true;
  seat.started = false;
  seat.waiting.reset();
  seat.fresh = true;
  seat.checked = executor_->now();
  tell("bound", seat.name(),
       fmt::format("bound to {} as node-ID {}{}", to_string(binding.seat().device), seat.id().value(),
                   binding.volatile_only() ? ", which it cannot store" : ""));
  if (seat.slot.spec.when_ambiguous == places::WhenAmbiguous::one_at_a_time) {
    const LssAddress& device = binding.seat().device;
    tell("new device", seat.name(),
         fmt::format("new device: manufacturer {:08X}h, product {:08X}h, serial {:08X}h took slot {}, node-ID {}",
                     device.vendor, device.product, device.serial, seat.name(), seat.id().value()));
  }
  set_state(seat, SlotState::present);
}

void Network::not_bound(Seat& seat, const Binding& binding) {
  using places::Step;
  using places::Why;
  seat.there = false;
  if (binding.step() == Step::power_cycle) {
    seat.waiting = binding;
    forget_found(binding.seat().device);
    set_state(seat, SlotState::power_cycle, "node-ID stored; switch the device off and on");
    return;
  }
  learn_fixed(binding);
  const bool clone = binding.why() == Why::clone;
  if (clone) note_found({binding.seat().device, binding.old_id(), true});
  if (binding.why() == Why::not_there) forget_found(binding.seat().device);
  // Nothing in the device can have changed: the slot is free again. Else it stays the slot's until it is seen.
  const bool fresh = !seat.slot.record.confirmed && binding.untouched() && seat.slot.record.asked;
  if (fresh) {
    const auto cleared = store_->clear(seat.slot.record.slot, places::name(binding.why()));
    if (!cleared) tell("error", seat.name(), "the slot table cannot be written: " + describe(cleared.error()));
    refresh(seat);
  }
  if (binding.why() == Why::not_there && seat.slot.record.asked) return keep_for_its_device(seat);
  const std::string reason = fmt::format("{}: {}", to_string(binding.seat().device), places::name(binding.why()));
  if (clone || binding.why() == Why::other_device) {
    set_state(seat, SlotState::duplicate, reason);
  } else if (binding.why() == Why::not_there) {
    set_state(seat, fresh ? SlotState::empty : SlotState::absent, reason);
  } else {
    set_state(seat, SlotState::failed, reason);
  }
}

rt::Task<bool> Network::blank(LssAddress device, std::string reason) {
  const auto known = unfinished_here();
  const bool resumed = std::ranges::find(known, device, &places::UnfinishedBlank::device) != known.end();
  Binding binding(Binding::Kind::blank, {device, NodeId()}, bus_->timing.tries, resumed);
  const auto had = std::ranges::find(found_, device, &places::Found::device);
  if (had != found_.end()) binding.inquired(had->active);
  places::Binder::Options options = binder_options();
  options.parts = parts_to_ask(device);
  places::Binder binder(services(), options);
  tell("step", "", fmt::format("taking the node-ID of {}: {}", to_string(device), reason));
  const places::SlotId none;
  co_await binder.run(binding, none, reason);
  const bool good = binding.step() == places::Step::done;
  if (good) {
    // Whatever was heard under its old node-ID is history.
    boots_.forget(binding.old_id());
    end_loan(device);
    const auto it = std::ranges::find(found_, device, &places::Found::device);
    if (it != found_.end()) it->active = NodeId();
  } else if (binding.why() != places::Why::not_there) {
    learn_fixed(binding);
    tell("error", "", fmt::format("{} keeps its node-ID: {}", to_string(device), name(binding.why())));
  }
  // It was never told anything: there is nothing to finish.
  if (!good && binding.untouched()) {
    const auto dropped = store_->drop_blank(device, places::name(binding.why()));
    if (!dropped && dropped.error().code != Errc::not_found) tell("error", "", describe(dropped.error()));
  }
  co_return good;
}

// ---- check and start ----

rt::Task<void> Network::check_and_start() {
  phase_ = Phase::start;
  rt::Scope starts(*executor_, most_at_once());
  for (auto& seat : seats_) {
    const bool ready = seat->there && !seat->started && seat->state == SlotState::present;
    if (ready) starts.spawn(start_seat(*seat));
  }
  co_await starts.join();
  co_await await_operational();
  if (operational() && may_command()) {
    device_->start();
    reach("operational");
  }
}

rt::Task<void> Network::start_seat(Seat& seat) {
  const NodeId id = seat.id();
  if (rebooted(seat)) co_return;  // which device booted is asked first
  const bool clear = co_await clear_past(seat);
  if (!clear) co_return;
  const bool configures = !seat.slot.spec.config.empty() && bus_->role != design::Role::observer;
  if (configures) {
    manager::ConfigurationReport report;
    const bool ready = co_await configure_seat(seat, report);
    if (!ready) co_return;
  } else {
    const bool beats = co_await set_heartbeat(seat);
    if (!beats) co_return;
  }
  if (!seat.guarded) heartbeats_.supervise(id, bus_->timing.heartbeat_timeout);
  if (!may_command() || rebooted(seat)) co_return;
  co_await send_start(seat);
}

// False: it is not there any more.
rt::Task<bool> Network::set_heartbeat(Seat& seat) {
  const NodeId id = seat.id();
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(bus_->timing.heartbeat_period).count();
  const auto period = static_cast<std::uint16_t>(std::clamp<std::int64_t>(ms, 0, 0xFFFF));
  const auto written = co_await sdo_.write<std::uint16_t>(id, 0x1017, 0, period);
  if (!written && written.error().code != Errc::aborted) {
    seat.there = false;
    set_state(seat, SlotState::absent, "its heartbeat could not be set: " + describe(written.error()));
    co_return false;
  }
  seat.guarded = !written.has_value();
  co_return true;
}

rt::Task<void> Network::send_start(Seat& seat) {
  const NodeId id = seat.id();
  seat.started = seat.awaited = true;
  const auto sent = co_await nmt_.send(co::NmtCommand::start, id);
  if (!sent) {
    seat.started = seat.awaited = false;
    set_state(seat, SlotState::failed, "NMT start could not be sent: " + describe(sent.error()));
    co_return;
  }
  if (!seat.guarded) co_return;
  // No heartbeat in this device: it is asked once by guarding, which is all that can be known of it.
  const auto guarded = co_await co::probe(dispatcher_, id, bus_->timing.guard_timeout, bus_->timing.tries);
  if (guarded && guarded->state == NmtState::operational) {
    set_state(seat, SlotState::operational);
  } else {
    set_state(seat, SlotState::failed, "it was started and did not become operational");
  }
}

// Operational is what the device says in its heartbeat, not what it was told.
rt::Task<void> Network::await_operational() {
  const auto waits = [](const auto& s) { return s->awaited && s->state == SlotState::present; };
  const rt::Time deadline = executor_->now() + bus_->timing.heartbeat_timeout;
  const rt::Duration patience = bus_->timing.heartbeat_period + bus_->timing.heartbeat_period / 4;
  rt::Time again = executor_->now() + patience;
  while (executor_->now() < deadline && std::ranges::any_of(seats_, waits)) {
    co_await rt::sleep_for(bus_->timing.heartbeat_period / 16 + std::chrono::milliseconds(1));
    if (executor_->now() < again) continue;
    co_await start_again();
    again = executor_->now() + patience;
  }
  for (auto& seat : seats_) {
    const bool still = waits(seat);
    seat->awaited = false;
    if (!still) continue;
    seat->started = false;
    std::string why = "it was started and no heartbeat told that it is operational";
    if (const auto& e = seat->emergency) {
      why += fmt::format("; it told an error: EMCY {:04X}h ({})", e->code, co::emcy_text(e->code));
    }
    set_state(*seat, SlotState::failed, why);
  }
}

// NMT commands have no answer, and every device hears those of all: a slow one's receive buffer overruns when a hundred
// come back to back. Who is not operational yet is told again, one after the other at a pace that any device follows.
rt::Task<void> Network::start_again() {
  for (auto& seat : seats_) {
    if (!seat->awaited || seat->held || seat->state != SlotState::present || rebooted(*seat)) continue;
    const NodeId id = seat->id();
    const auto sent = co_await nmt_.send(co::NmtCommand::start, id);
    if (!sent) co_return;
    co_await rt::sleep_for(bus_->timing.rand_response);
  }
}

namespace {

// Also when the command is given up in the middle.
class Clearing {
 public:
  Clearing(std::string& text, bool& flag) noexcept : text_(text), flag_(flag) {}
  ~Clearing() {
    text_.clear();
    flag_ = false;
  }
  Clearing(const Clearing&) = delete;
  Clearing& operator=(const Clearing&) = delete;

 private:
  std::string& text_;
  bool& flag_;
};

}  // namespace

rt::Task<Result<void>> Network::bind_once(std::string method) {
  co_await turn_.take();
  const rt::Held held(turn_);
  method_ = std::move(method);
  const Clearing clearing(method_, once_);
  once_ = true;
  look_anew_ = true;
  co_await opening();
  co_await prepare();
  co_await discover();
  co_await carry_out();
  for (auto& seat : seats_) {
    const bool fixed = seat->slot.spec.assign == places::Assign::fixed && !seat->slot.record.confirmed;
    if (fixed) co_await adopt_fixed(*seat);
  }
  const bool everybody = false;
  const bool others = co_await find_configured(everybody);
  co_await bind_by_recipe();
  if (others) co_await carry_out();
  const auto left = std::ranges::find_if(seats_, [](const auto& s) { return !s->slot.spec.optional && !s->there; });
  if (left != seats_.end()) co_return fail(Errc::not_found, "not every slot has its device; see the report");
  co_return Result<void>();
}

}  // namespace berth::operate

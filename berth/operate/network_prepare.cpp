// Who is there: the preparation step (paper 1 §III.a; S1.30), vacancy of node-IDs, and the scan.
#include <fmt/format.h>

#include <algorithm>

#include "berth/operate/master_device.hpp"
#include "berth/operate/network_seat.hpp"

namespace berth::operate {

using places::SlotState;

// To ask whether anybody is there: silence is the expected answer, so it is not waited for long nor aborted.
co::SdoOptions Network::asking(unsigned retries) const {
  co::SdoOptions patience = sdo_.options();
  patience.timeout = bus_->timing.guard_timeout;
  patience.retries = retries;
  patience.abort_on_timeout = false;
  return patience;
}

// A running machine is not disturbed: first its heartbeats are heard, and only who is silent is asked.
rt::Task<void> Network::prepare() {
  const bool any = std::ranges::any_of(seats_, [](const auto& s) { return s->slot.record.confirmed.has_value(); });
  if (!any) co_return;
  phase_ = Phase::preparation;
  tell("step", "", "preparation: looking for the devices of the bound slots");
  const rt::Time began = executor_->now();
  const rt::Time deadline = began + bus_->timing.heartbeat_period + bus_->timing.heartbeat_period / 4;
  const auto all_heard = [&] {
    return std::ranges::all_of(seats_, [&](const auto& s) {
      const auto heard = boots_.heard(s->id());
      return !s->slot.record.confirmed || (heard && *heard >= began);
    });
  };
  while (executor_->now() < deadline && !all_heard()) {
    co_await rt::sleep_for(bus_->timing.heartbeat_period / 16 + std::chrono::milliseconds(1));
  }
  rt::Scope asked(*executor_, most_at_once());
  for (auto& seat : seats_) {
    if (seat->slot.record.confirmed) asked.spawn(ask_seat(*seat));
  }
  co_await asked.join();
  for (auto& seat : seats_) {
    const bool silent = seat->slot.record.confirmed && !seat->there;
    if (silent) co_await look_by_lss(*seat);
  }
}

// So many that the questions of those that stay silent leave room on the bus for the answers of the others: behind more
// of them a remote frame, which has the lower priority, would wait until its own time is over.
std::size_t Network::most_at_once() const noexcept {
  constexpr double question_bits = 150;  // eight bytes of data and every stuff bit there can be, and room for others
  const double timeout = std::chrono::duration<double>(bus_->timing.guard_timeout).count();
  return std::max<std::size_t>(2, static_cast<std::size_t>(timeout * bus_->bitrate / question_bits));
}

// By heartbeat, else SDO 1000h, else guarding; then by identity: another device may sit at the slot's node-ID.
rt::Task<void> Network::ask_seat(Seat& seat) {
  const NodeId id = seat.id();
  seat.there = false;
  const auto heard = boots_.heard(id);
  const bool beats = heard && executor_->now() - *heard <= bus_->timing.heartbeat_timeout;
  bool alive = beats;
  if (!alive) {
    const auto type = co_await sdo_.read<std::uint32_t>(id, 0x1000, 0);
    alive = type.has_value() || type.error().code == Errc::aborted;
  }
  std::optional<NmtState> state;
  if (!alive) {
    const auto guarded = co_await co::probe(dispatcher_, id, bus_->timing.guard_timeout, bus_->timing.tries);
    alive = guarded.has_value();
    if (guarded) state = guarded->state;
  }
  seat.checked = executor_->now();
  if (!alive) {
    set_state(seat, SlotState::absent,
              fmt::format("no heartbeat, SDO or guarding answer from node-ID {}; switch the device "
                          "on, or `berth replace` it",
                          id.value()));
    co_return;
  }
  if (beats) state = boots_.state(id);
  const auto surplus = sdo_.surplus(id);
  const auto who = co_await places::Binder::read_identity(sdo_, id);
  if (!who) {
    // Stopped devices speak no SDO; they are known by their error control alone (the paper's figure).
    const bool stopped = state == NmtState::stopped;
    if (stopped) seat.there = true;
    set_state(seat, stopped ? SlotState::present : SlotState::absent,
              stopped ? std::string() : "its identity cannot be read: " + describe(who.error()));
    co_return;
  }
  // The answer of a second device may come a little behind that of the first.
  co_await rt::sleep_for(second_answer);
  if (sdo_.surplus(id) != surplus) {
    set_state(seat, SlotState::duplicate, "two devices answer under this node-ID; take one of them off the bus");
    seat.shared = most_tries_apart;
    look_anew_ = true;
    co_return;
  }
  const bool same = *who == seat.slot.record.confirmed->device;
  if (!same) {
    seat.shared = most_tries_apart;
    look_anew_ = true;
    set_state(seat, SlotState::absent, fmt::format("device {} answers under its node-ID", to_string(*who)));
    co_return;
  }
  const bool stays = co_await stays_in_place(seat);
  if (!stays) co_return;
  seat.there = true;
  seat.started = state == NmtState::operational || seat.held;
  if (state == NmtState::operational) {
    heartbeats_.supervise(id, bus_->timing.heartbeat_timeout);
    set_state(seat, SlotState::operational);
    if (seat.configuration) co_await look_at_running(seat);
    co_return;
  }
  set_state(seat, SlotState::present);
}

// A bound device that is silent under its node-ID may have lost it, or have another.
rt::Task<void> Network::look_by_lss(Seat& seat) {
  if (seat.state == SlotState::duplicate || bus_->role == design::Role::observer) co_return;
  const LssAddress device = seat.slot.record.confirmed->device;
  const auto id = co_await active_id(device);
  if (!id) co_return;
  note_found({device, *id});
}

// So that a single-slot receive buffer loses none of the frames.
lss::MasterOptions Network::with_pauses() const {
  lss::MasterOptions slower = lss_.options();
  slower.inhibit = std::max(slower.inhibit, bus_->timing.rand_response);
  return slower;
}

// The node-ID that the device with this address uses now, by LSS; every other device in waiting meanwhile.
rt::Task<Result<NodeId>> Network::active_id(LssAddress device) {
  const auto quick = co_await ask_active_id(device);
  if (quick || quick.error().code != Errc::timeout) co_return quick;
  // Again with pauses: a single-slot receive buffer loses frames that come back to back.
  const lss::MasterOptions before = lss_.options();
  lss_.set_options(with_pauses());
  const auto slow = co_await ask_active_id(device);
  if (!slow) lss_.set_options(before);
  co_return slow;
}

rt::Task<Result<NodeId>> Network::ask_active_id(LssAddress device) {
  const auto quiet = co_await lss_.switch_global(lss::State::waiting);
  if (!quiet) co_return fail(quiet.error());
  // The device of a slot that is there and answers RAND all the same may be another one with its address.
  const Seat* const seat = seat_of(device);
  lss::ServiceOptions patience = lss_.options().service;
  patience.full_window = seat != nullptr && seat->there;
  const auto selected = co_await lss_.switch_selective(device, patience);
  if (!selected) co_return fail(selected.error());
  const auto reply = co_await lss_.inquire_node_id(patience);
  const auto strange = [](const lss::Reply& r) { return r.answers > 1 || r.others > 0 || r.stale > 0 || r.differ; };
  const bool doubtful = strange(*selected) || (reply && strange(*reply));
  if (doubtful) {
    const places::Binder::Options options = binder_options();
    places::Binder binder(services(), options);
    const places::Outcome single = co_await binder.confirm_double(device);
    if (single == places::Outcome::doubled) {
      const auto calm = co_await lss_.switch_global(lss::State::waiting);
      if (!calm) co_return fail(calm.error());
      co_return fail(Errc::duplicate, "two devices answer to one LSS address");
    }
  }
  const auto released = co_await lss_.switch_global(lss::State::waiting);
  if (!reply) co_return fail(reply.error());
  if (!released) co_return fail(released.error());
  const auto id = NodeId::make(reply->byte());
  if (!id) co_return fail(Errc::mismatch, "the node-ID it told is none");
  co_return *id;
}

// A slot whose device gets its node-ID by switches, plug or firmware: whoever sits there with the right type is taken.
// Nothing is written to it.
rt::Task<void> Network::adopt_fixed(Seat& seat) {
  const co::SdoOptions patience = asking(1);
  const NodeId id = seat.id();
  const auto type = co_await sdo_.read<std::uint32_t>(id, 0x1000, 0, patience);
  if (!type) co_return;
  const auto who = co_await places::Binder::read_identity(sdo_, id);
  if (!who) co_return;
  if (!places::fits(seat.slot.spec, *who)) {
    set_state(seat, SlotState::wrong_type, fmt::format("device {} has its node-ID", to_string(*who)));
    co_return;
  }
  const places::Seat wanted{*who, id};
  const auto asked = store_->ask(seat.slot.record.slot, wanted, "found under its fixed node-ID");
  const auto confirmed =
      asked ? store_->confirm(seat.slot.record.slot, wanted, "found under its fixed node-ID") : asked;
  refresh(seat);
  if (!confirmed) {
    set_state(seat, SlotState::failed, "the slot table cannot be written: " + describe(confirmed.error()));
    co_return;
  }
  tell("bound", seat.name(), fmt::format("{} sits there by its fixed node-ID {}", to_string(*who), id.value()));
  co_await ask_seat(seat);
}

// All node-IDs that are about to be given, asked side by side: one time-out for all of them.
rt::Task<void> Network::verify_vacancy() {
  rt::Scope asked(*executor_, most_at_once());
  if (!speaks_) asked.spawn(ask_vacancy(bus_->master));
  for (const auto& action : plan_.actions) {
    if (action.kind != places::Action::Kind::bind) continue;
    const NodeId id = seats_[action.slot]->id();
    const auto& vacant = vacancy_[id.value()];
    const bool known = vacant && boots_.silent_since(id, *vacant);
    if (!known) asked.spawn(ask_vacancy(id));
  }
  co_await asked.join();
}

rt::Task<void> Network::ask_vacancy(NodeId id) { co_await answers_at(id); }

// True: a device answers SDO under this node-ID. Silence of SDO and guarding makes it vacant.
rt::Task<bool> Network::answers_at(NodeId id) {
  const rt::Time began = executor_->now();
  const co::SdoOptions patience = asking(bus_->timing.tries - 1);
  const auto type = co_await sdo_.read<std::uint32_t>(id, 0x1000, 0, patience);
  if (type || type.error().code == Errc::aborted) co_return true;
  if (type.error().code != Errc::timeout) co_return false;
  const auto guarded = co_await co::probe(dispatcher_, id, bus_->timing.guard_timeout, 1);
  const bool silent = !guarded && guarded.error().code == Errc::timeout;
  if (silent) vacancy_[id.value()] = began;
  co_return false;
}

rt::Task<void> Network::scan_node(NodeId id, Seen& seen, co::SdoOptions patience) {
  seen.id = id;
  const auto surplus = sdo_.surplus(id);
  const auto type = co_await sdo_.read<std::uint32_t>(id, 0x1000, 0, patience);
  if (type) seen.device_type = *type;
  const bool answered = type || type.error().code == Errc::aborted || type.error().code == Errc::mismatch;
  if (answered) {
    const auto who = co_await places::Binder::read_identity(sdo_, id);
    if (who) seen.device = *who;
  } else {
    const auto guarded = co_await co::probe(dispatcher_, id, bus_->timing.guard_timeout, 1);
    if (guarded) seen.state = guarded->state;
  }
  seen.duplicate = sdo_.surplus(id) != surplus;
  const auto heard = boots_.heard(id);
  const bool lately = heard && executor_->now() - *heard < bus_->timing.heartbeat_timeout;
  if (lately) seen.state = boots_.state(id);
}

rt::Task<Result<std::vector<Network::Seen>>> Network::scan() {
  co_await turn_.take();
  const rt::Held held(turn_);
  std::vector<Seen> nodes(127);
  const co::SdoOptions patience = asking(1);
  {
    rt::Scope asked(*executor_, most_at_once());
    for (std::uint8_t i = 1; i <= 127; ++i) {
      const NodeId id(i);
      if (id != bus_->master) asked.spawn(scan_node(id, nodes[i - 1U], patience));
    }
    co_await asked.join();
  }
  std::erase_if(nodes, [](const Seen& s) { return !s.device_type && !s.device && !s.state; });
  const auto found = co_await find_new();
  if (!found) co_return fail(found.error());
  for (const auto& d : found->found) {
    const auto known =
        std::ranges::find(nodes, d.address, [](const Seen& s) { return s.device.value_or(LssAddress{}); });
    if (known != nodes.end()) {
      known->duplicate = known->duplicate || d.possible_clone;
      continue;
    }
    Seen seen;
    const auto id = co_await active_id(d.address);
    if (id) seen.id = *id;
    seen.device = d.address;
    seen.duplicate = d.possible_clone;
    const auto under = std::ranges::find(nodes, seen.id, &Seen::id);
    const bool shares = seen.id.configured() && under != nodes.end();
    // A stopped device speaks no SDO: it is known by its node-ID from guarding, and by its address from LSS.
    if (shares && !under->device) {
      under->device = d.address;
      under->duplicate = under->duplicate || d.possible_clone;
      continue;
    }
    seen.duplicate = seen.duplicate || shares;
    nodes.push_back(seen);
  }
  for (auto& s : nodes) {
    const Seat* seat = s.device ? seat_of(*s.device) : nullptr;
    if (seat != nullptr) s.slot = seat->name();
  }
  co_return nodes;
}

}  // namespace berth::operate

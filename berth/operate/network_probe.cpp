// Which place a device sits in, read from the device itself (paper 4, S4.19). A device without a node-ID speaks no SDO:
// it is lent one that no slot has, which it does not store, and gives it back when no slot is found for it.
#include <fmt/format.h>

#include <algorithm>

#include "berth/operate/network_seat.hpp"

namespace berth::operate {

using places::Probe;
using places::Reading;
using places::SlotState;

namespace {

constexpr std::size_t longest_probe = 8;  // what is longer, or never ends, says nothing of a place

std::string name_of(const Probe& probe) { return fmt::format("{:04X}h:{:02X}", probe.index, probe.sub); }

std::string text_of(const std::optional<std::uint32_t>& value) {
  return value ? fmt::format("{:X}h", *value) : std::string("nothing");
}

}  // namespace

// ---- node-IDs that are lent ----

// Not a slot's, not the master's, not one under which anybody was ever heard. `prepare_loans` asks whether it is
// vacant.
bool Network::may_be_lent(NodeId id) const noexcept {
  const bool slot = std::ranges::any_of(seats_, [&](const auto& s) { return s->id() == id; });
  return !slot && !spoken_for(id) && id != bus_->master && !boots_.heard(id);
}

// A device that was found has it, was lent it, or has told that it will have it when it boots.
bool Network::spoken_for(NodeId id) const noexcept {
  const bool held = std::ranges::any_of(found_, [&](const places::Found& f) { return f.active == id; });
  const bool lent = std::ranges::any_of(lent_, [&](const Loan& l) { return l.id == id; });
  return held || lent || progress_.told[id.value()];
}

bool Network::free_for_a_loan(const Seat& seat, const LssAddress& device) const noexcept {
  const NodeId id = seat.id();
  const auto& vacant = vacancy_[id.value()];
  const auto heard = boots_.heard(id);
  return !seat.there && !seat.slot.record.device() && seat.slot.spec.assign == places::Assign::lss && !spoken_for(id) &&
         vacant && (!heard || *heard < *vacant) && places::fits(seat.slot.spec, device);
}

// The lowest free slot's that it fits: searches find the devices of a type in ascending order, and with `ascending`
// that is where it stays. Else one that no slot has.
NodeId Network::id_to_lend(const LssAddress& device) const noexcept {
  NodeId lowest;
  for (const auto& seat : seats_) {
    const bool lower = !lowest.configured() || seat->id() < lowest;
    if (lower && free_for_a_loan(*seat, device)) lowest = seat->id();
  }
  if (lowest.configured()) return lowest;
  for (std::uint8_t value = 126; value > 0; --value) {
    if (may_be_lent(NodeId(value)) && vacancy_[value]) return NodeId(value);
  }
  return {};
}

// The device is in LSS configuration, and no other is.
rt::Task<Result<void>> Network::select_alone(LssAddress device) {
  const lss::AloneOptions options{.parts = parts_to_ask(device)};
  auto selected = co_await lss::select_alone(lss_, device, options);
  const bool unheard = selected && *selected == lss::Selection::absent;
  if (unheard) {
    // Again with pauses: a single-slot receive buffer loses frames that come back to back.
    const lss::MasterOptions before = lss_.options();
    lss_.set_options(with_pauses());
    selected = co_await lss::select_alone(lss_, device, options);
    lss_.set_options(before);
  }
  if (!selected) co_return fail(selected.error());
  switch (*selected) {
    case lss::Selection::alone: break;
    case lss::Selection::absent: co_return fail(Errc::timeout, "it does not answer to its LSS address");
    case lss::Selection::not_alone: co_return fail(Errc::mismatch, "another device is in LSS configuration beside it");
    case lss::Selection::twins: co_return fail(Errc::duplicate, "two devices answer to its LSS address");
  }
  co_return Result<void>{};
}

rt::Task<Result<NodeId>> Network::lend_id(LssAddress device) {
  const NodeId id = id_to_lend(device);
  if (!id.configured()) co_return fail(Errc::exhausted, "no node-ID is left that could be lent to it");
  const rt::Time began = executor_->now();
  lent_until_[id.value()] = rt::never;
  const auto selected = co_await select_alone(device);
  if (!selected) co_return fail(selected.error());
  note_loans(device, id);
  const auto given = co_await lss_.configure_node_id(id);
  const auto released = co_await lss_.switch_global(lss::State::waiting);
  if (!given) co_return fail(given.error());
  if (!released) co_return fail(released.error());
  lent_.push_back({device, id, 0});
  const rt::Time deadline = began + bus_->timing.boot_timeout;
  const bool heard = co_await boots_.wait(id, began, deadline);
  if (!heard) co_return fail(Errc::timeout, "it was lent a node-ID and was not heard under it");
  co_return id;
}

// Whose probes did not tell their places: the next look must hear all of them before one gets a place.
void Network::note_puzzling() {
  for (const auto& question : plan_.questions) {
    const bool probed =
        std::ranges::any_of(question.slots, [&](std::size_t i) { return seats_[i]->slot.spec.probe.has_value(); });
    if (probed) puzzling_ = question.devices;
  }
}

// Once for all of a search: what a run that is ended in the middle leaves behind is taken out of all at once.
void Network::note_loans(const LssAddress& device, NodeId id) noexcept {
  if (std::ranges::find(borrowers_, device) == borrowers_.end()) borrowers_.push_back(device);
  if (std::exchange(loans_noted_, true)) return;
  const auto marked = store_->mark(places::Mark::lent, device, id, "node-IDs are lent for a search");
  if (!marked) loans_noted_ = false;
}

void Network::forget_loans() {
  if (!lent_.empty() || !std::exchange(loans_noted_, false)) return;
  const auto lent = store_->marked(places::Mark::lent);
  if (!lent) return;
  for (const auto& each : *lent) {
    const auto taken = store_->unmark(places::Mark::lent, each.device, "all that was lent is back");
    if (!taken) tell("error", "", "the slot table cannot be written: " + describe(taken.error()));
  }
}

// A slot's node-ID that was lent to one device and is another's by the plan.
rt::Task<void> Network::take_back_what_is_in_the_way() {
  const std::vector<places::Action> actions = plan_.actions;
  for (const auto& action : actions) {
    if (action.kind != places::Action::Kind::bind) continue;
    const NodeId id = seats_[action.slot]->id();
    const auto loan =
        std::ranges::find_if(lent_, [&](const Loan& l) { return l.id == id && l.device != action.device; });
    if (loan == lent_.end()) continue;
    const LssAddress device = loan->device;
    const bool back = co_await take_id_back(device, id);
    if (!back) continue;  // `act` gives it to no other before that was tried often enough
    std::erase_if(lent_, [&](const Loan& l) { return l.id == id && l.device == device; });
    const auto found = std::ranges::find(found_, device, &places::Found::device);
    if (found != found_.end()) found->active = NodeId();
    lent_until_[id.value()] = executor_->now();
    boots_.forget(id);
    vacancy_[id.value()].reset();
  }
}

// A device that was seated meanwhile has left it already. One that does not confirm keeps it, and is asked again in the
// next rounds; before its node-ID is lent to another, it is asked for like any other (`prepare_loans`).
rt::Task<void> Network::take_ids_back() {
  constexpr unsigned most_tries = 3;
  const std::vector<Loan> lent = std::exchange(lent_, {});
  for (const auto& loan : lent) {
    const LssAddress device = loan.device;
    const NodeId id = loan.id;
    const Seat* const seat = seat_of(device);
    const bool seated = seat != nullptr && seat->there;
    if (seated && seat->id() == id) {
      lent_until_[id.value()] = executor_->now();
      continue;
    }
    bool back = seated;
    if (!back) back = co_await take_id_back(device, id);
    if (!back && loan.tries + 1 < most_tries) {
      lent_.push_back({device, id, loan.tries + 1});
      continue;
    }
    const auto found = std::ranges::find(found_, device, &places::Found::device);
    if (back && !seated && found != found_.end()) found->active = NodeId();
    lent_until_[id.value()] = executor_->now();
    if (back) boots_.forget(id);
    vacancy_[id.value()].reset();
  }
  forget_loans();
}

// False: it did not confirm that it gives the node-ID up.
rt::Task<bool> Network::take_id_back(LssAddress device, NodeId id) {
  const auto selected = co_await select_alone(device);
  if (!selected) co_return false;
  const auto taken = co_await lss_.configure_node_id(NodeId());
  const auto released = co_await lss_.switch_global(lss::State::waiting);
  const bool told = taken && released;
  if (!told) co_return false;
  // A device with a single-slot receive buffer would lose the reset behind what was just sent.
  co_await rt::sleep_for(bus_->timing.rand_response);
  const auto reset = co_await nmt_.send(co::NmtCommand::reset_communication, id);
  co_return reset.has_value();
}

// ---- reading ----

void Network::forget_readings(const LssAddress& device) {
  std::erase_if(readings_, [&](const Reading& r) { return r.device == device; });
}

// False: it does not answer.
rt::Task<bool> Network::read_probes(LssAddress device, NodeId id) {
  const Slots all = slots();
  const std::vector<Probe> probes = places::probes_for(all, device);
  forget_readings(device);
  co::SdoOptions patience = sdo_.options();
  patience.longest = longest_probe;
  for (const Probe& probe : probes) {
    const auto value = co_await sdo_.upload(id, probe.index, probe.sub, patience);
    const bool there = value || value.error().code == Errc::aborted || value.error().code == Errc::mismatch;
    if (!there) co_return false;
    Reading reading{device, probe.index, probe.sub, std::nullopt};
    if (value) {
      const auto bytes = value->bytes();
      std::uint32_t number = 0;
      for (std::size_t i = 0; i < bytes.size() && i < 4; ++i) number |= static_cast<std::uint32_t>(bytes[i]) << (8 * i);
      if (!bytes.empty() && bytes.size() <= 4) reading.value = number;
    }
    readings_.push_back(reading);
  }
  co_return true;
}

// The new devices whose place a probe tells. False: nobody could be read, or somebody did not answer who was found just
// now: it may be resetting, and the place that two show is not the one's that is alone for a moment.
rt::Task<bool> Network::read_places() {
  constexpr unsigned patience = 3;
  const std::vector<LssAddress> devices = plan_.probes;
  bool any = false;
  co_await prepare_loans();
  for (const LssAddress& device : devices) {
    const auto read = co_await read_place(device);
    any = any || read;
  }
  const auto unheard = [&](const LssAddress& device) {
    return seat_of(device) == nullptr && std::ranges::find(found_, device, &places::Found::device) == found_.end();
  };
  const bool gone = std::ranges::any_of(devices, unheard) || std::ranges::any_of(puzzling_, unheard);
  unread_rounds_ = gone ? unread_rounds_ + 1 : 0;
  if (gone && unread_rounds_ <= patience) {
    look_anew_ = true;
    co_return false;
  }
  puzzling_.clear();
  co_return any;
}

rt::Task<bool> Network::read_place(LssAddress device) {
  const auto active = co_await active_id(device);
  if (!active) {
    if (active.error().code == Errc::duplicate) note_found({device, NodeId(), true});
    if (active.error().code == Errc::timeout) forget_found(device);
    co_return true;
  }
  NodeId id = *active;
  note_found({device, id});
  const Seat* const holder = seat_at(id);
  const bool taken = holder != nullptr && holder->slot.record.device() && holder->slot.record.device() != device;
  if (taken) co_return false;  // it is blanked first
  if (!id.configured()) {
    const auto lent = co_await lend_id(device);
    if (!lent) {
      tell_once("error", fmt::format("the place of {} cannot be read: {}", to_string(device), lent.error().text));
      co_return false;
    }
    id = *lent;
    note_found({device, id});
  }
  const bool read = co_await read_probes(device, id);
  if (read) {
    for (const auto& r : readings_) {
      if (r.device != device) continue;
      tell("step", "", fmt::format("{} has {} in {:04X}h:{:02X}", to_string(device), text_of(r.value), r.index, r.sub));
    }
  } else {
    tell("error", "", fmt::format("{} does not answer under node-ID {} to its probe", to_string(device), id.value()));
  }
  co_return read;
}

// At every boot of a slot's device: does it still sit in this place? The probe wins over the serial number that the
// slot remembers: a device that a mechanic moved gives its slot up and is seated anew.
rt::Task<bool> Network::stays_in_place(Seat& seat) {
  if (!seat.slot.spec.probe || bus_->role == design::Role::observer) co_return true;
  const LssAddress device = seat.slot.record.confirmed->device;
  const NodeId id = seat.id();
  const Probe own = *seat.slot.spec.probe;
  const auto read = co_await read_probes(device, id);
  const auto shows = [&](const Probe& probe) {
    return std::ranges::any_of(readings_, [&](const Reading& r) {
      return r.device == device && r.index == probe.index && r.sub == probe.sub && r.value && probe.matches(*r.value);
    });
  };
  seat.misplaced = !shows(own);
  if (!seat.misplaced) {
    forget_readings(device);
    co_return true;
  }
  const auto other = std::ranges::find_if(seats_, [&](const auto& s) {
    const auto& spec = s->slot.spec;
    return s.get() != &seat && spec.probe && places::fits(spec, device) && shows(*spec.probe);
  });
  if (other == seats_.end()) {
    const auto it = std::ranges::find_if(
        readings_, [&](const Reading& r) { return r.device == device && r.index == own.index && r.sub == own.sub; });
    const std::string has = !read                   ? "it does not answer"
                            : it == readings_.end() ? "it was not read"
                                                    : "it has " + text_of(it->value);
    set_state(seat, SlotState::failed,
              fmt::format("its probe {} shall be {:X}h in this place, and {}; is it in the right place?", name_of(own),
                          own.value, has));
    co_return false;
  }
  const std::string reason =
      fmt::format("by its probe {} its device sits in the place of slot {}", name_of(own), (*other)->name());
  tell("moved", seat.name(), reason);
  const auto cleared = clear_seat(seat, reason);
  if (!cleared) {
    set_state(seat, SlotState::failed, "the slot table cannot be written: " + describe(cleared.error()));
    co_return false;
  }
  seat.misplaced = false;
  note_found({device, id});
  look_anew_ = true;
  wakes_.push({Wake::Kind::look, id, executor_->now()});
  co_return false;
}

}  // namespace berth::operate

// Node-IDs that devices are lent: without one a device speaks no SDO, and in LSS configuration some makers' devices
// answer everything (`Loans` keeps the list).
#include <fmt/format.h>

#include <algorithm>

#include "berth/operate/network_seat.hpp"

namespace berth::operate {

// Not a slot's, not the master's, not one under which anybody was ever heard. `prepare_loans` asks whether it is
// vacant.
bool Network::may_be_lent(NodeId id) const noexcept {
  const bool slot = std::ranges::any_of(seats_, [&](const auto& s) { return s->id() == id; });
  return !slot && !spoken_for(id) && id != bus_->master && !boots_.heard(id);
}

// A device that was found has it, was lent it, or has told that it will have it when it boots.
bool Network::spoken_for(NodeId id) const noexcept {
  const bool held = std::ranges::any_of(found_, [&](const places::Found& f) { return f.active == id; });
  return held || loans_.lent(id) || progress_.told[id.value()];
}

bool Network::free_for_a_loan(const Seat& seat, const LssAddress& device) const noexcept {
  const NodeId id = seat.id();
  const auto& vacant = vacancy_[id.value()];
  return !seat.there && !seat.slot.record.device() && seat.slot.spec.assign == places::Assign::lss && !spoken_for(id) &&
         vacant && boots_.silent_since(id, *vacant) && places::fits(seat.slot.spec, device);
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
  loans_.expect_boot_up(id);
  const auto selected = co_await select_alone(device);
  if (!selected) co_return fail(selected.error());
  const bool written = lend(device, id);
  if (!written) co_return fail(Errc::io, "the slot table cannot be written");
  const auto given = co_await lss_.configure_node_id(id);
  const auto released = co_await lss_.switch_global(lss::State::waiting);
  if (!given) co_return fail(given.error());
  if (!released) co_return fail(released.error());
  const rt::Time deadline = began + bus_->timing.boot_timeout;
  const bool heard = co_await boots_.wait(id, began, deadline);
  if (!heard) co_return fail(Errc::timeout, "it was lent a node-ID and was not heard under it");
  co_return id;
}

// As many node-IDs that no device answers under as devices may come, asked side by side: the free slots' own are known.
rt::Task<void> Network::prepare_loans() {
  std::size_t wanted = 2;
  for (const auto& seat : seats_) wanted += seat->there || vacancy_[seat->id().value()] ? 0U : 1U;
  rt::Scope asked(*executor_, most_at_once());
  for (std::uint8_t value = 126; value > 0 && wanted > 0; --value) {
    const NodeId id(value);
    if (!may_be_lent(id)) continue;
    --wanted;
    if (!vacancy_[value]) asked.spawn(ask_vacancy(id));
  }
  co_await asked.join();
}

// Lent while the device is the only one selected; it is seated, or blank again, before the round is over.
NodeId Network::assign(const LssAddress& device) noexcept {
  const auto found = std::ranges::find(found_, device, &places::Found::device);
  const bool by_rand = found != found_.end() && std::ranges::find(by_rest_, device) == by_rest_.end();
  if (by_rand) return {};  // it waits for its place, and leaves no search by a loan
  const Seat* const seat = seat_of(device);
  // Lely core's slaves answer Fastscan with a node-ID too: what they use stays, and nothing else is pending.
  if (seat != nullptr && seat->there && seat->slot.record.confirmed) return seat->id();
  const bool own = seat != nullptr && vacancy_[seat->id().value()] && !boots_.heard(seat->id()) &&
                   !progress_.told[seat->id().value()];
  const NodeId id = own ? seat->id() : id_to_lend(device);
  if (!id.configured()) return id;
  const bool written = lend(device, id);
  if (!written) return {};
  loans_.expect_boot_up(id);
  return id;
}

bool Network::lend(const LssAddress& device, NodeId id) {
  const auto written = loans_.lend(device, id);
  if (!written) tell_once("error", "the slot table cannot be written: " + describe(written.error()));
  return written.has_value();
}

void Network::end_loan(const LssAddress& device) {
  const auto* const loan = loans_.of(device);
  if (loan == nullptr) return;
  loans_.expected_boot_up(loan->id, executor_->now());
  const auto written = loans_.end(device);
  if (!written) tell_once("error", "the slot table cannot be written: " + describe(written.error()));
}

// A slot's node-ID that was lent to one device and is another's by the plan.
rt::Task<void> Network::take_back_what_is_in_the_way() {
  const std::vector<places::Action> actions = plan_.actions;
  for (const auto& action : actions) {
    if (action.kind != places::Action::Kind::bind) continue;
    const auto* const loan = loans_.to_another(seats_[action.slot]->id(), action.device);
    const bool asks = loan != nullptr && may_be_asked(*loan);
    if (!asks) continue;
    const Loans::Loan in_the_way = *loan;
    co_await end_or_keep(in_the_way);
  }
}

// A device that does not confirm keeps its loan, and is asked again in the next rounds; later, when the whole bus is
// asked anew.
rt::Task<void> Network::take_ids_back() {
  const std::vector<Loans::Loan> lent = loans_.all();
  for (const auto& loan : lent) {
    const Seat* const seat = seat_of(loan.device);
    const bool seated = seat != nullptr && seat->there;
    const bool nothing_pending = seated && seat->id() == loan.id;
    if (nothing_pending) {
      end_loan(loan.device);
      continue;
    }
    if (!may_be_asked(loan)) continue;
    if (seated) {
      const Loans::Loan one = loan;
      const NodeId own = seat->id();
      co_await make_pending(one, own);
      continue;
    }
    const Loans::Loan one = loan;
    co_await end_or_keep(one);
  }
}

// It came back by itself, to its own node-ID, and what it was lent would come into use at its next reset.
rt::Task<void> Network::make_pending(Loans::Loan loan, NodeId own) {
  const auto told = co_await tell_pending(loan.device, own);
  if (told) {
    end_loan(loan.device);
  } else {
    loans_.kept(loan.device);
  }
}

bool Network::may_be_asked(const Loans::Loan& loan) const noexcept { return !Loans::given_up(loan) || retries_; }

rt::Task<void> Network::end_or_keep(Loans::Loan loan) {
  const auto back = co_await take_id_back(loan.device, loan.id);
  vacancy_[loan.id.value()].reset();
  if (!back) {
    loans_.kept(loan.device);
    loans_.expected_boot_up(loan.id, executor_->now());
    co_return;
  }
  const auto found = std::ranges::find(found_, loan.device, &places::Found::device);
  if (found != found_.end()) found->active = NodeId();
  end_loan(loan.device);
  boots_.forget(loan.id);
}

// A device that is away may have power, and what it was lent.
void Network::name_loans() {
  for (const auto& loan : loans_.all()) {
    const bool there = std::ranges::find(found_, loan.device, &places::Found::device) != found_.end();
    if (there || !Loans::given_up(loan)) continue;
    plan_.oddities.push_back(
        {"lent", loan.device, loan.id,
         fmt::format(
             "device {} was lent node-ID {} while it was searched for, and does not answer: the node-ID is given to "
             "no other device; switch it on, or `berth forget {}` when it is gone for good",
             to_string(loan.device), loan.id.value(), to_string(loan.device))});
  }
}

// Only this device has the node-ID pending, and is in LSS waiting. False: it did not confirm that.
rt::Task<bool> Network::tell_pending(LssAddress device, NodeId id) {
  const auto selected = co_await select_alone(device);
  if (!selected) co_return false;
  const auto given = co_await lss_.configure_node_id(id);
  const auto released = co_await lss_.switch_global(lss::State::waiting);
  co_return given&& released;
}

// False: it did not confirm that it gives the node-ID up.
rt::Task<bool> Network::take_id_back(LssAddress device, NodeId id) {
  const NodeId none;
  const auto told = co_await tell_pending(device, none);
  if (!told) co_return false;
  // A device with a single-slot receive buffer would lose the reset behind what was just sent.
  co_await rt::sleep_for(bus_->timing.rand_response);
  const auto reset = co_await nmt_.send(co::NmtCommand::reset_communication, id);
  co_return reset.has_value();
}

}  // namespace berth::operate

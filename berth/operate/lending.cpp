#include "berth/operate/lending.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/rt/scope.hpp"

namespace berth::operate {

// Not a slot's, not the master's, and never heard. `prepare` checks whether it is vacant.
bool Lending::may_be_lent(NodeId id) const noexcept {
  const bool slot = std::ranges::any_of(slots_.seats(), [&](const auto& s) { return s->id() == id; });
  return !slot && !spoken_for(id) && id != s_.bus.master && !s_.boots.heard(id);
}

// A found device has it, was lent it, or reported that it will have it when it boots.
bool Lending::spoken_for(NodeId id) const noexcept {
  const bool held = std::ranges::any_of(found_.all(), [&](const places::Found& f) { return f.active == id; });
  return held || loans_.lent(id) || told_[id.value()];
}

bool Lending::free_for_a_loan(const Seat& seat, const Identity& device) const noexcept {
  const NodeId id = seat.id();
  const auto& vacant = s_.vacancy[id.value()];
  return !seat.there() && !seat.slot.record.device() && seat.slot.spec.assign == places::Assign::lss &&
         !spoken_for(id) && vacant && s_.boots.vacant_since(id, *vacant) && places::fits(seat.slot.spec, device);
}

// The lowest free slot's node-ID that suits: searches find the devices of a type in ascending order, and with
// `ascending` the device stays there. Otherwise one without a slot; likewise for one of two devices with its address,
// because it cannot be determined which of them has it.
NodeId Lending::id_to_lend(const Identity& device) const noexcept {
  NodeId lowest;
  const bool clone = found_.is_clone(device);
  for (const auto& seat : slots_.seats()) {
    const bool lower = !lowest.configured() || seat->id() < lowest;
    if (!clone && lower && free_for_a_loan(*seat, device)) lowest = seat->id();
  }
  if (lowest.configured()) return lowest;
  for (std::uint8_t value = 126; value > 0; --value) {
    if (may_be_lent(NodeId(value)) && s_.vacancy[value]) return NodeId(value);
  }
  return {};
}

rt::Task<Result<NodeId>> Lending::lend_to(Identity device) {
  if (asking_.has_equals(device)) co_return fail(Errc::unsupported, "several devices have its LSS address");
  const NodeId id = id_to_lend(device);
  if (!id.configured()) co_return fail(Errc::exhausted, "no node-ID is free for it");
  const rt::Time began = s_.executor.now();
  loans_.expect_boot_up(id);
  const auto selected = co_await asking_.select_alone(device);
  if (!selected) co_return fail(selected.error());
  const bool written = lend(device, id);
  if (!written) co_return fail(Errc::io, "the slot table cannot be written");
  const lss::AloneOptions how{.vacancy = this};
  const bool store = false;
  const auto given = co_await lss::configure_alone(s_.lss, device.address, id, store, how);
  if (!given) co_return fail(given.error());
  if (given->outcome != lss::Given::Outcome::taken)
    co_return fail(Errc::timeout, "it did not take its temporary node-ID");
  bool heard = co_await s_.boots.wait(id, began, began + asking_.binder_options().own_boot);
  if (!heard) heard = co_await wake(device, id);
  if (!heard) co_return fail(Errc::timeout, "it got a temporary node-ID and was not heard under it");
  co_return id;
}

// Lely core's slaves take a first node-ID into use at NMT reset communication, not at `04 00`.
rt::Task<bool> Lending::wake(Identity device, NodeId id) {
  const auto* const loan = loans_.of(device);
  if (loan == nullptr || loan->id != id || s_.boots.heard(id)) co_return false;
  const rt::Time began = s_.executor.now();
  places::wake_unconfigured(s_.dispatcher);
  co_return co_await s_.boots.wait(id, began, began + s_.bus.timing.boot_timeout);
}

// Finds enough vacant node-IDs for the devices that may come, asked side by side: the free slots' own are known.
rt::Task<void> Lending::prepare() {
  std::size_t wanted = 2;
  for (const auto& seat : slots_.seats()) wanted += seat->there() || s_.vacancy[seat->id().value()] ? 0U : 1U;
  rt::Scope asked(s_.executor, asking_.most_at_once());
  for (std::uint8_t value = 126; value > 0 && wanted > 0; --value) {
    const NodeId id(value);
    if (!may_be_lent(id)) continue;
    --wanted;
    if (!s_.vacancy[value]) asked.spawn(asking_.vacancy(id));
  }
  co_await asked.join();
}

NodeId Lending::assign(const LssAddress& address, bool says_none) noexcept {
  const Identity device(address);
  if (asking_.has_equals(device)) return {};  // all of them would obey an LSS request to that address
  const bool by_rand = found_.of(device) != nullptr && !found_.without_rand(device);
  if (by_rand) return {};  // it waits for its place, and needs no loan to leave the search
  const Seat* const seat = slots_.of(device);
  const bool sits = seat != nullptr && seat->there() && seat->slot.record.confirmed;
  // The seated device may have no LSS, but a twin that has: the binding shows it.
  if (sits && says_none) return {};
  // Lely core's slaves answer Fastscan with a node-ID too: they keep it, and nothing else is pending.
  if (sits) return seat->id();
  const bool own = seat != nullptr && !found_.is_clone(device) && s_.vacancy[seat->id().value()] &&
                   !s_.boots.heard(seat->id()) && !told_[seat->id().value()];
  const NodeId id = own ? seat->id() : id_to_lend(device);
  if (!id.configured()) return id;
  const bool written = lend(device, id);
  if (!written) return {};
  loans_.expect_boot_up(id);
  return id;
}

bool Lending::still_vacant(NodeId id) const noexcept {
  const auto& vacant = s_.vacancy[id.value()];
  return !vacant || s_.boots.silent_since(id, *vacant);
}

bool Lending::lend(const Identity& device, NodeId id) {
  const auto written = loans_.lend(device, id);
  if (!written)
    slots_.events().tell_once(EventKind::error, "the slot table cannot be written: " + describe(written.error()));
  return written.has_value();
}

void Lending::end(const Identity& device) {
  const auto* const loan = loans_.of(device);
  // With clones, the other one may have it pending.
  const bool stays = loan == nullptr || loan->clones;
  if (stays) return;
  loans_.expected_boot_up(loan->id, s_.executor.now());
  const auto written = loans_.end(device);
  if (!written)
    slots_.events().tell_once(EventKind::error, "the slot table cannot be written: " + describe(written.error()));
}

// Takes back a slot's node-ID that was lent to one device and belongs to another by the plan.
rt::Task<void> Lending::take_back_what_is_in_the_way(std::vector<places::Action> actions) {
  for (const auto& action : actions) {
    if (action.kind != places::Action::Kind::bind) continue;
    const auto* const loan = loans_.to_another(slots_.seats()[action.slot]->id(), action.device);
    const bool asks = loan != nullptr && may_be_asked(*loan);
    if (!asks) continue;
    const Loans::Loan in_the_way = *loan;
    co_await end_or_keep(in_the_way);
  }
}

rt::Task<void> Lending::take_back_all() {
  const std::vector<Loans::Loan> lent = loans_.all();
  for (const auto& loan : lent) {
    const Seat* const seat = slots_.of(loan.device);
    // It has pending what it stored, and `11 FF` would make it store again.
    const bool waits = seat != nullptr && seat->state() == places::SlotState::power_cycle && seat->power_cycle.binding;
    if (waits) continue;
    const bool seated = seat != nullptr && seat->there();
    const bool one_sits = seated && loan.clones;
    if (one_sits) continue;  // `11 FF` would take its node-ID
    const bool nothing_pending = seated && seat->id() == loan.id;
    if (nothing_pending) {
      end(loan.device);
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

// It returned to its own node-ID by itself, but the lent one would become active at its next reset.
rt::Task<void> Lending::make_pending(Loans::Loan loan, NodeId own) {
  const auto told = co_await tell_pending(loan.device, own);
  if (told) {
    end(loan.device);
  } else {
    loans_.kept(loan.device);
  }
}

bool Lending::may_be_asked(const Loans::Loan& loan) const noexcept { return !Loans::given_up(loan) || agenda_.retries; }

rt::Task<void> Lending::end_or_keep(Loans::Loan loan) {
  const auto back = co_await take_back(loan.device, loan.id);
  s_.vacancy[loan.id.value()].reset();
  if (!back) {
    loans_.kept(loan.device);
    loans_.expected_boot_up(loan.id, s_.executor.now());
    co_return;
  }
  const auto found = found_.of(loan.device);
  if (found != nullptr) found->active = NodeId();
  end(loan.device);
  places::gave_up(s_.boots, s_.vacancy, loan.id);
}

// Two devices with its address may both be told to have none, because it cannot be determined which of them has the
// loan. So both must answer.
rt::Task<bool> Lending::tell_both(Identity device) {
  const NodeId none;
  lss::ServiceOptions whole = s_.lss.options().service;
  whole.full_window = true;
  const auto selected = co_await s_.lss.switch_selective(device.address, whole);
  if (!selected) co_return false;
  const auto given = co_await s_.lss.configure_node_id(none, whole);
  const auto released = co_await s_.lss.switch_global(lss::State::waiting);
  co_return given && given->answers > 1 && released;
}

rt::Task<bool> Lending::tell_pending(Identity device, NodeId id) {
  const auto selected = co_await asking_.select_alone(device);
  const bool clones = !selected && selected.error().code == Errc::duplicate;
  if (clones) loans_.doubled(device, true);
  const bool both = clones && !id.configured();
  if (!selected && !both) co_return false;
  if (both) {
    const auto told = co_await tell_both(device);
    if (told) loans_.doubled(device, false);
    co_return told;
  }
  const bool store = false;
  const auto given = co_await lss::configure_alone(s_.lss, device.address, id, store);
  co_return given && given->outcome == lss::Given::Outcome::taken;
}

rt::Task<bool> Lending::recall(Identity device) {
  const auto* const loan = loans_.of(device);
  const bool scanned = loan != nullptr && !loan->clones && s_.lss.lacks().is_scanned(device.address);
  if (!scanned) co_return false;
  const NodeId id = loan->id;
  const rt::Time asked = s_.executor.now();
  bool answers = co_await asking_.answers_at(id);
  // It may take long to boot under the lent node-ID. A device with 40h to 43h is selected by them later.
  const bool waits = !answers && s_.lss.lacks().has(device.address, lss::Lackable::select);
  if (waits) answers = co_await s_.boots.wait(id, asked, asked + s_.bus.timing.boot_timeout);
  if (!answers) co_return false;
  co_await rt::sleep_for(s_.bus.timing.rand_response);
  const auto sent = co_await s_.nmt.send(co::NmtCommand::reset_node, id);
  const rt::Time deadline = s_.executor.now() + s_.bus.timing.boot_timeout;
  while (sent && s_.executor.now() < deadline && !s_.boots.booted_since(id, *sent)) {
    const auto blank = co_await lss::any_without_node_id(s_.lss, device.address);
    if (!blank) co_return false;
    if (*blank) {
      const auto found = found_.of(device);
      if (found != nullptr) found->active = NodeId();
      end(device);
      places::gave_up(s_.boots, s_.vacancy, id);
      co_return true;
    }
    co_await rt::sleep_for(std::chrono::milliseconds(50));
  }
  co_return false;
}

// False: it did not confirm that it gives the node-ID up.
rt::Task<bool> Lending::take_back(Identity device, NodeId id) {
  const NodeId none;
  const auto told = co_await tell_pending(device, none);
  if (!told) co_return co_await recall(device);
  // A device with a single receive buffer would lose the reset after the previous frame.
  co_await rt::sleep_for(s_.bus.timing.rand_response);
  const auto reset = co_await s_.nmt.send(co::NmtCommand::reset_communication, id);
  co_return reset.has_value();
}

}  // namespace berth::operate

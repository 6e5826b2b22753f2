// Where node-IDs come from (paper 4, S4.2): stored ones are found and set right, those of switches, plugs and firmware
// are never written and what does not fit is said.
#include <fmt/format.h>

#include <algorithm>

#include "berth/operate/network_seat.hpp"

namespace berth::operate {

using places::Action;
using places::Assign;
using places::Mark;
using places::SlotState;

namespace {

// What devices leave the factory with most often (paper 4, S4.21).
constexpr std::array<NodeId, 3> factory_ids{NodeId(1), NodeId(32), NodeId(127)};

}  // namespace

// It once refused 11h, or all slots that it fits say that its node-ID is not given by LSS.
bool Network::never_by_lss(const LssAddress& device) const {
  if (is_marked(Mark::fixed, device)) return true;
  bool any = false;
  for (const auto& seat : seats_) {
    if (!places::fits(seat->slot.spec, device)) continue;
    if (seat->slot.spec.assign == Assign::lss) return false;
    any = true;
  }
  return any;
}

// Takes out of the plan what LSS cannot do, and says what is the matter instead.
void Network::respect_fixed() {
  std::vector<LssAddress> told;
  std::erase_if(plan_.actions, [&](const Action& a) {
    const bool bind = a.kind == Action::Kind::bind;
    const auto assign = bind ? seats_[a.slot]->slot.spec.assign : Assign::lss;
    if (assign == Assign::recipe) return true;  // network_recipe.cpp
    const bool drops = assign == Assign::fixed || never_by_lss(a.device);
    if (drops) told.push_back(a.device);
    return drops;
  });
  for (const auto& oddity : plan_.oddities) {
    if (oddity.kind == "fixed mismatch") told.push_back(oddity.device);
  }
  std::ranges::sort(told);
  const auto twice = std::ranges::unique(told);
  told.erase(twice.begin(), twice.end());
  const auto by_recipe = [&](const LssAddress& device) {
    return std::ranges::any_of(seats_, [&](const auto& s) {
      return s->slot.spec.assign == Assign::recipe && places::fits(s->slot.spec, device);
    });
  };
  for (const auto& device : told) {
    if (by_recipe(device)) {
      std::erase_if(plan_.oddities,
                    [&](const places::Oddity& o) { return o.device == device && o.kind == "fixed mismatch"; });
      continue;
    }
    std::erase_if(plan_.oddities, [&](const places::Oddity& o) { return o.device == device; });
    const auto found = std::ranges::find(found_, device, &places::Found::device);
    tell_mismatch(device, found == found_.end() ? NodeId() : found->active);
  }
}

void Network::tell_mismatch(const LssAddress& device, NodeId active) {
  std::string needed;
  std::string number;
  for (const auto& seat : seats_) {
    const auto sits = seat->slot.record.device();
    const bool waits = sits ? *sits == device : places::fits(seat->slot.spec, device);
    if (!waits || seat->id() == active) continue;
    needed += fmt::format("{}slot {} needs {}", needed.empty() ? "" : ", ", seat->name(), seat->id().value());
    if (number.empty()) number = fmt::format("{}", seat->id().value());
  }
  const Seat* const owner = active.configured() ? seat_at(active) : nullptr;
  const bool at_home = owner != nullptr && places::fits(owner->slot.spec, device) &&
                       owner->slot.record.device().value_or(device) == device;
  if (at_home) return;  // it is taken as it is
  std::string text = fmt::format("device {} has {}, by its switches, plug or firmware", to_string(device),
                                 active.configured() ? fmt::format("node-ID {}", active.value()) : "a fixed node-ID");
  if (owner != nullptr) text += fmt::format(", which belongs to slot {}", owner->name());
  text += needed.empty() ? "; no slot waits for it: take it off the bus"
                         : fmt::format("; {}: set its switches to {}, or put it into the place that has this coding",
                                       needed, number);
  plan_.oddities.push_back({"fixed mismatch", device, active, text});
}

// 11h was refused: the node-ID is not LSS's to give. It is not tried again, for the sake of the device and of time.
void Network::learn_fixed(const places::Binding& binding) {
  if (binding.why() != places::Why::refused) return;
  const LssAddress& device = binding.seat().device;
  set_mark(Mark::fixed, device, binding.old_id(), "LSS configure node-ID was refused");
  const auto found = std::ranges::find(found_, device, &places::Found::device);
  if (found != found_.end()) found->active = binding.old_id();
}

// ---- who is there with a node-ID, and speaks nothing that a discovery hears ----

std::vector<NodeId> Network::ids_to_ask(bool everybody) {
  const rt::Time now = executor_->now();
  const bool sweeps = everybody || now >= sweep_at_;  // also the slots' own: none stays empty unasked
  const auto waits = [](const auto& s) { return !s->slot.record.device() && s->state != SlotState::question; };
  const bool other =
      std::ranges::any_of(seats_, [&](const auto& s) { return s->slot.spec.assign != Assign::lss && !s->there; });
  const bool by_lss = std::ranges::any_of(seats_, waits);
  if (sweeps) sweep_at_ = now + 8 * bus_->timing.probe_period;
  std::vector<NodeId> ids;
  for (std::uint8_t i = 1; i <= 127; ++i) {
    const NodeId id(i);
    const Seat* const seat = seat_at(id);
    const auto heard = boots_.heard(id);
    const bool speaks = heard && *heard > asked_at_[i];
    const bool known = (seat != nullptr && seat->there) || (id == bus_->master && speaks_ && !speaks && !sweeps) ||
                       std::ranges::find(found_, id, &places::Found::active) != found_.end();
    if (known) continue;
    const bool factory = std::ranges::find(factory_ids, id) != factory_ids.end();
    const bool own = seat != nullptr && seat->slot.spec.assign != Assign::fixed;
    const bool again = std::exchange(look_again_at_[i], false);
    const bool masters = sweeps && id == bus_->master &&
                         (speaks_ || !vacancy_[i]);  // the master's own device does not hear its own port's question
    const bool asks = speaks || again || masters || everybody || (sweeps && (own || other || (factory && by_lss)));
    if (!asks) continue;
    asked_at_[i] = now;
    ids.push_back(id);
  }
  return ids;
}

// When a slot stays without a device: not at once, as devices may still be booting, and then so that it takes little of
// the bus.
bool Network::everywhere_due() {
  const rt::Time now = executor_->now();
  const auto period = bus_->timing.probe_period;
  if (everywhere_at_ == rt::Time{}) everywhere_at_ = once_ ? now : now + 2 * period;
  const bool first = !asked_everywhere_;
  const bool waits = std::ranges::any_of(seats_, [&](const auto& s) {
    const bool counts = first || !s->slot.spec.optional;
    return counts && !s->there && s->slot.spec.assign == Assign::lss && !s->slot.record.device();
  });
  const bool due = method() == "auto" && waits && !search_open_ && now >= everywhere_at_;
  if (!due) return false;
  constexpr std::int64_t bits = 127LL * 150;
  const rt::Duration takes(bits * 1'000'000'000 / bus_->bitrate);
  everywhere_at_ = now + std::max<rt::Duration>(8 * period, 20 * takes);
  asked_everywhere_ = true;
  return true;
}

// Who has a node-ID of no slot, booted long ago, beats no heart and answers no identify (CANopenNode's slaves) is found
// by no search. One question each: who answers is asked again, with patience.
rt::Task<void> Network::ask_everywhere() {
  const bool due = everywhere_due();
  if (!due) co_return;
  rt::Scope asked(*executor_, most_at_once());
  const std::size_t waiting = wakes_.size();
  for (std::uint8_t i = std::exchange(everywhere_from_, std::uint8_t{1}); i <= 127; ++i) {
    const NodeId id(i);
    const Seat* const seat = seat_at(id);
    const bool known = (seat != nullptr && seat->there) || id == bus_->master ||
                       std::ranges::find(found_, id, &places::Found::active) != found_.end();
    if (known) continue;
    // A device that boots meanwhile is more than one that may be there.
    if (wakes_.size() > waiting) {
      everywhere_from_ = i;
      everywhere_at_ = executor_->now() + 2 * bus_->timing.probe_period;
      break;
    }
    co_await rt::sleep_for(bus_->timing.rand_response);  // a single-slot receive buffer loses its own behind another's
    asked.spawn(knock(id));
  }
  co_await asked.join();
}

rt::Task<void> Network::knock(NodeId id) {
  const co::SdoOptions patience = asking(0);
  const auto type = co_await sdo_.read<std::uint32_t>(id, 0x1000, 0, patience);
  if (type || type.error().code == Errc::aborted) look_again_at_[id.value()] = true;
}

// True: somebody was found of whom the plan did not know.
rt::Task<bool> Network::find_configured(bool everybody) {
  if (alone_) co_return false;
  co_await ask_everywhere();
  const std::vector<NodeId> ids = ids_to_ask(everybody);
  if (ids.empty()) co_return false;
  std::vector<places::Found> answered;
  {
    rt::Scope asked(*executor_, most_at_once());
    for (const NodeId id : ids) asked.spawn(identity_at(id, answered));
    co_await asked.join();
  }
  const std::vector<NodeId> doubled = std::exchange(doubled_, {});
  bool news = co_await tell_all_apart(doubled);
  for (const auto& f : answered) {
    const auto known = std::ranges::find(found_, f.device, &places::Found::device);
    const bool same = known != found_.end() && known->active == f.active;
    if (same) continue;
    Seat* const seat = seat_at(f.active);
    const bool home = seat != nullptr && seat_of(f.device) == seat && seat->slot.record.confirmed;
    if (home) {
      co_await ask_seat(*seat);
      continue;
    }
    const bool adopts = seat != nullptr && !seat->slot.record.device() && never_by_lss(f.device) &&
                        seat->slot.spec.assign != Assign::recipe;
    if (adopts) {
      co_await adopt_fixed(*seat);
      continue;
    }
    note_found(f);
    news = true;
    tell_once("found", fmt::format("found {} with node-ID {}", to_string(f.device), f.active.value()));
  }
  co_return news;
}

// Nothing needs to be assigned: the device that LSS does not reach, or that does not take a node-ID, sits under the
// slot's already. False: it is not there any more.
rt::Task<bool> Network::take_where_it_is(Seat& seat, LssAddress device) {
  const auto who = co_await places::Binder::read_identity(sdo_, seat.id());
  if (!who || *who != device) co_return false;
  const places::Seat wanted{device, seat.id()};
  const std::string reason = "it has the slot's node-ID, and LSS does not change it";
  const auto asked = store_->ask(seat.slot.record.slot, wanted, reason);
  const auto confirmed = asked ? store_->confirm(seat.slot.record.slot, wanted, reason) : asked;
  refresh(seat);
  if (!confirmed) {
    set_state(seat, SlotState::failed, "the slot table cannot be written: " + describe(confirmed.error()));
    co_return true;
  }
  forget_found(device);
  tell("bound", seat.name(), fmt::format("{} sits there by its own node-ID {}", to_string(device), seat.id().value()));
  seat.fresh = true;
  co_await ask_seat(seat);
  co_return true;
}

// Before anything is searched for, and before anything is called empty: a device may sit where it belongs already, have
// booted long ago, beat no heart and speak no LSS. All are asked side by side; silence makes the node-ID vacant, which
// is to be known before it is given.
rt::Task<void> Network::ask_own_ids() {
  if (alone_) co_return;
  std::vector<places::Found> answered;
  {
    rt::Scope asked(*executor_, most_at_once());
    for (const auto& seat : seats_) {
      const bool waits = !seat->there && seat->slot.spec.assign == Assign::lss && !seat->slot.record.confirmed;
      if (waits) asked.spawn(identity_at(seat->id(), answered));
    }
    // And who was heard under a node-ID of no slot: nothing is given away before all that speak are known.
    for (std::uint8_t i = 1; i <= 127; ++i) {
      const NodeId id(i);
      const auto heard = boots_.heard(id);
      const bool again = std::exchange(look_again_at_[i], false);
      const bool spoke = heard && *heard > asked_at_[i] && !loans_.of_ours(id, *heard);
      const bool strange = (again || spoke) && seat_at(id) == nullptr && id != bus_->master;
      if (!strange) continue;
      asked_at_[i] = executor_->now();
      asked.spawn(identity_at(id, answered));
    }
    co_await asked.join();
  }
  const std::vector<NodeId> doubled = std::exchange(doubled_, {});
  co_await tell_all_apart(doubled);
  for (const auto& f : answered) {
    note_found(f);
    tell_once("found", fmt::format("found {} with node-ID {}", to_string(f.device), f.active.value()));
  }
}

rt::Task<void> Network::identity_at(NodeId id, std::vector<places::Found>& into) {
  const auto surplus = sdo_.surplus(id);
  const bool answers = co_await answers_at(id);
  if (!answers) co_return;
  const auto who = co_await places::Binder::read_identity(sdo_, id);
  if (sdo_.surplus(id) != surplus || !who) {
    doubled_.push_back(id);
    tell_once("duplicate",
              fmt::format("node-ID {} answers, and not as one device: two devices may hold it; leave one of "
                          "them on the bus",
                          id.value()));
    co_return;
  }
  places::Found found;
  found.device = *who;
  found.active = id;
  found.seen = executor_->now();
  into.push_back(found);
}

// ---- everything anew ----

rt::Task<Result<void>> Network::bind_from_scratch(bool confirmed) {
  co_await turn_.take();
  const rt::Held held(turn_);
  if (!confirmed) co_return fail(Errc::invalid, "every device would lose its node-ID; confirm it with --yes");
  if (!may_command()) co_return fail(Errc::unsupported, "this bus is not commanded by Berth (role)");
  const auto halted = co_await nmt_.send(co::NmtCommand::enter_pre_operational, co::NmtTarget::all());
  if (!halted) co_return fail(halted.error());
  co_await opening();
  for (auto& seat : seats_) {
    if (!seat->slot.record.device()) continue;
    const auto cleared = clear_seat(*seat, std::string(places::from_scratch));
    if (!cleared) co_return fail(cleared.error());
  }
  found_.clear();
  look_anew_ = true;
  co_await discover();
  co_await inquire_found(true);
  const bool everybody = true;
  co_await find_configured(everybody);
  const std::vector<places::Found> found = found_;
  for (const auto& f : found) {
    const bool blanks = f.active.configured() && !f.clone && !never_by_lss(f.device);
    if (!blanks) continue;
    const LssAddress device = f.device;
    const std::string reason(places::from_scratch);
    co_await blank(device, reason);
  }
  for (auto& seat : seats_) {
    const bool fixed = seat->slot.spec.assign == Assign::fixed && !seat->slot.record.confirmed;
    if (fixed) co_await adopt_fixed(*seat);
  }
  co_await bind_by_recipe();
  co_await carry_out();
  const auto left = std::ranges::find_if(seats_, [](const auto& s) { return !s->slot.spec.optional && !s->there; });
  if (left != seats_.end()) co_return fail(Errc::not_found, "not every slot has its device; see the report");
  co_return Result<void>();
}

}  // namespace berth::operate

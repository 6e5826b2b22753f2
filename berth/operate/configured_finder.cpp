#include "berth/operate/configured_finder.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/rt/scope.hpp"

namespace berth::operate {

using places::Assign;
using places::SlotState;

namespace {

// The most common factory node-IDs (paper 4, S4.21).
constexpr std::array<NodeId, 3> factory_ids{NodeId(1), NodeId(32), NodeId(127)};

}  // namespace

rt::Task<void> ConfiguredFinder::ask_slots_own() {
  if (agenda_.alone) co_return;
  std::vector<NodeId> ids;
  if (!agenda_.speaks) ids.push_back(s_.bus.master);  // asked here, so that no binding waits for it later
  for (const auto& seat : slots_.seats()) {
    const bool waits = !seat->there() && seat->slot.spec.assign == Assign::lss && !seat->slot.record.confirmed;
    if (waits) ids.push_back(seat->id());
  }
  // Also devices that were heard under a node-ID without a slot: nothing is assigned before all heard devices are
  // known.
  for (std::uint8_t i = 1; i <= 127; ++i) {
    const NodeId id(i);
    const auto heard = s_.boots.heard(id);
    const bool again = std::exchange(look_again_at_[i], false);
    const bool spoke = heard && *heard > asked_at_[i] && !loans_.of_ours(id, *heard);
    const bool strange = (again || spoke) && slots_.at(id) == nullptr && id != s_.bus.master;
    if (!strange) continue;
    asked_at_[i] = s_.executor.now();
    ids.push_back(id);
  }
  const std::vector<places::Found> answered = co_await identities(ids);
  co_await tell_duplicates_apart();
  for (const auto& f : answered) {
    agenda_.comes.reset(f.active.value());
    note(f);
  }
}

// Asks all nodes side by side.
rt::Task<std::vector<places::Found>> ConfiguredFinder::identities(std::vector<NodeId> ids) {
  std::vector<places::Found> answered;
  rt::Scope asked(s_.executor, asking_.most_at_once());
  for (const NodeId id : ids) asked.spawn(identity_at(id, answered));
  co_await asked.join();
  co_return answered;
}

rt::Task<bool> ConfiguredFinder::tell_duplicates_apart() {
  const std::vector<NodeId> doubled = std::exchange(doubled_, {});
  co_return co_await duplicates_.tell_apart(doubled);
}

void ConfiguredFinder::note(const places::Found& found) {
  found_.note(found);
  slots_.events().tell_once(EventKind::found,
                            fmt::format("found {} with node-ID {}", to_string(found.device), found.active.value()));
}

rt::Task<bool> ConfiguredFinder::find(bool all) {
  if (agenda_.alone) co_return false;
  co_await ask_everywhere();
  bool news = co_await ask_borrowers();
  const std::vector<NodeId> ids = ids_to_ask(all);
  if (ids.empty()) co_return news;
  const std::vector<places::Found> answered = co_await identities(ids);
  const bool apart = co_await tell_duplicates_apart();
  news = news || apart;
  for (const auto& f : answered) {
    Seat* const seat = slots_.at(f.active);
    const bool home = seat != nullptr && slots_.of(f.device) == seat && seat->slot.record.confirmed;
    if (home) {
      co_await presence_.ask_seat(*seat);
      continue;
    }
    const bool adopts = seat != nullptr && !seat->slot.record.device() && planning_.never_by_lss(f.device) &&
                        seat->slot.spec.assign != Assign::recipe;
    if (adopts) {
      co_await presence_.adopt_fixed(*seat);
      continue;
    }
    const auto known = found_.of(f.device);
    const bool same = known != nullptr && known->active == f.active;
    if (same) continue;
    note(f);
    news = true;
  }
  co_return news;
}

// A device that gave its loan back but missed the reset after it still uses the lent node-ID, unheard. Without a
// node-ID it may be hidden from a search that finds one device at a time (Fastscan), behind another that waits for its
// power cycle.
rt::Task<bool> ConfiguredFinder::ask_borrowers() {
  bool news = false;
  if (!agenda_.retries) co_return news;
  const std::vector<Identity> borrowers = loans_.borrowers();
  for (const Identity& borrower : borrowers) {
    const Identity device = borrower;
    const bool known = found_.of(device) != nullptr || slots_.of(device) != nullptr;
    if (known) continue;
    const auto id = co_await asking_.active_id_once(device);
    if (!id || (!id->configured() && !has_vacancy_for(slots_, device))) continue;
    if (id->configured()) {
      note({device, *id});
    } else {
      found_.note({device, NodeId()});  // reported when it was found
    }
    news = true;
  }
  co_return news;
}

std::uint64_t ConfiguredFinder::all_boot_ups() const noexcept {
  std::uint64_t sum = 0;
  for (std::uint8_t i = 1; i <= 127; ++i) sum += s_.boots.boot_ups(NodeId(i));
  return sum;
}

std::vector<NodeId> ConfiguredFinder::ids_to_ask(bool all) {
  const rt::Time now = s_.executor.now();
  const bool sweeps = all || now >= sweep_at_;  // also the slots' own: none is reported empty unasked
  const auto waits = [](const auto& s) { return !s->slot.record.device() && s->state() != SlotState::question; };
  const bool lacks_other = std::ranges::any_of(
      slots_.seats(), [&](const auto& s) { return s->slot.spec.assign != Assign::lss && !s->there(); });
  const bool by_lss = std::ranges::any_of(slots_.seats(), waits);
  if (sweeps) sweep_at_ = now + 8 * s_.bus.timing.probe_period;
  const bool other = lacks_other && sweeps && now >= others_at_;
  if (other) others_at_ = now + others_.periods(all_boot_ups()) * s_.bus.timing.probe_period;
  agenda_.comes.reset();  // nodes that booted were heard, and are asked below
  std::vector<NodeId> ids;
  for (std::uint8_t i = 1; i <= 127; ++i) {
    const NodeId id(i);
    const Seat* const seat = slots_.at(id);
    const auto heard = s_.boots.heard(id);
    const bool speaks = heard && *heard > asked_at_[i];
    const bool known =
        (seat != nullptr && seat->there()) || (id == s_.bus.master && agenda_.speaks && !speaks && !sweeps);
    const bool found = found_.any_at(id);
    const bool takes = seat != nullptr && seat->slot.spec.assign == Assign::fixed && !seat->slot.record.device();
    const bool rests = seat != nullptr && !seat->polled && !speaks;
    if (known || rests || (found && !takes)) continue;
    const bool factory = std::ranges::find(factory_ids, id) != factory_ids.end();
    const bool own = seat != nullptr && seat->slot.spec.assign != Assign::fixed;
    const bool again = std::exchange(look_again_at_[i], false);
    const bool masters =
        sweeps && id == s_.bus.master &&
        (agenda_.speaks || !s_.vacancy[i]);  // the master's own device does not hear its own port's question
    const bool asks = speaks || again || masters || all || found || (sweeps && (own || other || (factory && by_lss)));
    if (!asks) continue;
    asked_at_[i] = now;
    ids.push_back(id);
  }
  return ids;
}

// Due when a slot stays without a device. Not at once, because devices may still be booting; then at long intervals to
// keep the bus load low.
bool ConfiguredFinder::everywhere_due() {
  const rt::Time now = s_.executor.now();
  const auto period = s_.bus.timing.probe_period;
  if (everywhere_at_ == rt::Time{}) everywhere_at_ = agenda_.once ? now : now + 2 * period;
  const bool first = !asked_everywhere_;
  const bool waits = std::ranges::any_of(slots_.seats(), [&](const auto& s) {
    const bool counts = first || !s->slot.spec.optional;
    return counts && !s->there() && s->slot.spec.assign == Assign::lss && !s->slot.record.device();
  });
  const bool due = agenda_.method() == "auto" && waits && !agenda_.search_open && now >= everywhere_at_;
  if (!due) return false;
  constexpr std::int64_t bits = 127LL * 150;
  const rt::Duration takes(bits * 1'000'000'000 / s_.bus.bitrate);
  everywhere_at_ = now + std::max<rt::Duration>(everywhere_.periods(all_boot_ups()) * period, 20 * takes);
  asked_everywhere_ = true;
  return true;
}

// No search finds a device with a node-ID of no slot that booted long ago, sends no heartbeat and answers no identify
// (CANopenNode's slaves). Each node-ID gets one question; one that answers is asked again with the usual timeout.
rt::Task<void> ConfiguredFinder::ask_everywhere() {
  const bool due = everywhere_due();
  if (!due) co_return;
  rt::Scope asked(s_.executor, asking_.most_at_once());
  const std::size_t waiting = agenda_.wakes.size();
  for (std::uint8_t i = std::exchange(everywhere_from_, std::uint8_t{1}); i <= 127; ++i) {
    const NodeId id(i);
    const Seat* const seat = slots_.at(id);
    const bool known = (seat != nullptr && seat->there()) || id == s_.bus.master || found_.any_at(id);
    if (known || (seat != nullptr && !seat->polled)) continue;
    // A device that boots now is more important than one that may be there.
    if (agenda_.wakes.size() > waiting) {
      everywhere_from_ = i;
      everywhere_at_ = s_.executor.now() + 2 * s_.bus.timing.probe_period;
      break;
    }
    co_await rt::sleep_for(s_.bus.timing.rand_response);  // a single receive buffer loses a question after another one
    asked.spawn(knock(id));
  }
  co_await asked.join();
}

rt::Task<void> ConfiguredFinder::knock(NodeId id) {
  const co::SdoOptions patience = asking_.patience(0);
  const auto type = co_await s_.sdo.read<std::uint32_t>(id, 0x1000, 0, patience);
  if (type || type.error().code == Errc::aborted) look_again_at_[id.value()] = true;
}

// If another device appears under the node-ID between the questions, the parts may come from two devices; if it stays,
// its answers come a little later.
rt::Task<Result<Identity>> ConfiguredFinder::identity_of_one(NodeId id, std::uint64_t boot_ups) {
  constexpr int most_readings = 3;
  Result<Identity> who;
  bool came = false;
  for (int reading = 0; reading < most_readings; ++reading) {
    who = co_await places::read_identity(s_.sdo, id);
    const bool alone = s_.boots.boot_ups(id) == boot_ups;
    boot_ups = s_.boots.boot_ups(id);
    came = came || !alone;
    if (came) co_await rt::sleep_for(places::second_answer);
    if (alone) break;
  }
  co_return who;
}

rt::Task<void> ConfiguredFinder::identity_at(NodeId id, std::vector<places::Found>& into) {
  const auto surplus = s_.sdo.surplus(id);
  const auto boot_ups = s_.boots.boot_ups(id);
  const bool answers = co_await asking_.answers_at(id);
  Seat* const seat = slots_.at(id);
  if (seat != nullptr) seat->doubt.by_two = false;
  if (!answers) co_return;
  auto who = co_await identity_of_one(id, boot_ups);
  bool doubled = s_.sdo.surplus(id) != surplus;
  if (doubled) {
    co_await rt::sleep_for(places::second_answer);
    const auto again = co_await places::identify(s_.sdo, id, places::second_answer);
    doubled = again.by_two;
    who = again.who;
  }
  if (doubled || !who) {
    doubled_.push_back(id);
    if (seat != nullptr) seat->doubt.by_two = doubled;
    slots_.events().tell_once(
        EventKind::duplicate,
        fmt::format("node-ID {} answers, and not as one device: two devices may hold it; leave one of "
                    "them on the bus",
                    id.value()));
    co_return;
  }
  places::Found found;
  found.active = id;
  found.device = found_.known_as({*who, id});
  found.seen = s_.executor.now();
  into.push_back(found);
}

}  // namespace berth::operate

#include "berth/operate/finder.hpp"

#include <algorithm>

#include "berth/operate/extended_frames.hpp"

namespace berth::operate {

rt::Task<void> Finder::discover() {
  const bool anew = co_await search_for_all();
  if (agenda_.search_open) co_return;
  co_await ask_for_the_forgotten();
  if (anew) found_.forget_who_left();
}

// True: all are asked anew.
rt::Task<bool> Finder::search_for_all() {
  agenda_.phase = Phase::discovery;
  if (agenda_.rest_at == rt::Time{}) agenda_.rest_at = s_.executor.now() + 2 * s_.bus.timing.probe_period;
  const bool by_rand_first = agenda_.method() == "auto" || agenda_.method() == "rand";
  const bool rand_goes_on = by_rand_first && agenda_.search_open && search_.rand_is_open();
  if (rand_goes_on) {
    search_.begin();
    co_return co_await rand_first(open_anew_);
  }
  if (agenda_.search_open) {
    const bool ended = co_await search_.go_on();
    if (ended) searched();
    co_return false;
  }
  // Devices that wait without a seat are in RAND's state identified and would not answer: all are asked anew, and
  // devices that left are forgotten.
  const bool waiting = std::ranges::any_of(found_.all(), [&](const auto& f) { return slots_.of(f.device) == nullptr; });
  const bool anew = agenda_.look_anew || waiting;
  if (anew) co_await forget_and_ask_anew();
  search_.begin();
  if (by_rand_first) co_return co_await rand_first(anew);
  const bool ended = co_await search_.by_method();
  if (ended) searched();
  co_return anew;
}

// An interrupted search continues in the next round; other work waits for its end.
rt::Task<bool> Finder::rand_first(bool anew) {
  const std::size_t before = found_.size();
  open_anew_ = anew;
  co_await by_rand();
  if (search_.rand_is_open()) co_return false;
  const bool any = found_.size() > before;
  co_await rest_behind_rand(anew, any);
  co_return anew;
}

rt::Task<void> Finder::forget_and_ask_anew() {
  agenda_.look_anew = false;
  agenda_.anew_at = s_.executor.now() + 8 * s_.bus.timing.probe_period;
  const auto goes = [&](const places::Found& f) { return f.clone || slots_.of(f.device) == nullptr; };
  for (const auto& f : found_.all()) {
    if (!goes(f)) continue;
    rest_wanted_ = rest_wanted_ || found_.without_rand(f.device);
    places_.forget(f.device);
    // No search finds it again if none of its services finds devices with a node-ID.
    if (f.active.configured() && !f.lent) configured_.look_again_at(f.active);
    const bool told = std::ranges::find(forgotten_, f.device, &Forgotten::device) != forgotten_.end();
    const bool holds = holds_anothers(f);
    if ((holds || !f.active.configured()) && !f.clone && !told) forgotten_.push_back({f.device, holds});
  }
  found_.forget_if(goes);
  co_await configured_.ask_slots_own();
  const auto& method = agenda_.method();
  const bool speaks_rand = method == "auto" || method == "rand" || method == "planner-rand";
  if (speaks_rand && may_send_extended_frames(s_, agenda_)) co_await tell_which_are_known();
}

bool Finder::holds_anothers(const places::Found& found) const {
  const bool anothers = slots_.at(found.active) != nullptr || found.active == s_.bus.master;
  return anothers && found.active.configured() && !found.lent && found.device.has_serial() &&
         !slots_.is_marked(places::Mark::fixed, found.device);
}

bool Finder::waits_for_forgotten() const noexcept { return std::ranges::any_of(forgotten_, &Forgotten::holds); }

// A search may miss what an earlier search, SDO or a blanking found: the device may have no RAND, and a published
// Fastscan finds one of several. Each is asked once, by its LSS address; one that holds another's node-ID at some more
// looks: it may be deaf while it stores or boots, and no other question reaches it beside the slot's device.
rt::Task<void> Finder::ask_for_the_forgotten() {
  constexpr unsigned most_looks = 4;
  const std::vector<Forgotten> all = std::exchange(forgotten_, {});
  for (const auto& [device, holds, looks] : all) {
    const bool known = found_.of(device) != nullptr || slots_.of(device) != nullptr;
    if (known) continue;
    const auto active = co_await asking_.active_id(device);
    const bool clone = !active && active.error().code == Errc::duplicate;
    if (active) found_.note({device, *active});
    if (clone) found_.note({device, NodeId(), true});
    const bool again = holds && !active && !clone && looks + 1 < most_looks;
    if (again) forgotten_.push_back({device, holds, looks + 1});
  }
}

rt::Task<void> Finder::rest_behind_rand(bool anew, bool any_by_rand) {
  const bool others = agenda_.method() == "auto" && !agenda_.alone;
  const bool due = others && is_one_missing() && (agenda_.once || s_.executor.now() >= agenda_.rest_at);
  // A device with RAND also answers LSS while it has no node-ID: it is already found.
  const bool unheard = !any_by_rand || is_one_missing();
  bool wanted = std::exchange(rest_wanted_, false) && unheard;
  // A device that RAND found also answers LSS.
  const bool answers =
      std::ranges::any_of(found_.all(), [](const places::Found& f) { return !f.active.configured() && !f.clone; });
  const bool asks = others && anew && !due && !wanted && !answers && is_one_missing();
  if (asks) {
    wanted = co_await anybody_blank();
    rest_wanted_ = false;
  }
  if (others && (due || wanted)) co_await the_rest(due);
}

// A device that stays without a node-ID answers every poll: for a while this starts no search. Working devices that
// answer Fastscan with their node-IDs start none for a long time while no slot waits, because such a search takes long.
void Finder::searched() {
  const bool news = search_.has_news();
  const rt::Duration period = s_.bus.timing.probe_period;
  const rt::Time again = s_.executor.now() + (news ? rt::Duration{0} : 8 * period);
  const bool at_rest = by_fastscan_ && !news && !is_one_missing();
  const int pause = search_.has_slices_left() ? 31 : 256;
  scanned_at_ = at_rest ? s_.executor.now() + pause * period : again;
  if (!std::exchange(by_fastscan_, false)) blank_at_ = again;
}

rt::Task<void> Finder::by_rest(bool also_configured) {
  const bool at_rest = by_fastscan_ && !also_configured && !is_one_missing();
  bool ended = false;
  if (at_rest) {
    ended = co_await search_.by_slice();
  } else {
    ended = co_await search_.by_rest(also_configured);
  }
  if (ended) searched();
}

// A device may come from another plant as "identified": all become unknown, then those that sit here become identified
// again (S1.31). This is not repeated while the machine runs: a new device is unknown from power-on.
//
// These services are unconfirmed, and a device with a single receive buffer loses back-to-back frames: the first is
// sent twice, with pauses. A device that misses the second is found once more, which only costs time.
rt::Task<void> Finder::tell_which_are_known() {
  const rt::Duration apart = s_.bus.timing.rand_response;
  for (int time = 0; time < 2; ++time) {
    co_await rt::sleep_for(apart);
    const auto unknown = co_await tell_all_unknown(s_, agenda_, slots_.events());
    if (!unknown) co_return;
  }
  co_await rt::sleep_for(apart);
  for (auto& seat : slots_.seats()) {
    const bool known = seat->there() && seat->slot.record.confirmed;
    if (!known) continue;
    const LssAddress device = seat->slot.record.confirmed->device.address;
    const rt::Duration pause = s_.lss.options().inhibit;
    const auto told = co_await s_.rand.switch_selective(device, nodeid::Identification::identified, pause);
    if (!told) co_return;
  }
}

// Repeated as long as it finds devices and one is missing: a late device was not heard, and a found one does not answer
// again.
rt::Task<void> Finder::by_rand() {
  constexpr unsigned most_again = 4;
  std::size_t before = found_.size();
  if (!may_send_extended_frames(s_, agenda_)) co_return;
  co_await search_.by_rand();
  for (unsigned again = 0; again < most_again && found_.size() > before && is_one_missing(); ++again) {
    if (search_.rand_is_open()) co_return;
    before = found_.size();
    co_await search_.by_rand();
  }
}

// A device without a node-ID is found in a fraction of a second. A device with a node-ID is searched for among all
// serial numbers of the known types, which takes longer with each running device: only if a slot is still without a
// device.
rt::Task<void> Finder::the_rest(bool also_configured) {
  constexpr unsigned most_again = 4;
  const rt::Time began = s_.executor.now();
  // The previous search took too long to include devices with a node-ID: now it is their turn.
  if (also_configured && std::exchange(owes_configured_, false)) {
    co_await by_rest(true);
    agenda_.rest_at = s_.executor.now() + 8 * s_.bus.timing.probe_period;
    co_return;
  }
  std::size_t before = found_.size();
  co_await by_rest(false);
  // The search may miss a late device: it is repeated while it finds devices and one is missing.
  for (unsigned again = 0; again < most_again && found_.size() > before && is_one_missing(); ++again) {
    if (agenda_.search_open) co_return;
    before = found_.size();
    co_await by_rest(false);
  }
  if (!also_configured || agenda_.search_open) co_return;
  agenda_.rest_at = s_.executor.now() + 8 * s_.bus.timing.probe_period;
  // One long search at a time: events on the bus are handled after it.
  const bool took_long = s_.executor.now() - began > std::chrono::seconds(5);
  owes_configured_ = took_long && is_one_missing();
  if (!is_one_missing() || took_long) co_return;
  co_await by_rest(true);
}

// One is missing unless each slot without a device has a found device that fits, none counted twice. A device that
// waits for its power cycle is known, and a slot's own device fills no other slot.
bool Finder::is_one_missing() const {
  std::vector<bool> used(found_.size(), false);
  for (const auto& seat : slots_.seats()) {
    if (seat->is_accounted_for() || seat->slot.spec.assign != places::Assign::lss) continue;
    std::size_t i = 0;
    const auto here = [&](const places::Found& f) {
      const bool clone = f.clone || found_.is_clone(f.device);
      const Seat* const owner = slots_.of(f.device);
      return !clone && (owner == nullptr ? places::fits(seat->slot.spec, f.device) : owner == seat.get());
    };
    while (i < found_.size() && (used[i] || !here(found_.all()[i]))) ++i;
    if (i == found_.size()) return true;
    used[i] = true;
  }
  return false;
}

rt::Task<bool> Finder::anybody_new() {
  if (s_.only_observes()) co_return false;
  const bool by_rand = agenda_.method() == "auto" || agenda_.method() == "rand";
  if (by_rand && may_send_extended_frames(s_, agenda_)) {
    const bool any = co_await search_.anybody_by_rand();
    if (any || agenda_.method() == "rand") co_return any;
  }
  const bool due = ++looks_ % 8 == 0 || is_one_missing();
  if (!due) co_return false;
  co_return co_await anybody_blank();
}

// By LSS identify non-configured (4Ch), which CANopenNode's slaves do not support, and by Fastscan's first question.
// Lely core's slaves answer that with a node-ID too: if the search after it finds nothing, this starts no search for a
// while.
rt::Task<bool> Finder::anybody_blank() {
  lss::ServiceOptions options = s_.lss.options().identify;
  options.timeout = std::min<rt::Duration>(options.timeout, 2 * s_.bus.timing.rand_response);
  options.full_window = false;
  rest_wanted_ = false;
  if (s_.executor.now() >= blank_at_) {
    const auto heard = co_await s_.lss.identify_non_configured(options);
    rest_wanted_ = heard && heard->answers > 0;
  }
  if (is_one_missing()) scanned_at_ = std::min(scanned_at_, s_.executor.now() + 8 * s_.bus.timing.probe_period);
  if (!rest_wanted_ && s_.executor.now() >= scanned_at_) {
    const lss::FastscanRequest anybody;
    const auto heard = co_await s_.lss.fastscan(anybody, options);
    rest_wanted_ = heard && heard->answers > 0;
    by_fastscan_ = rest_wanted_;
  }
  co_return rest_wanted_;
}

void Finder::rest_from_searching() {
  const bool waits = std::ranges::any_of(
      found_.all(), [&](const places::Found& f) { return !f.active.configured() && slots_.of(f.device) == nullptr; });
  if (!waits) return;
  const rt::Time again = s_.executor.now() + 8 * s_.bus.timing.probe_period;
  blank_at_ = std::max(blank_at_, again);
  scanned_at_ = std::max(scanned_at_, again);
}

}  // namespace berth::operate

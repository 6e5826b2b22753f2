// Who is on the bus that no slot knows (paper 1 §III.b; S1.31), and what was found of whom.
#include <fmt/format.h>

#include <algorithm>

#include "berth/discovery/auto.hpp"
#include "berth/operate/network_seat.hpp"

namespace berth::operate {

using places::Action;

nodeid::DiscoveryOptions Network::discovery_options() const {
  nodeid::DiscoveryOptions o;
  o.t_resp = bus_->timing.rand_response;
  o.t_proc = bus_->timing.rand_processing;
  return o;
}

// First seen: its boot-up message when it has a node-ID, else the first answer that it gave.
void Network::note_found(const places::Found& found) {
  const auto [seen, fresh] = first_seen_.try_emplace(found.device, executor_->now());
  const auto booted = found.active.configured() ? boots_.boot_up(found.active) : std::nullopt;
  if (booted && !loans_.of_ours(found.active, *booted)) seen->second = std::min(seen->second, *booted);
  loans_.seen(found.device);
  if (found.clone && std::ranges::find(clones_, found.device) == clones_.end()) clones_.push_back(found.device);
  places::Found noted = found;
  noted.seen = seen->second;
  const auto it = std::ranges::find(found_, found.device, &places::Found::device);
  if (it == found_.end()) {
    found_.push_back(noted);
  } else {
    *it = noted;
  }
}

void Network::forget_found(const LssAddress& device) {
  std::erase_if(found_, [&](const places::Found& f) { return f.device == device; });
}

// A device may come from another plant as "identified": everybody becomes unknown, then those who sit here become
// identified again (S1.31). While the machine runs this is not repeated: who comes new is unknown from power-on.
//
// These services are unconfirmed, and a device with a single-slot receive buffer loses what comes back to back: the
// first is sent twice, with pauses. Whoever misses the second is found once more, which costs time and nothing else.
rt::Task<void> Network::tell_who_is_known() {
  const rt::Duration apart = bus_->timing.rand_response;
  for (int time = 0; time < 2; ++time) {
    co_await rt::sleep_for(apart);
    const auto everybody = co_await rand_.switch_global(nodeid::Identification::unknown);
    if (!everybody) co_return;
  }
  co_await rt::sleep_for(apart);
  for (auto& seat : seats_) {
    const bool known = seat->there && seat->slot.record.confirmed;
    if (!known) continue;
    const LssAddress device = seat->slot.record.confirmed->device;
    const rt::Duration pause = lss_.options().inhibit;
    const auto told = co_await rand_.switch_selective(device, nodeid::Identification::identified, pause);
    if (!told) co_return;
  }
}

// RAND is asked first and alone: it finds all who speak it in one go. The rest is asked for only when a slot is still
// without a device, or when somebody without a node-ID answered LSS. Never two schemes at once (S1.24).
rt::Task<void> Network::discover() {
  phase_ = Phase::discovery;
  if (rest_at_ == rt::Time{}) rest_at_ = executor_->now() + 2 * bus_->timing.probe_period;
  // Devices that wait without a seat are identified and would not answer: all are asked anew, who left is forgotten.
  const bool waiting = std::ranges::any_of(found_, [&](const auto& f) { return seat_of(f.device) == nullptr; });
  if (search_open_) co_return co_await go_on_searching();
  const bool by_rand = method() == "auto" || method() == "rand";
  const bool speaks_rand = by_rand || method() == "planner-rand";
  const bool anew = look_anew_ || waiting;
  if (anew) {
    look_anew_ = false;
    anew_at_ = executor_->now() + 8 * bus_->timing.probe_period;
    const auto goes = [&](const places::Found& f) { return f.clone || seat_of(f.device) == nullptr; };
    for (const auto& f : found_) {
      rest_wanted_ = rest_wanted_ || (goes(f) && std::ranges::find(by_rest_, f.device) != by_rest_.end());
      if (goes(f)) forget_readings(f.device);
      // No search finds it again when it speaks nothing that finds devices with a node-ID.
      if (goes(f) && f.active.configured() && !f.lent) look_again_at_[f.active.value()] = true;
    }
    std::erase_if(found_, goes);
    co_await ask_own_ids();
    if (speaks_rand) co_await tell_who_is_known();
  }
  known_before_ = std::exchange(heard_of_, {});
  news_ = false;
  if (by_rand) {
    const std::size_t before = found_.size();
    co_await discover_by_rand();
    const bool others = method() == "auto" && !alone_;
    const bool due = others && somebody_missing() && (once_ || executor_->now() >= rest_at_);
    // Who speaks RAND answers LSS too while it has no node-ID: it is found already.
    const bool unheard = found_.size() == before || somebody_missing();
    bool wanted = std::exchange(rest_wanted_, false) && unheard;
    // One that RAND found answers LSS too.
    const bool answers =
        std::ranges::any_of(found_, [](const places::Found& f) { return !f.active.configured() && !f.clone; });
    const bool asks = others && anew && !due && !wanted && !answers && somebody_missing();
    if (asks) {
      wanted = co_await anybody_blank();
      rest_wanted_ = false;
    }
    if (others && (due || wanted)) co_await discover_the_rest(due);
  } else {
    discovery::Discovery* const way = chosen();
    if (way != nullptr) co_await discover_by(*way);
  }
  if (anew) {
    std::erase_if(first_seen_, [&](const auto& seen) {
      return std::ranges::find(found_, seen.first, &places::Found::device) == found_.end();
    });
  }
}

// A search that had no end yet: whom it found is seated by now, as far as that was safe.
rt::Task<void> Network::go_on_searching() {
  search_open_ = false;
  known_before_ = std::exchange(heard_of_, {});
  news_ = false;
  if (method() == "auto") co_return co_await discover_by(rest(open_configured_));
  discovery::Discovery* const way = chosen();
  if (way != nullptr) co_await discover_by(*way);
}

// Who has no node-ID is found in a fraction of a second. Who has one is searched for among all numbers of the known
// types, which takes longer with each device that runs: only when a slot is without a device afterwards.
rt::Task<void> Network::discover_the_rest(bool also_configured) {
  constexpr unsigned most_again = 4;
  const rt::Time began = executor_->now();
  std::size_t before = found_.size();
  co_await discover_by(rest(false));
  // A device that was late once was not heard by that search: as long as it brings news, one is asked for that is
  // missing.
  for (unsigned again = 0; again < most_again && found_.size() > before && somebody_missing(); ++again) {
    if (search_open_) co_return;
    before = found_.size();
    co_await discover_by(rest(false));
  }
  if (!also_configured || search_open_) co_return;
  rest_at_ = executor_->now() + 8 * bus_->timing.probe_period;
  // One long search at a time: what happens on the bus meanwhile is dealt with behind it.
  const bool took_long = executor_->now() - began > std::chrono::seconds(5);
  if (!somebody_missing() || took_long) co_return;
  co_await discover_by(rest(true));
}

discovery::Auto& Network::rest(bool also_configured) {
  discovery::AutoOptions options = rest_->options();
  options.configured = open_configured_ = also_configured;
  rest_->set_options(options);
  return *rest_;
}

// Again as long as it brings news and one is missing: who was late was not heard, and who was found does not answer.
rt::Task<void> Network::discover_by_rand() {
  constexpr unsigned most_again = 4;
  std::size_t before = found_.size();
  co_await discover_by_rand_once();
  for (unsigned again = 0; again < most_again && found_.size() > before && somebody_missing(); ++again) {
    before = found_.size();
    co_await discover_by_rand_once();
  }
}

// As published only by name: the planner asks a fraction of it.
rt::Task<void> Network::discover_by_rand_once() {
  if (method() == "auto") co_return co_await discover_by_rand_planner();
  const nodeid::DiscoveryOptions options = discovery_options();
  nodeid::DiscoveryObserver* const watching = this;
  const auto report = co_await rand_.discover(options, watching);
  alone_ = !report && report.error().code == Errc::bus;
  if (!report) {
    tell_once("error", "discovery: " + describe(report.error()));
    co_return;
  }
  take_rand(discovery::report_of(*report));
}

rt::Task<Result<discovery::Report>> Network::search_by_rand_planner() {
  discovery::Known known = known_devices();
  known.registered.clear();  // one that answers though its address sits in a slot is a second device
  discovery::Options options = search_options();
  options.assigner = nullptr;  // who was found is identified and silent
  options.window = bus_->timing.rand_response;
  co_return co_await rand_planner_->find(known, options);
}

rt::Task<void> Network::discover_by_rand_planner() {
  const auto report = co_await search_by_rand_planner();
  alone_ = !report && report.error().code == Errc::bus;
  if (!report) {
    tell_once("error", "discovery: " + describe(report.error()));
    co_return;
  }
  for (const auto& d : report->found) tell_found(d.address, d.possible_clone);
  take_rand(*report);
}

rt::Task<void> Network::discover_by(discovery::Discovery& way) {
  const discovery::Known known = known_devices();
  const discovery::Options options = search_options();
  if (options.assigner != nullptr) co_await prepare_loans();
  progress_.told = {};
  const auto report = co_await way.find(known, options);
  // Whoever was found may still be in LSS configuration, where a planner leaves those who shall not answer again.
  const auto quiet = co_await lss_.switch_global(lss::State::waiting);
  if (!report || !quiet) {
    tell_once("error", "discovery: " + describe(report ? quiet.error() : report.error()));
    co_return;
  }
  alone_ = false;
  take_found(*report);
}

// ---- what a search is told ----

// A device that fits each slot without one, no device counted twice: else somebody is missing.
bool Network::somebody_missing() const {
  std::vector<bool> used(found_.size(), false);
  for (const auto& seat : seats_) {
    if (seat->there || seat->slot.spec.assign != places::Assign::lss) continue;
    const auto device = seat->slot.record.device();
    std::size_t i = 0;
    const auto here = [&](const places::Found& f) {
      const bool clone = f.clone || std::ranges::find(clones_, f.device) != clones_.end();
      return !clone && (device == f.device || places::fits(seat->slot.spec, f.device));
    };
    while (i < found_.size() && (used[i] || !here(found_[i]))) ++i;
    if (i == found_.size()) return true;
    used[i] = true;
  }
  return false;
}

discovery::Known Network::known_devices() const {
  discovery::Known known;
  const auto add = [&](const TypeCode& type, const std::optional<std::uint32_t>& revision) {
    const discovery::Kind kind{type, revision};
    if (std::ranges::find(known.kinds, kind) == known.kinds.end()) known.kinds.push_back(kind);
  };
  for (const auto& seat : seats_) {
    const auto& spec = seat->slot.spec;
    const bool exact = spec.rule == places::RevisionRule::exact;
    const auto revision = exact ? spec.revision : std::nullopt;
    add(spec.type, revision);
    for (const auto& other : spec.also) add(other.type, exact ? other.revision : std::nullopt);
    const auto device = seat->slot.record.device();
    if (device) (seat->there ? known.registered : known.expected).push_back(*device);
    if (device || !revision) continue;
    for (const auto serial : spec.spares) {
      known.expected.push_back({spec.type.vendor, spec.type.product, *revision, serial});
    }
  }
  for (const auto& f : found_) {
    if (std::ranges::find(known.registered, f.device) == known.registered.end()) known.registered.push_back(f.device);
  }
  return known;
}

discovery::Options Network::search_options() {
  discovery::Options options;
  const bool published = chosen_ != nullptr && !chosen_name_.starts_with("planner") && method() == chosen_name_;
  if (!published) options.window = bus_->timing.lss_timeout;
  // The longest frame of the bus: 8 bytes, 29 bits, every stuff bit there can be.
  options.blocking = std::chrono::nanoseconds(160'000'000'000LL / bus_->bitrate);
  // On a slow bus a window that is shorter saves nothing, and an answer that it misses costs several frames.
  options.shortest = std::max(options.shortest, options.blocking / 3);
  options.inhibit = lss_.options().inhibit;
  // Who is missed now is looked for again later, and the machine waits meanwhile: a lost heartbeat is seen behind it.
  options.retries = 2;
  // Longer than the way down to one device takes where frames need pauses: it begins again after a stop.
  options.most_time = std::chrono::seconds(20);
  options.observer = &progress_;
  // A device that was found leaves the search with a node-ID: in LSS configuration, where it would be silent, some
  // makers' devices answer everything, and Fastscan does not find the next one while this one answers.
  const bool by_requests_alone = method() == "rand" || method() == "planner-rand" || method() == "and";
  if (!by_requests_alone) options.assigner = this;
  options.confirm = published;
  return options;
}

discovery::Discovery* Network::chosen() {
  if (chosen_ != nullptr && chosen_name_ == method()) return chosen_.get();
  const auto way = discovery::method(method());
  if (!way) {
    tell_once("error", "there is no discovery method " + method());
    return nullptr;
  }
  chosen_ = discovery::make(*way, {dispatcher_, lss_});
  chosen_name_ = method();
  return chosen_.get();
}

// ---- what came of it ----

// The same devices found again and again, because they wait for a place, are told once.
void Network::tell_found(const LssAddress& device, bool clone) {
  heard_of_.push_back(device);
  if (std::ranges::find(known_before_, device) != known_before_.end()) return;
  news_ = true;
  tell("found", "", fmt::format("found {}{}", to_string(device), clone ? ", answered twice" : ""));
}

void Network::found(const nodeid::Discovered& device) noexcept { tell_found(device.address, device.possible_clone); }

// RAND tells no node-ID: what is known of it stays.
void Network::take_rand(const discovery::Report& report) {
  for (const auto& d : report.found) {
    const auto known = std::ranges::find(found_, d.address, &places::Found::device);
    note_found({d.address, known == found_.end() ? NodeId() : known->active, d.possible_clone});
  }
  tell_end(report);
}

void Network::take_found(const discovery::Report& report) {
  const bool told_before = std::exchange(news_, false);
  for (const auto& d : report.found) {
    if (std::ranges::find(by_rest_, d.address) == by_rest_.end()) by_rest_.push_back(d.address);
    tell_found(d.address, d.possible_clone);
    note_found({d.address, d.assigned.configured() ? d.assigned : d.active, d.possible_clone});
  }
  // Who stays without a node-ID answers every poll: that is no news for a while.
  const rt::Time again = executor_->now() + (news_ ? rt::Duration{0} : 8 * bus_->timing.probe_period);
  scanned_at_ = again;
  if (!std::exchange(by_fastscan_, false)) blank_at_ = again;
  using End = discovery::Report::End;
  search_open_ = report.end == End::more && gets_on();
  if (search_open_) tell_progress();
  tell_end(report);
  news_ = news_ || told_before;
}

void Network::tell_end(const discovery::Report& report) {
  using End = discovery::Report::End;
  if (report.end != End::complete && report.end != End::held && report.end != End::more) {
    tell_once("error",
              fmt::format("discovery ended early: {}; a device answers that cannot be identified", name(report.end)));
  }
  if (news_ && !report.found.empty()) {
    tell("step", "",
         fmt::format("discovery: {} found by {}, {} requests, {:.3f} s", report.found.size(),
                     name(report.found.front().by), report.requests, seconds(report.ended) - seconds(report.began)));
  }
  if (!report.found.empty()) reach("discovered");
}

// Devices that wait for their places without a node-ID answer every question: that is no news for a while.
void Network::rest_from_searching() {
  const bool waits = std::ranges::any_of(
      found_, [&](const places::Found& f) { return !f.active.configured() && seat_of(f.device) == nullptr; });
  if (!waits) return;
  const rt::Time again = executor_->now() + 8 * bus_->timing.probe_period;
  blank_at_ = std::max(blank_at_, again);
  scanned_at_ = std::max(scanned_at_, again);
}

// A device that answers and cannot be selected would hold a search for ever.
bool Network::gets_on() {
  constexpr unsigned most_idle = 2;
  const auto& now = progress_.last;
  const bool same = !news_ && now.kind == progress_.before.kind && now.swept == progress_.before.swept;
  progress_.idle = same ? progress_.idle + 1 : 0;
  progress_.before = now;
  if (progress_.idle < most_idle) return true;
  progress_.idle = 0;
  tell_once("error", "discovery ended early: a device answers to identify ranges that cannot be identified");
  return false;
}

// Not at every slice: a long search tells every ten seconds how far it is.
void Network::tell_progress() {
  if (executor_->now() < progress_at_) return;
  progress_at_ = executor_->now() + std::chrono::seconds(10);
  const auto& p = progress_.last;
  tell("step", "",
       fmt::format("searching on: {} found so far, type {} of {}, {:.0f} % of its serial numbers", found_.size(),
                   p.kind + 1, p.kinds, p.swept * 100));
}

namespace {

void take(Network::NewDevices& all, const discovery::Report& report) {
  all.found = report.found;
  all.complete = report.end == discovery::Report::End::complete;
  if (!all.complete) all.end = name(report.end);
}

}  // namespace

// For `berth scan` and `berth lss find`: no seat is thought of, nothing is remembered.
rt::Task<Result<Network::NewDevices>> Network::find_new() {
  NewDevices all;
  const bool by_rand = method() == "auto" || method() == "rand";
  const bool published = method() == "rand";
  if (by_rand) {
    const auto everybody = co_await rand_.switch_global(nodeid::Identification::unknown);
    if (!everybody) co_return fail(everybody.error());
  }
  if (by_rand && !published) {
    const auto report = co_await search_by_rand_planner();
    if (!report) co_return fail(report.error());
    take(all, *report);
  } else if (published) {
    const nodeid::DiscoveryOptions options = discovery_options();
    const auto found = co_await rand_.discover(options);
    if (!found) co_return fail(found.error());
    take(all, discovery::report_of(*found));
  }
  discovery::Discovery* const way = by_rand ? (method() == "auto" ? &rest(true) : nullptr) : chosen();
  if (way != nullptr) {
    discovery::Known known = known_devices();
    for (const auto& found : all.found) known.registered.push_back(found.address);
    discovery::Options options = search_options();
    co_await prepare_loans();
    auto end = discovery::Report::End::more;
    while (end == discovery::Report::End::more) {
      const auto report = co_await way->find(known, options);
      if (!report) co_await take_ids_back();
      if (!report) co_return fail(report.error());
      end = report->end;
      for (const auto& found : report->found) {
        all.found.push_back(found);
        known.registered.push_back(found.address);
      }
    }
    const auto quiet = co_await lss_.switch_global(lss::State::waiting);
    co_await take_ids_back();
    if (!quiet) co_return fail(quiet.error());
    const bool complete = end == discovery::Report::End::complete;
    if (!complete) all.end = name(end);
    all.complete = all.complete && complete;
  }
  co_return all;
}

// RAND tells no node-ID. Who will be bound is asked in its binding; the others must be known by the node-ID they hold,
// and so must bound devices that answered RAND: after a power-on they may be right where they belong.
rt::Task<void> Network::inquire_found(bool all) {
  const std::vector<places::Found> found = found_;
  for (const auto& f : found) {
    const Seat* seat = seat_of(f.device);
    const bool binds = std::ranges::any_of(plan_.actions, [&](const Action& a) { return a.device == f.device; });
    const bool asks = all || seat != nullptr || !binds;
    if (!asks || f.clone) continue;
    const auto id = co_await active_id(f.device);
    if (id) {
      const places::Found heard{f.device, *id, false};
      note_found(heard);
      co_await take_back(heard);
    } else if (id.error().code == Errc::duplicate) {
      note_found({f.device, f.active, true});
    } else if (seat == nullptr && id.error().code == Errc::timeout && !f.active.configured()) {
      forget_found(f.device);  // it left; who was found by its node-ID may speak no LSS
    }
  }
}

// A slot's own device under its own node-ID, whose boot-up nobody heard: it is checked and started like one that was.
rt::Task<void> Network::take_back(const places::Found& found) {
  const LssAddress device = found.device;
  Seat* const seat = seat_of(device);
  const bool home =
      seat != nullptr && seat->slot.record.confirmed && !seat->slot.record.asked && found.active == seat->id();
  if (!home) co_return;
  co_await ask_seat(*seat);
  if (seat->there) forget_found(device);
}

// One question a look: RAND's phase 0, which only those answer who are new. A device without RAND is heard by LSS, with
// one frame that all without a node-ID answer alike: at every look while a slot waits, else at every eighth.
rt::Task<bool> Network::anybody_new() {
  if (bus_->role == design::Role::observer) co_return false;
  const bool by_rand = method() == "auto" || method() == "rand";
  if (by_rand) {
    const nodeid::DiscoveryOptions options = discovery_options();
    const auto probe = co_await rand_.probe(options);
    const bool somebody = probe && probe->anybody;
    if (somebody || method() == "rand") co_return somebody;
  }
  const bool due = ++looks_ % 8 == 0 || somebody_missing();
  if (!due) co_return false;
  co_return co_await anybody_blank();
}

// By LSS identify non-configured (4Ch), which CANopenNode's slaves do not know, and by Fastscan's first question, which
// Lely core's answer with a node-ID too: that is no news for a while when the search after it brought none.
rt::Task<bool> Network::anybody_blank() {
  lss::ServiceOptions options = lss_.options().identify;
  options.timeout = std::min<rt::Duration>(options.timeout, 2 * bus_->timing.rand_response);
  options.full_window = false;
  rest_wanted_ = false;
  if (executor_->now() >= blank_at_) {
    const auto heard = co_await lss_.identify_non_configured(options);
    rest_wanted_ = heard && heard->answers > 0;
  }
  if (!rest_wanted_ && executor_->now() >= scanned_at_) {
    const lss::FastscanRequest anybody;
    const auto heard = co_await lss_.fastscan(anybody, options);
    rest_wanted_ = heard && heard->answers > 0;
    by_fastscan_ = rest_wanted_;
  }
  co_return rest_wanted_;
}

}  // namespace berth::operate

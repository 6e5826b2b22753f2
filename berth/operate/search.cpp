#include "berth/operate/search.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/operate/extended_frames.hpp"

namespace berth::operate {

namespace {

void take_into(NewDevices& all, const discovery::Report& report) {
  all.found = report.found;
  all.complete = report.end == discovery::Report::End::complete;
  if (!all.complete) all.end = name(report.end);
}

}  // namespace

Search::Search(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found, Lending& lending)
    : s_(services),
      slots_(slots),
      agenda_(agenda),
      found_(found),
      lending_(lending),
      methods_(services, slots, agenda, found, lending) {}

void Search::begin() {
  if (!unfinished_) known_before_ = std::exchange(heard_of_, {});
  news_ = false;
  pace_ = {.began = s_.executor.now(), .tell_at = pace_.tell_at};
}

// ---- the searches ----

rt::Task<void> Search::by_rand() {
  const bool plans = agenda_.method() == "auto";
  Result<discovery::Report> report = fail(Errc::invalid, "not asked");
  interruptible_since_ = s_.executor.now();
  if (plans) {
    report = co_await methods_.ask_rand_planner(this);
  } else {
    report = co_await methods_.ask_rand_as_published(this);
  }
  interruptible_since_.reset();
  agenda_.search_open = rand_open_ = report && report->end == discovery::Report::End::more;
  agenda_.alone = !report && report.error().code == Errc::bus;
  if (!report) {
    slots_.events().tell_failure("discovery", report.error());
    co_return;
  }
  for (const auto& d : report->found) {
    if (plans) tell_found(d.address, d.possible_clone);
    // RAND does not report a node-ID.
    const Identity device(d.address);
    if (d.possible_clone && has_equals(slots_, found_, device)) continue;  // they are known by their node-IDs
    const Identity known = d.possible_clone ? device : found_.one_for(device);
    found_.note({known, found_.active_of(known), d.possible_clone});
  }
  unfinished_ = rand_open_;
  if (!rand_open_) interruptions_.search_ended();
  tell_end(*report);
}

rt::Task<bool> Search::anybody_by_rand() {
  const nodeid::DiscoveryOptions how = methods_.rand_options();
  const auto probe = co_await s_.rand.any_unknown(how);
  co_return probe && probe->anybody;
}

rt::Task<bool> Search::by_rest(bool also_configured) {
  open_configured_ = also_configured;
  co_return co_await by(methods_.rest(also_configured));
}

rt::Task<bool> Search::by_slice() {
  constexpr unsigned questions = 20;
  constexpr bool also_configured = false;
  open_configured_ = also_configured;
  const bool ended = co_await by(methods_.rest(also_configured), questions);
  // A found device is news: the search goes on at once.
  slices_left_ = ended && agenda_.search_open && !news_;
  if (slices_left_) agenda_.search_open = false;
  co_return ended;
}

rt::Task<bool> Search::by_method() {
  discovery::Discovery* const way = methods_.chosen();
  if (way == nullptr) co_return false;
  co_return co_await by(*way);
}

// The devices found so far are seated, as far as that was safe.
rt::Task<bool> Search::go_on() {
  agenda_.search_open = false;
  const Pace pace = pace_;
  begin();
  pace_ = pace;
  const bool all = agenda_.method() == "auto";
  if (all) co_return co_await by_rest(open_configured_);
  co_return co_await by_method();
}

rt::Task<bool> Search::by(discovery::Discovery& way, unsigned slice) {
  const discovery::Known known = methods_.known_devices();
  discovery::Options how = methods_.options(this);
  sliced_ = slice > 0;
  how.slice = slice;
  if (how.assigner != nullptr) co_await lending_.prepare();
  lending_.forget_told();
  interrupted_ = false;
  interruptible_since_ = s_.executor.now();
  const auto report = co_await way.find(known, how);
  interruptible_since_.reset();
  // A found device may still be in LSS configuration, where a planner leaves devices that must not answer again.
  const auto quiet = co_await s_.lss.switch_global(lss::State::waiting);
  if (!report || !quiet) {
    slots_.events().tell_failure("discovery", report ? quiet.error() : report.error());
    co_return false;
  }
  agenda_.alone = false;
  take(*report);
  co_return true;
}

void Search::take(const discovery::Report& report) {
  news_ = false;
  for (const auto& d : report.found) {
    if (d.possible_clone && has_equals(slots_, found_, d.address)) continue;
    found_.note_without_rand(d.address);
    agenda_.out_of_lss.found(d.address);
    tell_found(d.address, d.possible_clone);
    found_.note({d.address, d.assigned.configured() ? d.assigned : d.active, d.possible_clone});
  }
  pace_.found += report.found.size();
  using End = discovery::Report::End;
  agenda_.search_open = report.end == End::more && (sliced_ || gets_on());
  unfinished_ = agenda_.search_open;
  if (agenda_.search_open && !sliced_) tell_progress();
  if (!agenda_.search_open) interruptions_.search_ended();
  if (!agenda_.search_open) advance_ = {};
  tell_end(report);
}

// A device that answers but cannot be selected would hold up a search forever.
bool Search::gets_on() {
  constexpr unsigned most_idle = 2;
  if (interrupted_) return true;
  const bool got_on = now_.is_beyond(advance_.furthest);
  if (got_on) advance_.furthest = now_;
  advance_.idle = got_on || news_ ? 0 : advance_.idle + 1;
  if (advance_.idle < most_idle) return true;
  slots_.events().tell_once(EventKind::error,
                            "discovery ended early: a device that cannot be identified answers identify ranges");
  return false;
}

bool Search::goes_on() noexcept {
  // Room for the way down to one device (133 questions) between any two interruptions.
  const rt::Duration way_down = std::max<rt::Duration>(std::chrono::seconds(5), 133 * s_.bus.timing.lss_timeout);
  const rt::Duration within = (Interruptions::most + 1) * way_down;
  if (!interruptible_since_) return true;
  const rt::Time now = s_.executor.now();
  // A short search ends sooner than it would begin anew.
  const bool takes_long = now >= *interruptible_since_ + std::chrono::seconds(1);
  const bool called = agenda_.calls || (agenda_.comes.any() && takes_long) || s_.turn.waited_for();
  if (!called || !interruptions_.allow(now, now_, within)) return true;
  interrupted_ = true;
  return false;
}

// ---- reports ----

void Search::found(const discovery::Found& device) noexcept {
  if (device.active.configured()) lending_.told(device.active);
}

void Search::found(const nodeid::Discovered& device) noexcept { tell_found(device.address, device.possible_clone); }

// Devices that are found repeatedly because they wait for a place are reported once.
void Search::tell_found(const Identity& device, bool clone) {
  heard_of_.push_back(device);
  if (std::ranges::find(known_before_, device) != known_before_.end()) return;
  news_ = true;
  slots_.events().tell(EventKind::found, "",
                       fmt::format("found {}{}", to_string(device), clone ? ", answered twice" : ""));
}

void Search::tell_end(const discovery::Report& report) {
  using End = discovery::Report::End;
  if (report.end != End::complete && report.end != End::held && report.end != End::more) {
    slots_.events().tell_once(
        EventKind::error,
        fmt::format("discovery ended early: {}; a device answers that cannot be identified", name(report.end)));
  }
  if (news_ && !report.found.empty()) {
    slots_.events().tell(
        EventKind::step, "",
        fmt::format("discovery: {} found by {}, {} requests, {:.3f} s", report.found.size(),
                    name(report.found.front().by), report.requests, seconds(report.ended) - seconds(report.began)));
  }
  if (!report.found.empty()) slots_.events().reach(Milestone::discovered);
}

// Not at every slice: a long search reports its progress every ten seconds.
void Search::tell_progress() {
  if (s_.executor.now() < pace_.tell_at) return;
  pace_.tell_at = s_.executor.now() + std::chrono::seconds(10);
  slots_.events().tell(EventKind::step, "",
                       fmt::format("searching on: {} found so far, type {} of {}, {:.0f} % of its serial numbers{}",
                                   found_.size(), now_.kind + 1, now_.kinds, now_.swept * 100, outlook()));
}

// Each device costs about the same number of questions, wherever its serial number is. The swept part of the serial
// numbers is no measure when they lie close together.
std::string Search::outlook() const {
  const auto empty = std::ranges::count_if(slots_.seats(), [](const auto& seat) {
    return !seat->is_accounted_for() && seat->slot.spec.assign == places::Assign::lss;
  });
  const auto open = empty - static_cast<std::ptrdiff_t>(found_.size());
  if (pace_.found == 0 || open <= 0) return "";
  const double each = (seconds(s_.executor.now()) - seconds(pace_.began)) / static_cast<double>(pace_.found);
  return fmt::format("; at this pace {} more devices take about {:.0f} s", open, each * static_cast<double>(open));
}

// ---- a search that only reports ----

rt::Task<Result<NewDevices>> Search::find_new() {
  NewDevices all;
  const bool by_planner = agenda_.method() == "auto";
  const bool published = agenda_.method() == "rand";
  bool asks_rand = (by_planner || published) && may_send_extended_frames(s_, agenda_);
  if (asks_rand) {
    const auto told = co_await tell_all_unknown(s_, agenda_, slots_.events());
    asks_rand = told.has_value();
    if (!asks_rand && may_send_extended_frames(s_, agenda_)) co_return fail(told.error());
  }
  if (asks_rand) {
    Result<discovery::Report> report = fail(Errc::invalid, "not asked");
    if (by_planner) {
      report = co_await methods_.ask_rand_planner(this);
    } else {
      report = co_await methods_.ask_rand_as_published(nullptr);
    }
    if (!report) co_return fail(report.error());
    take_into(all, *report);
  }
  discovery::Discovery* const way = by_planner ? &methods_.rest(true) : (published ? nullptr : methods_.chosen());
  if (way == nullptr) co_return all;
  const auto rested = co_await find_the_rest(*way, all);
  if (!rested) co_return fail(rested.error());
  co_return all;
}

rt::Task<Result<void>> Search::find_the_rest(discovery::Discovery& way, NewDevices& all) {
  discovery::Known known = methods_.known_devices();
  for (const auto& found : all.found) known.registered.push_back(found.address);
  const discovery::Options how = methods_.options(this);
  co_await lending_.prepare();
  auto end = discovery::Report::End::more;
  while (end == discovery::Report::End::more) {
    const auto report = co_await way.find(known, how);
    if (!report) co_await lending_.take_back_all();
    if (!report) co_return fail(report.error());
    end = report->end;
    for (const auto& found : report->found) {
      all.found.push_back(found);
      known.registered.push_back(found.address);
    }
  }
  const auto quiet = co_await s_.lss.switch_global(lss::State::waiting);
  co_await lending_.take_back_all();
  if (!quiet) co_return fail(quiet.error());
  const bool complete = end == discovery::Report::End::complete;
  if (!complete) all.end = name(end);
  all.complete = all.complete && complete;
  co_return Result<void>{};
}

}  // namespace berth::operate

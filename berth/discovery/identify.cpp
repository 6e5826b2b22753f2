#include "berth/discovery/identify.hpp"

#include "berth/discovery/identify_parts.hpp"

namespace berth::discovery {

// ---- questions --------------------------------------------------------------------------------------------------

rt::Task<Result<bool>> Identify::ask(Run& run, const Cursor& cursor, Box box, Window window) {
  const lss::IdentifyRanges ranges{.vendor = cursor.kind.type.vendor,
                                   .product = cursor.kind.type.product,
                                   .revision_low = box.revision_low,
                                   .revision_high = box.revision_high,
                                   .serial_low = box.serial_low,
                                   .serial_high = box.serial_high};
  const bool alone = run.alone >= enough_alone && run.care != Run::Care::most;
  const bool wary = window == Window::quick && run.care != Run::Care::none && !alone;
  if (wary) window = Window::patient;
  if (run.slow) window = Window::bound;
  // An answer after the window counts for no range of the next question: the six frames of that question come in
  // between.
  const lss::ServiceOptions service{.timeout = window_of(run, window), .retries = 0, .full_window = !alone};
  ++run.report.requests;
  const auto reply = co_await services_.lss.identify_remote(ranges, service);
  if (!reply) co_return fail(reply.error());
  if (reply->answers > 0) {
    // Fast devices that were met earlier do not show how slow this one is: all its halves would seem empty.
    const rt::Duration took = reply->heard_at[0] - reply->sent;
    run.slow = run.slow || (window == Window::bound && took > window_of(run, Window::patient));
    latency_.note(took);
    if (window != Window::quick) patience_.note(took);
    run.alone = reply->answers == 1 ? run.alone + 1 : 0;
  }
  if (window != Window::bound) run.haste_until = reply->sent + run.longest();
  run.late_yes = reply->stale > 0;
  run.look_at_the_time(services_.dispatcher.executor().now());
  co_return reply->answers > 0;
}

// A sample includes the frame of the answer.
rt::Duration Identify::window_of(const Run& run, Window window) const {
  const rt::Duration shortest = run.options.shortest;
  const rt::Duration longest = run.longest();
  rt::Duration response = longest;
  if (window == Window::quick) response = latency_.response(shortest, longest);
  if (window == Window::patient) response = patience_.response(shortest, longest);
  return std::min(response + run.options.blocking, longest);
}

rt::Task<Result<bool>> Identify::anybody(const Options& options) {
  const rt::Duration window = options.window.count() > 0 ? options.window : identify_window;
  const lss::ServiceOptions service{.timeout = window + options.blocking, .retries = 0, .full_window = false};
  const auto reply = co_await services_.lss.identify_non_configured(service);
  if (!reply) co_return fail(reply.error());
  co_return reply->answers > 0;
}

rt::Task<Result<bool>> Identify::blank_left(Run& run) {
  const lss::ServiceOptions service{.timeout = run.longest(), .retries = 1, .full_window = false};
  ++run.report.requests;
  const auto reply = co_await services_.lss.identify_non_configured(service);
  if (!reply) co_return fail(reply.error());
  run.no_blank = reply->answers == 0;
  co_return reply->answers > 0;
}

// ---- one device -------------------------------------------------------------------------------------------------

// The device that is left must prove its address itself.
rt::Task<Result<Identify::Sweep>> Identify::proven(Run& run, Cursor& cursor, LssAddress device, bool guess) {
  lss::AloneOptions how{
      .parts = parts_that_tell(device, run.known, run.report), .longest = run.longest(), .guess = guess};
  how.followed = !services_.lss.lacks().has(device, lss::Lackable::inquire_node_id);
  auto alone = co_await lss::select_alone(services_.lss, device, how);
  if (alone && *alone == lss::Selection::not_alone) {
    // By now, any device that was left in configuration is back in waiting.
    how.guess = false;
    alone = co_await lss::select_alone(services_.lss, device, how);
  }
  if (!alone) co_return fail(alone.error());
  run.look_at_the_time(services_.dispatcher.executor().now());
  const bool clones = *alone == lss::Selection::clones;
  if (*alone != lss::Selection::alone && !clones) {
    if (guess && *alone == lss::Selection::absent) co_return Sweep::nobody;
    run.failed();
    co_return Sweep::unproven;
  }
  Found found{.address = device, .at = {}, .active = {}, .assigned = {}, .by = Method::identify};
  found.possible_clone = clones;
  found.at = services_.dispatcher.executor().now();
  if (!clones) {
    const auto settled = co_await settle(run, found, how);
    if (!settled) co_return fail(settled.error());
  }
  run.unproven = 0;
  run.report.known = found.at;
  run.report.found.push_back(found);
  std::erase(cursor.revisions, device.revision);
  cursor.revisions.insert(cursor.revisions.begin(), device.revision);
  if (run.options.observer != nullptr) run.options.observer->found(found);
  co_return Sweep::found;
}

// The device reports its node-ID, gets one if it has none, and goes back to waiting.
rt::Task<Result<void>> Identify::settle(Run& run, Found& found, const lss::AloneOptions& how) {
  const lss::ServiceOptions service{
      .timeout = run.longest(), .retries = 1, .full_window = false, .listen = lss::window_of(services_.lss, how)};
  const auto told = co_await lss::ask_node_id(services_.lss, found.address, service);
  // A device in configuration that missed the proof may have heard this question, and would hear the 11h.
  const bool others = told && told->has_value() && lss::suspicious(**told);
  if (others) services_.lss.suspect_strangers();
  const bool tells = told && told->has_value() && !others;
  if (tells) found.active = NodeId::make((*told)->byte()).value_or(NodeId());
  NodeId id;
  const bool blank = tells && !found.active.configured();
  if (blank && run.options.assigner != nullptr) id = run.options.assigner->assign(found.address, blank);
  if (id.configured()) {
    const LssAddress device = found.address;
    lss::AloneOptions watched = how;
    watched.vacancy = run.options.assigner;
    const auto given = co_await lss::configure_alone(services_.lss, device, id, run.options.store, watched);
    if (!given) co_return fail(given.error());
    if (given->outcome == lss::Given::Outcome::taken) found.assigned = id;
  } else {
    const auto waiting = co_await services_.lss.switch_global(lss::State::waiting);
    if (!waiting) co_return fail(waiting.error());
  }
  co_return Result<void>{};
}

// The revisions of the devices that were found, the last one first, then those of known devices.
std::vector<std::uint32_t> Identify::likely_revisions(const Run& run, const Cursor& cursor) {
  std::vector<std::uint32_t> seen = cursor.revisions;
  for (const LssAddress& a : run.known.registered) {
    const bool fresh = a.type() == cursor.kind.type && std::ranges::find(seen, a.revision) == seen.end();
    if (fresh) seen.push_back(a.revision);
  }
  return seen;
}

// One serial number is left, but its revision may be open: revisions that were seen are likely.
rt::Task<Result<Identify::Sweep>> Identify::device_in(Run& run, Cursor& cursor, Box box) {
  const TypeCode type = cursor.kind.type;
  if (!box.single()) {
    const std::vector<std::uint32_t> seen = likely_revisions(run, cursor);
    constexpr std::size_t most_tried = 3;
    for (std::size_t i = 0; i < std::min(seen.size(), most_tried); ++i) {
      if (!box.contains({seen[i], box.serial_low})) continue;
      const LssAddress device{type.vendor, type.product, seen[i], box.serial_low};
      const auto tried = co_await proven(run, cursor, device, true);
      if (!tried) co_return fail(tried.error());
      if (*tried != Sweep::nobody || run.over()) co_return *tried;
    }
    const auto left = co_await descend(run, cursor, box);
    if (!left) co_return fail(left.error());
    if (!*left) co_return Sweep::nobody;
    box = **left;
  }
  const LssAddress device{type.vendor, type.product, box.revision_low, box.serial_low};
  const auto there = co_await proven(run, cursor, device, false);
  if (!there) co_return fail(there.error());
  if (*there == Sweep::unproven) run.passed.push_back(device.r_sn());
  co_return *there;
}

// ---- the search -------------------------------------------------------------------------------------------------

std::vector<Identify::Cursor> Identify::begin(const Known& known) {
  std::vector<Kind> kinds = known.kinds;
  for (const auto& a : known.expected) kinds.push_back({a.type(), a.revision});
  std::vector<Cursor> cursors;
  for (const Kind& kind : kinds) {
    if (std::ranges::find(cursors, kind, &Cursor::kind) != cursors.end()) continue;
    Cursor cursor{.kind = kind};
    if (kind.revision) cursor.revisions = {*kind.revision};
    cursors.push_back(cursor);
  }
  // The rest of a search that was broken off is used as long as the wanted kinds are the same.
  const bool same = std::ranges::equal(cursors, cursors_, {}, &Cursor::kind, &Cursor::kind);
  slowly_ = same && slowly_;
  if (!same) {
    latency_.forget();  // measured on other devices: those that come now may be slower
    patience_ = {};
  }
  return same ? std::exchange(cursors_, {}) : cursors;
}

// Searches one kind. False: it did not become quiet.
rt::Task<Result<bool>> Identify::one_kind(Run& run, Cursor& cursor, Pauses& pace) {
  if (cursor.next == 0 && run.known_of(cursor.kind).empty()) {
    const Box all = box_of(cursor.kind, 0, all_serials);
    const auto anybody = co_await ask(run, cursor, all, Window::bound);
    if (!anybody) co_return fail(anybody.error());
    if (!*anybody && !run.stopped) {
      cursor.next = all_serials;
      cursor.closed = true;
    }
  }
  const auto swept = co_await sweep(run, cursor, all_serials);
  if (!swept) co_return fail(swept.error());
  run.tell(cursor.next, cursor.quiet.size());
  const bool quick = !run.options.configured && !run.over() && !cursor.closed;
  if (quick) {
    const auto left = co_await blank_left(run);
    if (!left) co_return fail(left.error());
  }
  for (unsigned fruitless = 0; !cursor.closed && !run.over();) {
    const auto before = run.report.found.size();
    run.passed.clear();
    const auto quiet = co_await close(run, cursor);
    if (!quiet) co_return fail(quiet.error());
    if (run.over()) break;
    cursor.closed = *quiet;
    if (*quiet || run.report.found.size() > before) continue;
    ++run.report.restarts;
    run.care = Run::Care::most;
    cursor.quiet.clear();
    if (fruitless > 0) pace.slow_down();
    if (++fruitless > run.options.retries) co_return false;
  }
  co_return !run.untrusted;
}

// False: one kind did not become quiet.
rt::Task<Result<bool>> Identify::all_kinds(Run& run, std::vector<Cursor>& cursors, Pauses& pace) {
  bool quiet = true;
  for (std::size_t k = 0; k < cursors.size(); ++k) {
    run.kind = k;
    run.unproven = 0;
    run.untrusted = false;
    run.slow = false;
    run.care = run.haste.pays() ? Run::Care::none : Run::Care::wary;
    run.passed.clear();
    if (cursors[k].closed || run.over()) continue;
    const auto done = co_await one_kind(run, cursors[k], pace);
    if (!done) co_return fail(done.error());
    quiet = quiet && *done;
  }
  co_return quiet;
}

// A device with a receive buffer of one frame answers 4Ch, which is one frame, but no request of six consecutive
// frames.
rt::Task<Result<bool>> Identify::slowly(Run& run, std::vector<Cursor>& cursors, Pauses& pace) {
  const auto left = co_await blank_left(run);
  if (!left) co_return fail(left.error());
  if (!*left) co_return true;
  pace.slow_down();
  run.again = true;
  for (Cursor& cursor : cursors) {
    cursor.closed = false;
    cursor.quiet.clear();
  }
  const auto quiet = co_await all_kinds(run, cursors, pace);
  co_return quiet;
}

rt::Task<Result<Report>> Identify::find(const Known& known, const Options& options) {
  if (busy_) co_return fail(Errc::invalid, "another search by identify ranges is under way");
  const Busy busy(busy_);
  Pauses pace(services_.lss);
  Run run{.known = known, .options = options};
  const auto rate = services_.dispatcher.port().status().bit_rate;
  if (rate > 0) run.frame = rt::Duration(identify_bits * 1'000'000'000 / rate);
  run.report.began = services_.dispatcher.executor().now();
  run.report.known = run.report.began;
  services_.lss.suspect_strangers();
  const auto waiting = co_await services_.lss.switch_global(lss::State::waiting);
  if (!waiting) co_return fail(waiting.error());
  std::vector<Cursor> cursors = begin(known);
  run.kinds = cursors.size();
  run.again = slowly_;
  if (run.again) pace.slow_down();
  auto quiet = co_await all_kinds(run, cursors, pace);
  if (!quiet) co_return fail(quiet.error());
  const bool unheard = *quiet && !run.over() && !run.again;
  if (unheard) {
    quiet = co_await slowly(run, cursors, pace);
    if (!quiet) co_return fail(quiet.error());
  }
  const bool gave_up = !*quiet;
  using End = Report::End;
  run.report.end = run.stopped ? End::more : gave_up ? End::gave_up : run.full() ? End::limit : End::complete;
  if (run.stopped) cursors_ = std::move(cursors);
  slowly_ = run.stopped && run.again;
  run.report.ended = services_.dispatcher.executor().now();
  co_return run.report;
}

}  // namespace berth::discovery

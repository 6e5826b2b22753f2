#include "berth/discovery/identify.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "berth/discovery/busy.hpp"
#include "berth/discovery/by_name.hpp"

namespace berth::discovery {
namespace {
constexpr rt::Duration default_window = std::chrono::milliseconds(10);
constexpr std::int64_t answer_bits = 126;
constexpr std::uint64_t all_serials = std::uint64_t{1} << 32;
constexpr std::uint64_t first_width = 256;
constexpr std::uint64_t least_width = 16;
constexpr std::uint64_t widens = 8;  // times, after silence
// Halves that were not asked because the other half was silent: after so many in a row the next one is asked, so that
// a question that a device did not hear is not followed down to the last bit.
constexpr unsigned most_assumed = 6;
constexpr unsigned most_back = 2;
constexpr unsigned most_unproven = 4;  // in a row, and the retries
constexpr unsigned enough_alone = 3;
// A device with a small receive buffer loses some of six frames back to back.
constexpr rt::Duration slow_inhibit = std::chrono::milliseconds(10);

Box box_of(const Kind& kind, std::uint64_t low, std::uint64_t end) noexcept {
  Box box{.serial_low = static_cast<std::uint32_t>(low), .serial_high = static_cast<std::uint32_t>(end - 1)};
  if (kind.revision) box.revision_low = box.revision_high = *kind.revision;
  return box;
}
}  // namespace

// Pauses between the frames for as long as a search lasts, once one fruitless pass was no accident.
class Identify::Pace {
 public:
  explicit Pace(lss::Master& lss) : lss_(&lss), before_(lss.options()) {}
  ~Pace() { lss_->set_options(before_); }
  Pace(const Pace&) = delete;
  Pace& operator=(const Pace&) = delete;
  void slow_down() {
    lss::MasterOptions slower = before_;
    slower.inhibit = std::max(slower.inhibit, slow_inhibit);
    lss_->set_options(slower);
  }

 private:
  lss::Master* lss_;
  lss::MasterOptions before_;
};

// The way down to one device.
struct Identify::Descent {
  Box box;
  Box answered;                 // the last range that was: `box`, or around it
  std::optional<Box> silent{};  // the last half that was taken for empty
  unsigned assumed = 0;         // halves in a row that were not asked
  unsigned back = 0;            // times that the way ended in silence, since it got on

  void go_on(const Box& heard) noexcept {
    if (heard != answered) back = 0;
    box = answered = heard;
    assumed = 0;
  }
  // False: too often, or in haste, of which less comes first; to come to one serial number again takes long.
  bool go_back(const Run& run) noexcept;
};

struct Identify::Run {
  const Known& known;
  const Options& options;
  rt::Duration frame{0};
  Report report{};
  std::size_t kind = 0;
  std::size_t kinds = 0;
  unsigned unproven = 0;  // in a row
  // How far haste has led nowhere. `wary`: patient, until one device is left; what it answers late is found out within
  // a few questions. `most`: to the end.
  enum class Care : std::uint8_t { none, wary, most };
  Care care = Care::none;
  unsigned alone = 0;  // ranges in a row, each in the one before, that got one answer
  Haste haste{};
  bool late_yes = false;         // the question before the last was answered after all
  bool stopped = false;          // time is over, or the observer said so
  bool no_blank = false;         // no device without a node-ID is left, and no other is wanted
  bool untrusted = false;        // a device answers whatever is asked
  std::optional<Box> left_at{};  // a device is in there, and the search was stopped
  std::vector<R_SN> passed{};    // answered for, and not proven, in this pass

  [[nodiscard]] rt::Duration longest() const noexcept {
    return (options.window.count() > 0 ? options.window : default_window) + frame + options.blocking;
  }
  [[nodiscard]] std::vector<R_SN> known_of(const Kind& kind_) const {
    std::vector<R_SN> result = passed;
    const auto add = [&](const LssAddress& a) {
      if (a.type() == kind_.type && (!kind_.revision || a.revision == *kind_.revision)) result.push_back(a.r_sn());
    };
    for (const auto& a : known.registered) add(a);
    for (const auto& d : report.found) add(d.address);
    return result;
  }
  [[nodiscard]] std::uint64_t next_known(const Kind& kind_, std::uint64_t from) const {
    std::uint64_t next = all_serials;
    for (const R_SN& n : known_of(kind_)) {
      if (n.serial >= from) next = std::min<std::uint64_t>(next, n.serial);
    }
    return next;
  }
  [[nodiscard]] bool full() const noexcept { return report.found.size() >= options.most_devices; }
  [[nodiscard]] bool over() const noexcept { return stopped || no_blank || untrusted || full(); }
  void tell(std::uint64_t swept) const {
    if (options.observer == nullptr) return;
    options.observer->progress({.kind = kind,
                                .kinds = kinds,
                                .swept = static_cast<double>(swept) / static_cast<double>(all_serials),
                                .found = report.found.size()});
  }
  // Between two requests, with no device in configuration.
  void look_at_the_time(rt::Time now) {
    if (options.most_time.count() > 0 && now - report.began > options.most_time) stopped = true;
    if (options.observer != nullptr && !options.observer->goes_on()) stopped = true;
  }
  void more_care() {
    if (care == Care::none) haste.note(false);
    care = care == Care::none ? Care::wary : Care::most;
  }
  // A device was found.
  void less_care() {
    if (care == Care::none) haste.note(true);
    care = haste.pays() ? Care::none : Care::wary;
  }
  void failed() {
    more_care();
    ++report.unproven;
    if (++unproven > options.retries + most_unproven) untrusted = true;
  }
};

bool Identify::Descent::go_back(const Run& run) noexcept {
  box = answered;
  silent.reset();
  assumed = 0;
  const bool by_revision = box.serial_low == box.serial_high;
  return (run.care != Run::Care::none || by_revision) && ++back <= most_back;
}

// ---- questions --------------------------------------------------------------------------------------------------

rt::Task<Result<bool>> Identify::ask(Run& run, const Cursor& cursor, Box box, bool patient) {
  const lss::IdentifyRanges ranges{.vendor = cursor.kind.type.vendor,
                                   .product = cursor.kind.type.product,
                                   .revision_low = box.revision_low,
                                   .revision_high = box.revision_high,
                                   .serial_low = box.serial_low,
                                   .serial_high = box.serial_high};
  const bool alone = run.alone >= enough_alone && run.care != Run::Care::most;
  const bool whole = patient || (run.care != Run::Care::none && !alone);
  // What comes later still belongs to no range of the next question: six frames lie between.
  const lss::ServiceOptions service{.timeout = window_of(run, whole), .retries = 0, .full_window = !alone};
  ++run.report.requests;
  const auto reply = co_await services_.lss.identify_remote(ranges, service);
  if (!reply) co_return fail(reply.error());
  if (reply->answers > 0) {
    latency_.note(reply->heard_at[0] - reply->sent);
    if (whole) patience_.note(reply->heard_at[0] - reply->sent);
    run.alone = reply->answers == 1 ? run.alone + 1 : 0;
  }
  run.late_yes = reply->stale > 0;
  run.look_at_the_time(services_.dispatcher.executor().now());
  co_return reply->answers > 0;
}

// A sample holds the answer's frame.
rt::Duration Identify::window_of(const Run& run, bool whole) const {
  const rt::Duration shortest = run.options.shortest;
  const rt::Duration longest = run.longest();
  const auto response = whole ? patience_.response(shortest, longest) : latency_.response(shortest, longest);
  return std::min(response + run.options.blocking, longest);
}

rt::Task<Result<bool>> Identify::anybody(const Options& options) {
  const rt::Duration window = options.window.count() > 0 ? options.window : default_window;
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

// The device that is left must answer for itself.
rt::Task<Result<Identify::Sweep>> Identify::proven(Run& run, Cursor& cursor, LssAddress device, bool guess) {
  lss::AloneOptions how{
      .parts = parts_that_tell(device, run.known, run.report), .longest = run.longest(), .guess = guess};
  auto alone = co_await lss::select_alone(services_.lss, device, how);
  if (alone && *alone == lss::Selection::not_alone) {
    // A device that was left in configuration has been told to wait meanwhile.
    how.guess = false;
    alone = co_await lss::select_alone(services_.lss, device, how);
  }
  if (!alone) co_return fail(alone.error());
  run.look_at_the_time(services_.dispatcher.executor().now());
  const bool twins = *alone == lss::Selection::twins;
  if (*alone != lss::Selection::alone && !twins) {
    if (guess && *alone == lss::Selection::absent) co_return Sweep::nobody;
    run.failed();
    co_return Sweep::unproven;
  }
  Found found{.address = device, .at = {}, .active = {}, .assigned = {}, .by = Method::identify};
  found.possible_clone = twins;
  found.at = services_.dispatcher.executor().now();
  if (!twins) {
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

// It tells its node-ID, gets one when it has none, and goes back to waiting.
rt::Task<Result<void>> Identify::settle(Run& run, Found& found, const lss::AloneOptions& how) {
  const lss::ServiceOptions service{.timeout = run.longest(), .retries = 1, .full_window = false};
  const auto told = co_await services_.lss.inquire_node_id(service);
  if (told) found.active = NodeId::make(told->byte()).value_or(NodeId());
  NodeId id;
  const bool blank = told && !found.active.configured();
  if (blank && run.options.assigner != nullptr) id = run.options.assigner->assign(found.address);
  if (id.configured()) {
    const LssAddress device = found.address;
    const auto given = co_await lss::configure_alone(services_.lss, device, id, run.options.store, how);
    if (!given) co_return fail(given.error());
    if (given->outcome == lss::Given::Outcome::taken) found.assigned = id;
  } else {
    const auto waiting = co_await services_.lss.switch_global(lss::State::waiting);
    if (!waiting) co_return fail(waiting.error());
  }
  co_return Result<void>{};
}

// Those that were found, the last one first, and those of the devices that are known.
std::vector<std::uint32_t> Identify::likely_revisions(const Run& run, const Cursor& cursor) {
  std::vector<std::uint32_t> seen = cursor.revisions;
  for (const LssAddress& a : run.known.registered) {
    const bool fresh = a.type() == cursor.kind.type && std::ranges::find(seen, a.revision) == seen.end();
    if (fresh) seen.push_back(a.revision);
  }
  return seen;
}

// One serial number is left; its revision may be open: those that were seen are likely.
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

// ---- ranges -----------------------------------------------------------------------------------------------------

// The half that answers, of one device alone: its silence may be lateness, so the other half has to answer then.
rt::Task<Result<std::optional<Box>>> Identify::surely(Run& run, const Cursor& cursor, Box box) {
  const std::array<Box, 2> halves{box.lower(), box.upper()};
  std::optional<Box> result;
  for (const bool patient : {false, true}) {
    // The late answer belongs to one of both, and says nothing.
    if (patient && !result) co_await rt::sleep_for(window_of(run, true));
    for (std::size_t i = 0; i < halves.size() && !result && !run.stopped; ++i) {
      const auto heard = co_await ask(run, cursor, halves[i], patient);
      if (!heard) co_return fail(heard.error());
      if (*heard) result = halves[i];
    }
  }
  run.alone = enough_alone;
  co_return result;
}

// A device is in the box: the lowest there, down to one serial number, or one revision when the serial number is known.
// Where the way ends in silence it goes back to the last range that was answered: a device that loses one question of
// twenty would never be reached from the top. Empty: no device is there any more, or none ever was.
rt::Task<Result<std::optional<Box>>> Identify::descend(Run& run, const Cursor& cursor, Box box) {
  const bool by_serial = box.serial_low != box.serial_high;
  run.alone = by_serial ? 0 : enough_alone;
  Descent way{.box = box, .answered = box};
  const auto arrived = [&] { return by_serial ? way.box.serial_low == way.box.serial_high : way.box.single(); };
  std::optional<Box> result;
  while (!arrived() || (way.assumed > 0 && (way.back > 0 || run.care == Run::Care::most))) {
    const bool sure = run.care == Run::Care::wary && run.alone >= enough_alone && !arrived();
    bool on = false;
    if (sure) {
      const auto half = co_await surely(run, cursor, way.box);
      if (!half) co_return fail(half.error());
      on = *half || way.go_back(run);
      if (*half) way.go_on(**half);
    } else {
      const auto heard = co_await step(run, cursor, way, arrived());
      if (!heard) co_return fail(heard.error());
      on = *heard;
    }
    if (run.stopped && by_serial) run.left_at = way.answered;
    if (run.stopped || !on) co_return result;
  }
  result = way.box;
  co_return result;
}

// One question on the way down. False: nothing is there, however often it is asked.
rt::Task<Result<bool>> Identify::step(Run& run, const Cursor& cursor, Descent& way, bool arrived) {
  const bool check = arrived || way.assumed >= most_assumed;
  const Box asked = check ? way.box : way.box.lower();
  const bool patient = check || way.back > 0;
  const auto heard = co_await ask(run, cursor, asked, patient);
  if (!heard) co_return fail(heard.error());
  if (run.stopped) co_return true;
  if (run.late_yes && way.silent) {  // it was not empty, only slow
    way.box = *std::exchange(way.silent, std::nullopt);
    way.assumed = 0;
    co_return true;
  }
  way.silent.reset();
  if (*heard) {
    way.go_on(asked);
  } else if (check) {
    co_return way.go_back(run);
  } else {
    way.silent = asked;
    way.box = way.box.upper();
    ++way.assumed;
  }
  co_return true;
}

rt::Task<Result<void>> Identify::lowest_in(Run& run, Cursor& cursor, Box box) {
  const Run::Care before = run.care;
  const auto left = co_await descend(run, cursor, box);
  if (!left) co_return fail(left.error());
  cursor.open = std::exchange(run.left_at, std::nullopt);
  if (run.over()) co_return Result<void>{};
  if (!*left) {
    run.more_care();
    if (before != Run::Care::none) patience_.renew();
    // Asked again, with more patience; then the closing questions will find what is there.
    if (before == Run::Care::most) cursor.next = std::uint64_t{box.serial_high} + 1;
    co_return Result<void>{};
  }
  const Box one = **left;
  const auto there = co_await device_in(run, cursor, one);
  if (!there) co_return fail(there.error());
  if (run.stopped && *there != Sweep::found) co_return Result<void>{};
  cursor.next = std::uint64_t{one.serial_low} + 1;
  if (*there != Sweep::found) co_return Result<void>{};
  run.less_care();
  const std::uint64_t apart = one.serial_low - std::uint64_t{cursor.last};
  if (cursor.any) {
    cursor.apart = cursor.apart == 0 ? apart : (cursor.apart + apart) / 2;
    // A hole in a row does not end it.
    const bool hole = cursor.row >= 2 && apart % cursor.stride == 0;
    if (!hole) cursor.row = 0;
    if (!hole) cursor.stride = static_cast<std::uint32_t>(apart);
    cursor.width = std::max(least_width, 2 * cursor.apart);
  } else {
    cursor.width = least_width;
  }
  cursor.any = true;
  cursor.last = one.serial_low;
  cursor.guesses = true;
  co_return Result<void>{};
}

// The next of a row is asked for by name. True: it is there, or is known.
rt::Task<Result<bool>> Identify::guess(Run& run, Cursor& cursor) {
  const std::uint64_t serial = std::uint64_t{cursor.last} + cursor.stride;
  cursor.guesses = false;
  if (serial >= all_serials || serial < cursor.next || cursor.revisions.empty()) co_return false;
  const auto wanted = static_cast<std::uint32_t>(serial);
  const LssAddress device{cursor.kind.type.vendor, cursor.kind.type.product, cursor.revisions.front(), wanted};
  const std::vector<R_SN> known = run.known_of(cursor.kind);
  const bool is_known = std::ranges::find(known, device.r_sn()) != known.end();
  bool there = is_known;
  if (!is_known) {
    const auto tried = co_await proven(run, cursor, device, true);
    if (!tried) co_return fail(tried.error());
    there = *tried == Sweep::found;
  }
  if (there) {
    cursor.apart = (cursor.apart + cursor.stride) / 2;
    cursor.last = wanted;
    cursor.next = serial + 1;
    cursor.guesses = true;
    ++cursor.row;
  } else if (cursor.row >= 2 && !run.options.configured && !run.stopped) {
    const auto left = co_await blank_left(run);
    if (!left) co_return fail(left.error());
  }
  co_return there;
}

rt::Task<Result<void>> Identify::sweep(Run& run, Cursor& cursor, std::uint64_t end) {
  while (cursor.next < end && !run.over()) {
    run.tell(cursor.next);
    if (cursor.open) {
      const Box box = *std::exchange(cursor.open, std::nullopt);
      const auto done = co_await lowest_in(run, cursor, box);
      if (!done) co_return fail(done.error());
      continue;
    }
    if (cursor.guesses) {
      const auto there = co_await guess(run, cursor);
      if (!there) co_return fail(there.error());
      if (*there || run.over()) continue;
    }
    const std::uint64_t low = cursor.next;
    const std::uint64_t limit = std::min(end, run.next_known(cursor.kind, low));
    if (limit == low) {
      ++cursor.next;
      continue;
    }
    const std::uint64_t width = cursor.width == 0 ? first_width : cursor.width;
    const std::uint64_t high = std::min(limit, low + width);
    const Box box = box_of(cursor.kind, low, high);
    const auto heard = co_await ask(run, cursor, box, false);
    if (!heard) co_return fail(heard.error());
    if (run.stopped) break;
    if (*heard) {
      const auto done = co_await lowest_in(run, cursor, box);
      if (!done) co_return fail(done.error());
    } else {
      cursor.next = high;
      cursor.width = std::min(all_serials, width * widens);
    }
  }
  co_return Result<void>{};
}

// Every gap is asked with the longest window. True: all were silent.
rt::Task<Result<bool>> Identify::close(Run& run, Cursor& cursor) {
  const Box all = box_of(cursor.kind, 0, all_serials);
  const std::vector<Box> open = gaps(all, run.known_of(cursor.kind));
  bool quiet = true;
  for (std::size_t i = 0; i < open.size() && !run.over(); ++i) {
    const Box box = open[i];
    if (std::ranges::find(cursor.quiet, box) != cursor.quiet.end()) continue;
    const auto heard = co_await ask(run, cursor, box, true);
    if (!heard) co_return fail(heard.error());
    if (!*heard) cursor.quiet.push_back(box);
    if (run.stopped) break;
    if (!*heard) continue;
    quiet = false;
    if (box.serial_low == box.serial_high) {
      const auto there = co_await device_in(run, cursor, box);
      if (!there) co_return fail(there.error());
      continue;
    }
    Cursor part = cursor;
    part.next = box.serial_low;
    part.width = std::uint64_t{box.serial_high} - box.serial_low + 1;  // a device is there
    part.any = false;
    part.guesses = false;
    part.row = 0;
    const std::uint64_t end = part.next + part.width;
    const auto swept = co_await sweep(run, part, end);
    if (!swept) co_return fail(swept.error());
    cursor.revisions = part.revisions;
  }
  co_return quiet;
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
  // The rest of a search that was broken off, as long as the same is wanted.
  const bool same = std::ranges::equal(cursors, cursors_, {}, &Cursor::kind, &Cursor::kind);
  return same ? std::exchange(cursors_, {}) : cursors;
}

// One kind. False: it did not become quiet.
rt::Task<Result<bool>> Identify::one_kind(Run& run, Cursor& cursor, Pace& pace) {
  if (cursor.next == 0 && run.known_of(cursor.kind).empty()) {
    const Box all = box_of(cursor.kind, 0, all_serials);
    const auto anybody = co_await ask(run, cursor, all, true);
    if (!anybody) co_return fail(anybody.error());
    if (!*anybody && !run.stopped) {
      cursor.next = all_serials;
      cursor.closed = true;
    }
  }
  const auto swept = co_await sweep(run, cursor, all_serials);
  if (!swept) co_return fail(swept.error());
  run.tell(cursor.next);
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

// False: one of them did not become quiet.
rt::Task<Result<bool>> Identify::all_kinds(Run& run, std::vector<Cursor>& cursors, Pace& pace) {
  bool quiet = true;
  for (std::size_t k = 0; k < cursors.size(); ++k) {
    run.kind = k;
    run.unproven = 0;
    run.untrusted = false;
    run.care = run.haste.pays() ? Run::Care::none : Run::Care::wary;
    run.passed.clear();
    if (cursors[k].closed || run.over()) continue;
    const auto done = co_await one_kind(run, cursors[k], pace);
    if (!done) co_return fail(done.error());
    quiet = quiet && *done;
  }
  co_return quiet;
}

// A device whose receive buffer holds one frame answers 4Ch, which is a single one, and no question of six back to
// back.
rt::Task<Result<bool>> Identify::slowly(Run& run, std::vector<Cursor>& cursors, Pace& pace) {
  const auto left = co_await blank_left(run);
  if (!left) co_return fail(left.error());
  if (!*left) co_return true;
  pace.slow_down();
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
  Pace pace(services_.lss);
  Run run{.known = known, .options = options};
  const auto rate = services_.dispatcher.port().status().bit_rate;
  if (rate > 0) run.frame = rt::Duration(answer_bits * 1'000'000'000 / rate);
  run.report.began = services_.dispatcher.executor().now();
  run.report.known = run.report.began;
  services_.lss.suspect_strangers();
  const auto waiting = co_await services_.lss.switch_global(lss::State::waiting);
  if (!waiting) co_return fail(waiting.error());
  std::vector<Cursor> cursors = begin(known);
  run.kinds = cursors.size();
  auto quiet = co_await all_kinds(run, cursors, pace);
  if (!quiet) co_return fail(quiet.error());
  const bool unheard = *quiet && !run.over();
  if (unheard) {
    quiet = co_await slowly(run, cursors, pace);
    if (!quiet) co_return fail(quiet.error());
  }
  const bool gave_up = !*quiet;
  using End = Report::End;
  run.report.end = run.stopped ? End::more : gave_up ? End::gave_up : run.full() ? End::limit : End::complete;
  if (run.stopped) cursors_ = std::move(cursors);
  run.report.ended = services_.dispatcher.executor().now();
  co_return run.report;
}

}  // namespace berth::discovery

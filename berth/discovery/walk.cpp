// A search: rounds, the path through known parts, and what is known.
#include "berth/discovery/walk.hpp"

#include <algorithm>
#include <utility>

#include "berth/discovery/busy.hpp"
#include "berth/discovery/walk_search.hpp"

namespace berth::discovery {

Walker::Walker(const Services& services, bool feedback)
    : services_(services), asker_(services.dispatcher), feedback_(feedback) {}
Walker::~Walker() = default;

namespace {
constexpr lss::FastscanRequest start_scan{};
constexpr rt::Duration breath = std::chrono::milliseconds(10);

std::uint16_t base_of(const lss::Master& master) noexcept {
  const auto configured = master.options().feedback_base;
  return configured != 0 ? configured : lss::default_feedback_base;
}
}  // namespace

rt::Task<Result<Report>> Walker::find(const Known& known, const Options& options) {
  if (busy_) co_return fail(Errc::invalid, "another walk is under way");
  const Busy busy(busy_);
  heard_feedback_ = false;
  asker_.begin(options, feedback_ ? base_of(services_.lss) : std::uint16_t{0});
  Search search(*this, known, options);
  co_return co_await search.run();
}

rt::Task<Result<bool>> Walker::anybody(const Options& options) {
  if (busy_) co_return fail(Errc::invalid, "another walk is under way");
  const Busy busy(busy_);
  asker_.begin(options, feedback_ ? base_of(services_.lss) : std::uint16_t{0});
  const auto heard = co_await asker_.ask(start_scan, Wait::bound);
  if (!heard) co_return fail(heard.error());
  heard_feedback_ = heard->feedback;
  co_return heard->yes();
}

// ---- one search ---------------------------------------------------------------------------------------------------

Walker::Search::Search(Walker& walker, const Known& known, const Options& options)
    : walker_(walker), asker_(walker.asker_), lss_(walker.services_.lss), known_(known), options_(options) {
  for (const LssAddress& a : known.expected) {
    paths_.push_back({.part = {a.vendor, a.product, a.revision, a.serial}, .parts = 4});
  }
  for (const Kind& k : known.kinds) {
    paths_.push_back(
        {.part = {k.type.vendor, k.type.product, k.revision.value_or(0), 0}, .parts = k.revision ? 3U : 2U});
  }
  for (const LssAddress& a : known.registered) {
    paths_.push_back({.part = {a.vendor, a.product, a.revision, 0}, .parts = 3});
  }
}

Walker::Search::~Search() {
  if (held_) walker_.services_.dispatcher.send(lss::request(lss::Command::switch_global, 0));
}

void Walker::Search::broken(Error error) noexcept {
  if (!broken_) error_ = error;
  broken_ = true;
}

// What is on its way down to a device begins again: none was selected yet.
bool Walker::Search::stops() noexcept {
  const bool now = !broken_ && options_.observer != nullptr && !options_.observer->goes_on();
  if (now) broken_ = stopped_ = true;
  return now;
}

bool Walker::Search::over() const { return broken_ || set_aside_ || report_.found.size() >= options_.most_devices; }

rt::Task<Result<Report>> Walker::Search::run() {
  rt::Executor& executor = walker_.services_.dispatcher.executor();
  report_.began = executor.now();
  report_.known = report_.began;
  held_ = true;  // a master before us may have left a device there
  lss_.suspect_strangers();
  co_await release();
  unsigned fruitless = 0;
  for (;;) {
    Heard anybody = co_await start();
    if (!anybody.yes() && !broken_) {
      // `04 00` went before: a device whose receive buffer holds one frame has lost the question behind it.
      co_await rt::sleep_for(breath);
      anybody = co_await start();
    }
    if (broken_ || !anybody.yes()) break;
    const auto found = report_.found.size();
    const auto marks = absent_.size();
    if (aside_.empty()) {
      co_await round();
    } else {
      by_bits_ = true;  // feedback of those put aside says nothing
      co_await beside();
    }
    last_round_found_ = report_.found.size() - found;
    const bool one_more_aside = std::exchange(set_aside_, false);
    if (over() || exhausted_) break;
    // A known part that no device has was tried: that happens once for each and is no restart.
    const bool restart = last_round_found_ == 0 && absent_.size() == marks && !one_more_aside;
    if (restart) ++report_.restarts;
    fruitless = restart ? fruitless + 1 : last_round_found_ > 0 ? 0 : fruitless;
    if (fruitless > options_.retries) break;
    if (patient_ && restart) asker_.be_more_patient();
    const bool judged = !patient_ && (restart || last_round_found_ > 0);
    if (judged) haste_.note(!restart);
    patient_ = fruitless > 0 || !haste_.pays();
    // What one device answers late is taken for an answer to the next question: with feedback a wrong way down.
    wholly_ = by_bits_ = fruitless > 1;
    asker_.be_patient(patient_, wholly_);
  }
  const bool failed = broken_ && !stopped_;
  if (failed) co_return fail(error_);
  if (held_) co_await release();
  // Another scheme comes next, and its answers have our feedback's identifiers (S1.24).
  co_await rt::sleep_until(asker_.settled());
  if (stopped_) {
    report_.end = Report::End::more;
  } else if (report_.found.size() >= options_.most_devices) {
    report_.end = Report::End::limit;
  } else if (fruitless > options_.retries) {
    report_.end = Report::End::gave_up;
  } else if (exhausted_ && nameless_) {
    report_.end = Report::End::held;
  }
  report_.requests = asker_.requests();
  report_.ended = executor.now();
  co_return report_;
}

// ---- the way to the serial numbers ----------------------------------------------------------------------------------

rt::Task<Heard> Walker::Search::start() {
  sub_ = 0;
  children_.clear();
  elsewhere();
  Heard result{};
  do {
    auto question = asker_.ask(start_scan, Wait::bound);
    const auto heard = co_await question;
    if (!heard) {
      broken(heard.error());
      co_return Heard{};
    }
    result = *heard;
    count(result);
  } while (!result.sent);
  asked_ = {};
  asked_sub_ = 0;
  entered_answers_ = result.answers;
  if (result.feedback) walker_.heard_feedback_ = true;
  take_feedback(asker_.feedback(), 0, asked_, children_);
  co_return result;
}

// Every device whose part is `value` moves on; the part after it is walked then.
rt::Task<bool> Walker::Search::enter(std::uint32_t value) {
  if (sub_ < 3 && has_used_[sub_] && used_[sub_] != value) varied_[sub_] = true;
  used_[sub_] = value;
  has_used_[sub_] = true;
  const Prefix whole{value, 0};
  const Heard heard = co_await ask_once(whole, sub_ + 1, Wait::bound);
  overtaken_ = heard.late && !heard.yes();
  if (!heard.yes()) co_return false;
  chain_[sub_++] = value;
  entered_answers_ = heard.answers;
  co_return true;
}

// Where the lowest bit was 0 after all, the question for it was answered too late, and no device has moved on yet.
rt::Task<bool> Walker::Search::enter_leaf() {
  const std::uint32_t value = leaf_.value;
  bool entered = co_await enter(value);
  const bool other = overtaken_ && !broken_;
  if (other) entered = co_await enter(value ^ 1U);
  overtaken_ = false;
  co_return entered;
}

rt::Task<void> Walker::Search::round() {
  while (sub_ < 3) {
    const Path* const path = choose();
    if (path != nullptr) {
      Path tried{.part = chain_, .parts = sub_ + 1};
      tried.part[sub_] = path->part[sub_];
      const bool entered = co_await enter(tried.part[sub_]);
      if (broken_) co_return;
      if (!entered) {
        absent_.push_back(tried);
        co_return;
      }
      continue;
    }
    open_.clear();
    seen_.clear();
    careful_ = 0;
    backs_ = 0;
    anchors_.assign(1, Prefix{});
    const Prefix root;
    bool found = co_await descend(root, entered_answers_);
    if (found && !broken_) found = co_await enter_leaf();
    if (!found || broken_) co_return;
  }
  const bool same = chain_ == last_chain_;
  const auto before = report_.found.size();
  const bool one_before = last_round_found_ == 1;
  co_await serials();
  const bool found = report_.found.size() > before;
  if (same && one_before && found) (hints_fail_ ? forgets_ : hints_fail_) = true;
  last_chain_ = chain_;
}

// ---- what is known --------------------------------------------------------------------------------------------------

bool Walker::Search::fits_chain(const Path& path) const {
  return std::equal(chain_.begin(), chain_.begin() + sub_, path.part.begin());
}

bool Walker::Search::absent(const Path& path) const {
  return std::ranges::any_of(absent_, [&](const Path& a) {
    return a.parts == sub_ + 1 && std::equal(a.part.begin(), a.part.begin() + a.parts, path.part.begin());
  });
}

bool Walker::Search::chunk_heard(std::uint32_t value) const {
  return std::ranges::any_of(children_, [&](Prefix p) { return p.contains(value); });
}

// With feedback only what was heard is tried: a device that sends none is left until those that do have been found.
const Walker::Search::Path* Walker::Search::choose() const {
  for (const Path& path : paths_) {
    if (path.parts <= sub_ || !fits_chain(path) || absent(path)) continue;
    if (path.parts == 4 && is_found({path.part[0], path.part[1], path.part[2], path.part[3]})) continue;
    if (children_.empty() || chunk_heard(path.part[sub_])) return &path;
  }
  return nullptr;
}

bool Walker::Search::is_found(const LssAddress& device) const {
  return std::ranges::find(report_.found, device, &Found::address) != report_.found.end();
}

bool Walker::Search::is_registered(const LssAddress& device) const {
  return std::ranges::find(known_.registered, device) != known_.registered.end();
}

bool Walker::Search::is_aside(const LssAddress& device) const {
  return std::ranges::find(aside_, device) != aside_.end();
}

}  // namespace berth::discovery

#include "berth/discovery/walk.hpp"

#include <utility>

#include "berth/discovery/busy.hpp"
#include "berth/discovery/walk_aside.hpp"

namespace berth::discovery {

// One search: rounds until no device answers.
class Walker::Search {
 public:
  Search(Walker& walker, const Known& known, const Options& options);
  [[nodiscard]] rt::Task<Result<Report>> run();

 private:
  const Services& services_;
  const Options& options_;
  Report report_{};
  walk::Questions q_;
  walk::KnownPaths paths_;
  walk::Devices devices_;
  walk::Descent descent_;
  walk::Serials serials_;
  walk::Route route_;
  walk::Aside aside_;
  Haste haste_;
  bool patient_ = false;  // haste did not pay
};

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
  asker_.forget();
  const bool sliced = options.slice > 0;
  const bool goes_on = std::exchange(goes_on_, false) && sliced;
  if (!goes_on) memory_ = walk::Memory::for_a_search(sliced, memory_);
  memory_.aside.begin_round();
  Search search(*this, known, options);
  auto report = co_await search.run();
  goes_on_ = report && report->end == Report::End::more;
  co_return report;
}

rt::Task<Result<bool>> Walker::anybody(const Options& options) {
  if (busy_) co_return fail(Errc::invalid, "another walk is under way");
  const Busy busy(busy_);
  asker_.begin(options, feedback_ ? base_of(services_.lss) : std::uint16_t{0});
  const auto heard = co_await asker_.ask(start_scan, Wait::closing);
  if (!heard) co_return fail(heard.error());
  heard_feedback_ = heard->feedback;
  co_return heard->yes();
}

// ---- one search ---------------------------------------------------------------------------------------------------

Walker::Search::Search(Walker& walker, const Known& known, const Options& options)
    : services_(walker.services_),
      options_(options),
      q_(walker.asker_, options, walker.heard_feedback_),
      paths_(known),
      devices_(q_, services_, walker.method(), known, options, paths_, walker.memory_, report_),
      descent_(q_),
      serials_(q_, descent_, devices_, known, options, report_),
      route_(q_, descent_, serials_, paths_, report_),
      aside_(q_, descent_, devices_, serials_, route_, walker.memory_, report_) {}

rt::Task<Result<Report>> Walker::Search::run() {
  rt::Executor& executor = services_.dispatcher.executor();
  report_.began = executor.now();
  report_.known = report_.began;
  services_.lss.suspect_strangers();
  co_await devices_.release();
  unsigned fruitless = 0;
  for (;;) {
    Heard anybody = co_await q_.start();
    if (!anybody.yes() && !q_.is_broken()) {
      // A device with a receive buffer of one frame has lost the question that came right after `04 00`.
      co_await rt::sleep_for(breath);
      anybody = co_await q_.start();
    }
    if (q_.is_broken() || !anybody.yes()) break;
    const auto found = report_.found.size();
    const auto marks = paths_.absent();
    if (devices_.aside().all().empty()) {
      co_await route_.round();
    } else {
      q_.go_by_bits(true);  // feedback of devices put aside shows nothing new
      co_await aside_.round();
    }
    const auto found_now = report_.found.size() - found;
    route_.note_found(found_now);
    const bool one_more_aside = devices_.aside().in_this_round();
    devices_.aside().begin_round();
    if (devices_.over() || aside_.exhausted()) break;
    // A round that tried a known part which no device has is not a restart: this happens once for each such part.
    const bool restart = found_now == 0 && paths_.absent() == marks && !one_more_aside;
    if (restart) ++report_.restarts;
    fruitless = restart ? fruitless + 1 : found_now > 0 ? 0 : fruitless;
    if (fruitless > options_.retries) break;
    if (patient_ && restart) q_.asker().be_more_patient();
    const bool judged = !patient_ && (restart || found_now > 0);
    if (judged) haste_.note(!restart);
    patient_ = fruitless > 0 || !haste_.pays();
    // A device's late answer counts for the next question; with feedback it leads the wrong way down.
    const bool wholly = fruitless > 1;
    q_.go_by_bits(wholly);
    q_.be_patient(patient_, wholly);
  }
  const bool failed = q_.is_broken() && !q_.stopped();
  if (failed) co_return fail(q_.error());
  if (devices_.held()) co_await devices_.release();
  // Another scheme may come next, and its answers have the identifiers of our feedback (S1.24).
  co_await rt::sleep_until(q_.asker().settled());
  if (q_.stopped()) {
    report_.end = Report::End::more;
  } else if (devices_.enough()) {
    report_.end = Report::End::limit;
  } else if (fruitless > options_.retries) {
    report_.end = Report::End::gave_up;
  } else if (aside_.exhausted() && devices_.aside().nameless()) {
    report_.end = Report::End::held;
  }
  report_.requests = q_.asker().requests();
  report_.ended = executor.now();
  co_return report_;
}

}  // namespace berth::discovery

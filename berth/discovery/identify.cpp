#include "berth/discovery/identify.hpp"

#include <algorithm>

#include "berth/discovery/busy.hpp"
#include "berth/discovery/by_name.hpp"

namespace berth::discovery {
namespace {
constexpr rt::Duration default_window = std::chrono::milliseconds(10);
constexpr std::int64_t answer_bits = 126;
// Halves that were not asked because the other half was silent: after so many in a row the next one is asked, so that
// a question that somebody did not hear is not followed down to the last bit.
constexpr unsigned most_assumed = 6;
// A device with a small receive buffer loses some of six frames back to back.
constexpr rt::Duration slow_inhibit = std::chrono::milliseconds(10);

constexpr std::uint32_t middle(std::uint32_t low, std::uint32_t high) noexcept { return low + (high - low) / 2; }

// The ranges of one dimension between known values.
template <class Add>
void between(std::uint32_t low, std::uint32_t high, const std::vector<std::uint32_t>& known, const Add& add) {
  std::uint64_t from = low;
  for (const std::uint32_t k : known) {
    if (k > from) add(static_cast<std::uint32_t>(from), k - 1U);
    from = std::uint64_t{k} + 1;
  }
  if (from <= high) add(static_cast<std::uint32_t>(from), high);
}

// Pauses between the frames for as long as a search lasts, once one fruitless pass was no accident.
class Pace {
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
}  // namespace

Box Box::lower() const noexcept {
  Box b = *this;
  if (revision_low != revision_high) {
    b.revision_high = middle(revision_low, revision_high);
  } else {
    b.serial_high = middle(serial_low, serial_high);
  }
  return b;
}

Box Box::upper() const noexcept {
  Box b = *this;
  if (revision_low != revision_high) {
    b.revision_low = middle(revision_low, revision_high) + 1;
  } else {
    b.serial_low = middle(serial_low, serial_high) + 1;
  }
  return b;
}

std::vector<Box> gaps(const Box& all, std::vector<R_SN> known) {
  std::erase_if(known, [&](const R_SN& n) { return !all.contains(n); });
  std::ranges::sort(known, {}, [](const R_SN& n) { return std::pair(n.serial, n.revision); });
  std::vector<Box> result;
  std::vector<std::uint32_t> serials;
  for (const R_SN& n : known) {
    if (serials.empty() || serials.back() != n.serial) serials.push_back(n.serial);
  }
  between(all.serial_low, all.serial_high, serials, [&](std::uint32_t low, std::uint32_t high) {
    result.push_back({all.revision_low, all.revision_high, low, high});
  });
  for (const std::uint32_t serial : serials) {
    std::vector<std::uint32_t> revisions;
    for (const R_SN& n : known) {
      const bool twice = !revisions.empty() && revisions.back() == n.revision;
      if (n.serial == serial && !twice) revisions.push_back(n.revision);
    }
    between(all.revision_low, all.revision_high, revisions, [&](std::uint32_t low, std::uint32_t high) {
      result.push_back({low, high, serial, serial});
    });
  }
  return result;
}

struct Identify::Run {
  const Known& known;
  const Options& options;
  rt::Duration frame{0};
  Report report{};
  unsigned failures = 0;

  [[nodiscard]] rt::Duration longest() const noexcept {
    return (options.window.count() > 0 ? options.window : default_window) + frame + options.blocking;
  }
  [[nodiscard]] std::vector<R_SN> known_of(TypeCode type) const {
    std::vector<R_SN> result;
    for (const auto& a : known.registered) {
      if (a.type() == type) result.push_back(a.r_sn());
    }
    for (const auto& d : report.found) {
      if (d.address.type() == type) result.push_back(d.address.r_sn());
    }
    return result;
  }
  bool late = false;  // `most_time` is over

  [[nodiscard]] bool over() const { return late || report.found.size() >= options.most_devices; }
};

rt::Task<Result<bool>> Identify::ask(Run& run, const Kind& kind, const Box& box, bool patient) {
  const lss::IdentifyRanges ranges{.vendor = kind.type.vendor,
                                   .product = kind.type.product,
                                   .revision_low = box.revision_low,
                                   .revision_high = box.revision_high,
                                   .serial_low = box.serial_low,
                                   .serial_high = box.serial_high};
  const rt::Duration learnt = latency_.response(run.options.shortest, run.longest()) + run.options.blocking;
  // A sample holds the answer's frame here. What comes later still belongs to no range of the next question: six
  // frames lie between.
  const lss::ServiceOptions service{
      .timeout = patient ? run.longest() : std::min(learnt, run.longest()), .retries = 0, .full_window = true};
  ++run.report.requests;
  const auto reply = co_await services_.lss.identify_remote(ranges, service);
  if (!reply) co_return fail(reply.error());
  if (reply->answers > 0) latency_.note(reply->heard_at[0] - reply->sent);
  const rt::Duration since = services_.dispatcher.executor().now() - run.report.began;
  run.late = run.options.most_time.count() > 0 && since > run.options.most_time;
  co_return reply->answers > 0;
}

// The device that is left must answer for itself; then it tells its node-ID.
rt::Task<Result<bool>> Identify::proven(Run& run, const LssAddress& device) {
  const lss::ServiceOptions service{.timeout = run.longest(), .retries = 1, .full_window = true};
  const auto selected = co_await services_.lss.switch_selective(device, service);
  Found found{.address = device, .at = {}, .active = {}, .assigned = {}, .by = Method::identify};
  bool itself = false;
  if (selected) {
    // 44h may be a late one, of who was selected before.
    const auto own = co_await services_.lss.inquire(3, service);
    itself = own.has_value() && !own->differ && own->value() == device.serial;
  }
  if (selected && itself) {
    const auto id = co_await services_.lss.inquire_node_id(service);
    found.at = services_.dispatcher.executor().now();
    found.possible_clone = selected->answers > 1;
    if (id && !id->differ) found.active = NodeId::make(id->byte()).value_or(NodeId());
    // Asked once more: a doubled frame would be a coincidence.
    if (found.possible_clone || (id && (id->differ || id->answers > 1))) {
      const auto again = co_await services_.lss.switch_selective(device, service);
      found.possible_clone = again.has_value() && again->answers > 1;
    }
  }
  const auto waiting = co_await services_.lss.switch_global(lss::State::waiting);
  if (!waiting) co_return fail(waiting.error());
  if (!selected && selected.error().code == Errc::bus) co_return fail(selected.error());
  if (!selected || !itself) co_return false;
  run.report.known = found.at;
  const bool blank = !found.active.configured() && !found.possible_clone;
  if (blank) {
    const auto assigned = co_await assign_by_name(services_.lss, device, run.options);
    if (!assigned) co_return fail(assigned.error());
    found.assigned = *assigned;
  }
  run.report.found.push_back(found);
  if (run.options.observer != nullptr) run.options.observer->found(found);
  co_return true;
}

// Everybody in a box that was answered.
rt::Task<Result<void>> Identify::search(Run& run, const Kind& kind, const Box& box) {
  struct Open {
    Box box;
    bool answered;
    unsigned assumed;
  };
  std::vector<Open> open(1, Open{box, true, 0});
  while (!open.empty() && !run.over()) {
    const Open next = open.back();
    const Box at = next.box;
    open.pop_back();
    const bool doubtful = next.assumed >= most_assumed;
    if (!next.answered || doubtful) {
      const auto heard = co_await ask(run, kind, at, doubtful);
      if (!heard) co_return fail(heard.error());
      if (!*heard && doubtful) ++run.failures;
      if (!*heard) continue;
    }
    const unsigned assumed = doubtful ? 0 : next.assumed;
    if (at.single()) {
      const LssAddress device{kind.type.vendor, kind.type.product, at.revision_low, at.serial_low};
      const auto there = co_await proven(run, device);
      if (!there) co_return fail(there.error());
      if (!*there) ++run.failures;
      continue;
    }
    const Box lower = at.lower();
    const Box upper = at.upper();
    const auto heard = co_await ask(run, kind, lower, run.failures > 0);
    if (!heard) co_return fail(heard.error());
    open.push_back({upper, !*heard, *heard ? 0 : assumed + 1});
    if (*heard) open.push_back({lower, true, 0});
  }
  co_return Result<void>{};
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
  const auto waiting = co_await services_.lss.switch_global(lss::State::waiting);
  if (!waiting) co_return fail(waiting.error());
  std::vector<Kind> kinds = known.kinds;
  for (const auto& a : known.expected) kinds.push_back({a.type(), a.revision});
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    const Kind kind = kinds[k];
    if (std::find(kinds.begin(), kinds.begin() + static_cast<std::ptrdiff_t>(k), kind) !=
        kinds.begin() + static_cast<std::ptrdiff_t>(k)) {
      continue;
    }
    Box all;
    if (kind.revision) all.revision_low = all.revision_high = *kind.revision;
    bool quiet = false;
    for (unsigned fruitless = 0; !quiet && !run.over();) {
      quiet = true;
      const auto before = run.report.found.size();
      const std::vector<Box> open = gaps(all, run.known_of(kind.type));
      for (std::size_t i = 0; i < open.size() && !run.late; ++i) {
        const auto heard = co_await ask(run, kind, open[i], true);
        if (!heard) co_return fail(heard.error());
        if (!*heard) continue;
        quiet = false;
        const auto searched = co_await search(run, kind, open[i]);
        if (!searched) co_return fail(searched.error());
      }
      if (quiet || run.report.found.size() > before) continue;
      ++run.report.restarts;
      if (fruitless > 0) pace.slow_down();
      if (++fruitless <= options.retries) continue;
      run.report.end = Report::End::gave_up;
      break;
    }
  }
  if (run.late) {
    run.report.end = Report::End::gave_up;
  } else if (run.over()) {
    run.report.end = Report::End::limit;
  }
  run.report.ended = services_.dispatcher.executor().now();
  co_return run.report;
}

rt::Task<Result<bool>> Identify::anybody(const Options& options) {
  const rt::Duration window = options.window.count() > 0 ? options.window : default_window;
  const lss::ServiceOptions service{.timeout = window + options.blocking, .retries = 0, .full_window = false};
  const auto reply = co_await services_.lss.identify_non_configured(service);
  if (!reply) co_return fail(reply.error());
  co_return reply->answers > 0;
}

}  // namespace berth::discovery

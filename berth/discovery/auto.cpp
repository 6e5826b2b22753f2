#include "berth/discovery/auto.hpp"

#include <algorithm>
#include <utility>

#include "berth/discovery/busy.hpp"
#include "berth/discovery/by_name.hpp"
#include "berth/discovery/identify.hpp"
#include "berth/discovery/identify_parts.hpp"
#include "berth/discovery/planner_rand.hpp"
#include "berth/discovery/published.hpp"
#include "berth/discovery/walk.hpp"

namespace berth::discovery {

std::unique_ptr<Discovery> make(Method method, const Services& services) {
  switch (method) {
    case Method::rand: return make_rand(services);
    case Method::and_protocol: return make_and(services);
    case Method::fastscan: return make_fastscan(services, lss::Feedback::none);
    case Method::feedback_29: return make_fastscan(services, lss::Feedback::extended);
    case Method::feedback_11: return make_fastscan(services, lss::Feedback::base);
    case Method::identify: return std::make_unique<Identify>(services);
    case Method::planner_rand: return make_planner_rand(services);
    case Method::planner_fastscan: return std::make_unique<Walker>(services, false);
    case Method::planner_feedback: break;
  }
  return std::make_unique<Walker>(services, true);
}

namespace {
constexpr const char* busy_text = "another discovery is under way";
}  // namespace

Auto::Auto(const Services& services, const AutoOptions& options) : services_(services), options_(options) {}
Auto::~Auto() = default;

Discovery& Auto::of(Method method) {
  auto& part = parts_[static_cast<std::size_t>(method)];
  if (!part) part = make(method, services_);
  return *part;
}

struct Auto::Run {
  const Known& given;
  const Options& options;
  Known known = given;  // with the devices found since
  Options part;         // for one scheme: with the number of devices still wanted
  Report report{};

  [[nodiscard]] bool over() const {
    return report.end == Report::End::more || report.found.size() >= options.most_devices;
  }
  // Every walk finds equal devices again, because they keep answering.
  [[nodiscard]] bool none_is_new() const {
    return std::ranges::all_of(report.found, [this](const Found& f) {
      const auto is_it = [&f](const LssAddress& one) { return one == f.address; };
      return std::ranges::any_of(given.registered, is_it) || std::ranges::any_of(given.equals, is_it);
    });
  }
  // A device that has no node-ID after all schemes were run answers the non-configured question, too.
  [[nodiscard]] bool all_assigned() const {
    return std::ranges::all_of(report.found,
                               [](const Found& f) { return f.assigned.configured() || f.active.configured(); });
  }
};

void Auto::OpenRanges::broken_off(Report::End schemes_end) { open_ = schemes_end; }

std::optional<Report::End> Auto::OpenRanges::go_on(const Options& options) {
  constexpr unsigned most = 4;  // then the schemes are tried again: a device may have come that speaks one
  const std::optional<Report::End> open = std::exchange(open_, std::nullopt);
  times_ = open && options.slice == 0 && times_ < most ? times_ + 1 : 0;
  return times_ > 0 ? open : std::nullopt;
}

// Searches by one scheme, which knows the devices found earlier and does not report them again.
rt::Task<Result<void>> Auto::part(Run& run, Method method) {
  Discovery& discovery = of(method);
  last_ = method;
  run.part.most_devices = run.options.most_devices - static_cast<unsigned>(run.report.found.size());
  auto done = co_await discovery.find(run.known, run.part);
  if (!done) co_return fail(done.error());
  for (const Found& found : done->found) {
    const auto known = std::ranges::find(run.report.found, found.address, &Found::address);
    if (known != run.report.found.end()) {
      if (!known->assigned.configured()) known->assigned = found.assigned;
      continue;
    }
    run.report.found.push_back(found);
    run.known.registered.push_back(found.address);
    run.report.known = std::max(run.report.known, found.at);
  }
  run.report.requests += done->requests;
  run.report.restarts += done->restarts;
  const bool first = run.report.end == Report::End::complete && done->end != Report::End::complete;
  if (first || done->end == Report::End::more) run.report.end = done->end;
  co_return Result<void>{};
}

// For devices that answer no search: LSS without Fastscan and without 46h to 4Ch.
rt::Task<Result<void>> Auto::by_name(Run& run) {
  constexpr std::size_t most = 8;
  const std::vector<LssAddress> expected = run.known.expected;
  // Every second time there are pauses between frames: a small receive buffer loses consecutive frames.
  Pauses pauses(services_.lss);
  if (!expected.empty() && named_ / expected.size() % 2 == 1) pauses.slow_down();
  for (std::size_t i = 0; i < std::min(most, expected.size()) && !run.over(); ++i) {
    const LssAddress device = expected[named_++ % expected.size()];
    const auto& there = run.known.registered;
    if (std::ranges::find(there, device) != there.end()) continue;
    const lss::AloneOptions how{.parts = parts_that_tell(device, run.known, run.report), .guess = true};
    const auto alone = co_await lss::select_alone(services_.lss, device, how);
    if (!alone) co_return fail(alone.error());
    const bool clones = *alone == lss::Selection::clones;
    if (*alone != lss::Selection::alone && !clones) continue;
    Found found{.address = device, .active = {}, .assigned = {}, .possible_clone = clones, .by = Method::identify};
    found.at = services_.dispatcher.executor().now();
    const lss::ServiceOptions service = services_.lss.options().service;
    if (!clones) {
      const auto told = co_await lss::ask_node_id(services_.lss, device, service);
      if (told && *told) found.active = NodeId::make((*told)->byte()).value_or(NodeId());
    }
    const auto waiting = co_await services_.lss.switch_global(lss::State::waiting);
    if (!waiting) co_return fail(waiting.error());
    run.report.found.push_back(found);
    run.known.registered.push_back(device);
    if (run.options.observer != nullptr) run.options.observer->found(found);
  }
  co_return Result<void>{};
}

rt::Task<Result<Report>> Auto::find(const Known& known, const Options& options) {
  if (busy_) co_return fail(Errc::invalid, busy_text);
  const Busy busy(busy_);
  Run run{.given = known, .options = options, .part = options};
  run.report.began = services_.dispatcher.executor().now();
  run.report.known = run.report.began;
  const std::optional<Report::End> before = ranges_.go_on(options);
  if (before) run.report.end = *before;
  if (!before) {
    const auto asked = co_await by_schemes(run);
    if (!asked) co_return fail(asked.error());
  }
  const auto rest = co_await by_the_rest(run, before.has_value());
  if (!rest) co_return fail(rest.error());
  run.report.ended = services_.dispatcher.executor().now();
  co_return run.report;
}

rt::Task<Result<void>> Auto::by_schemes(Run& run) {
  spoken_ = {};
  // The first question of each planner shows whether a device speaks its scheme.
  constexpr std::array<Method, 3> schemes{Method::planner_feedback, Method::planner_rand, Method::and_protocol};
  const std::array<bool, 3> wanted{options_.fastscan, options_.rand, options_.and_protocol};
  std::array<bool*, 3> spoken{&spoken_.fastscan, &spoken_.rand, &spoken_.and_protocol};
  for (std::size_t i = 0; i < schemes.size() && !run.over(); ++i) {
    if (!wanted[i]) continue;
    Discovery& scheme = of(schemes[i]);
    const auto anybody = co_await scheme.anybody(run.options);
    if (!anybody) co_return fail(anybody.error());
    *spoken[i] = *anybody;
    if (!*anybody) continue;
    const auto done = co_await part(run, schemes[i]);
    if (!done) co_return fail(done.error());
  }
  if (const auto* walker =
          static_cast<const Walker*>(parts_[static_cast<std::size_t>(Method::planner_feedback)].get())) {
    spoken_.feedback = walker->heard_feedback();
  }
  co_return Result<void>{};
}

rt::Task<Result<void>> Auto::by_the_rest(Run& run, bool goes_on) {
  const Known& known = run.known;
  // A device found by Fastscan has no node-ID; only ranges find devices that have one.
  bool look = options_.configured || goes_on || run.report.end == Report::End::held;
  run.part.configured = options_.configured;
  if (options_.identify && run.all_assigned() && !run.over()) {
    Discovery& identify = of(Method::identify);
    const auto blank = co_await identify.anybody(run.options);
    if (!blank) co_return fail(blank.error());
    spoken_.non_configured = *blank;
    look = look || *blank;
  }
  // This comes before the ranges: on a slow bus they are broken off again and again, and a name costs one question.
  if (options_.configured && !run.over()) {
    const auto named = co_await by_name(run);
    if (!named) co_return fail(named.error());
  }
  if (look && !run.over() && !(known.kinds.empty() && known.expected.empty())) {
    const Report::End schemes_end = run.report.end;
    const bool none_is_new = run.none_is_new();
    const auto done = co_await part(run, Method::identify);
    if (!done) co_return fail(done.error());
    // Otherwise trying a scheme costs only one question.
    const bool walked = spoken_.fastscan || spoken_.rand || spoken_.and_protocol;
    if (run.report.end == Report::End::more && none_is_new && walked) ranges_.broken_off(schemes_end);
  }
  co_return Result<void>{};
}

rt::Task<Result<Spoken>> Auto::ask_spoken(const Options& options) {
  if (busy_) co_return fail(Errc::invalid, busy_text);
  const Busy busy(busy_);
  spoken_ = {};
  constexpr std::array<Method, 4> schemes{Method::planner_feedback, Method::planner_rand, Method::and_protocol,
                                          Method::identify};
  const std::array<bool, 4> wanted{options_.fastscan, options_.rand, options_.and_protocol, options_.identify};
  std::array<bool*, 4> spoken{&spoken_.fastscan, &spoken_.rand, &spoken_.and_protocol, &spoken_.non_configured};
  for (std::size_t i = 0; i < schemes.size(); ++i) {
    if (!wanted[i]) continue;
    Discovery& scheme = of(schemes[i]);
    const auto anybody = co_await scheme.anybody(options);
    if (!anybody) co_return fail(anybody.error());
    *spoken[i] = *anybody;
  }
  if (spoken_.fastscan) {
    const auto& walker = static_cast<const Walker&>(of(Method::planner_feedback));
    spoken_.feedback = walker.heard_feedback();
  }
  co_return spoken_;
}

rt::Task<Result<bool>> Auto::anybody(const Options& options) {
  if (busy_) co_return fail(Errc::invalid, busy_text);
  const Busy busy(busy_);
  constexpr std::array<Method, 4> schemes{Method::planner_feedback, Method::planner_rand, Method::and_protocol,
                                          Method::identify};
  const std::array<bool, 4> wanted{options_.fastscan, options_.rand, options_.and_protocol, options_.identify};
  for (std::size_t i = 0; i < schemes.size(); ++i) {
    if (!wanted[i]) continue;
    Discovery& scheme = of(schemes[i]);
    const auto heard = co_await scheme.anybody(options);
    if (!heard) co_return fail(heard.error());
    if (*heard) co_return true;
  }
  co_return false;
}

}  // namespace berth::discovery

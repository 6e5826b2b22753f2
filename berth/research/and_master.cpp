#include "berth/research/and_master.hpp"

#include <algorithm>
#include <bit>
#include <utility>

namespace berth::research {
namespace {

constexpr const char* and_busy = "another AND procedure is under way";

}  // namespace

struct AndMaster::Run {
  const AndOptions& options;
  AndObserver* observer = nullptr;
  AndReport report{};
  AndFound last{};                       // the result of the procedure
  AndAddress path{};                     // its address so far
  std::array<std::uint16_t, 12> left{};  // recursive: values heard at each phase of the path, not walked yet
  unsigned next = 0;                     // phase to continue with
  unsigned streak = 0;                   // restarts since the last device was found

  [[nodiscard]] nodeid::WindowTimes times(AndAnswer::Kind kind) const noexcept {
    const auto& d = options.discovery;
    const unsigned factor = d.widen ? 1U << std::min(streak, 4U) : 1U;
    nodeid::WindowTimes t{.send_timeout = d.send_timeout};
    if (d.window == nodeid::DiscoveryOptions::Window::fixed) {
      t.first = factor * (kind != AndAnswer::Kind::ius && d.direct.count() > 0 ? d.direct : d.collect);
    } else {
      t.first = factor * (d.first.count() > 0 ? d.first : d.t_resp);
      t.after_last = factor * d.t_resp;
      t.most = factor * std::max(d.most, d.t_resp);
    }
    return t;
  }
  /// Recursive: the deepest phase with another value; 0: there is none.
  void go_on() noexcept {
    next = 0;
    if (!options.recursive) return;
    for (unsigned phase = 12; phase-- > 0;) {
      if (left[phase] == 0) continue;
      path = path.prefix(phase).with(phase, static_cast<std::uint8_t>(std::countr_zero(left[phase])));
      left[phase] = static_cast<std::uint16_t>(left[phase] & (left[phase] - 1U));
      next = phase + 1;
      return;
    }
  }
};

struct AndMaster::Lease {
  explicit Lease(AndMaster& master) noexcept : master_(master) { master_.busy_ = true; }
  ~Lease() { master_.busy_ = false; }
  Lease(const Lease&) = delete;
  Lease& operator=(const Lease&) = delete;
  AndMaster& master_;
};

AndMaster::AndMaster(can::Dispatcher& dispatcher) : exchanges_(dispatcher) { dispatcher.add(and_answers, *this); }

void AndMaster::received(const can::Frame& frame, rt::Time at) noexcept {
  if (!exchanges_.open()) return;  // belongs to the previous request
  const auto answer = decode_and_answer(frame);
  if (!answer || answer->kind != wanted_) return;
  if (wanted_ == AndAnswer::Kind::address && answer->nibble != part_) return;
  if (frames_++ == 0) first_ = at;
  if (answer->kind == AndAnswer::Kind::address) {
    differ_ |= frames_ > 1 && (answer->first != last_.first || answer->second != last_.second);
    last_ = *answer;
  } else {
    heard_ = static_cast<std::uint16_t>(heard_ | 1U << answer->nibble);
  }
  exchanges_.heard(at);
}

rt::Task<Result<void>> AndMaster::tell(const can::Frame& frame) {
  const nodeid::WindowTimes times{};
  const auto sent = co_await exchanges_.request(frame, times);
  if (!sent) co_return fail(sent.error());
  co_return Result<void>{};
}

rt::Task<Result<void>> AndMaster::switch_global(nodeid::Identification state) {
  if (busy_) co_return fail(Errc::invalid, and_busy);
  if (state == nodeid::Identification::selected) co_return fail(Errc::invalid, "no slave can be switched to selected");
  const Lease lease(*this);
  const auto frame = and_switch_global(state);
  const auto told = co_await tell(frame);
  co_return told;
}

rt::Task<Result<void>> AndMaster::switch_selective(AndAddress address, nodeid::Identification target) {
  if (busy_) co_return fail(Errc::invalid, and_busy);
  if (target == nodeid::Identification::selected) co_return fail(Errc::invalid, "no slave can be switched to selected");
  const Lease lease(*this);
  const auto frame = and_switch_selective(address, target);
  const auto told = co_await tell(frame);
  co_return told;
}

// One request, its window and T_proc. True when a slave answered.
rt::Task<Result<bool>> AndMaster::ask(Run& run, const can::Frame& frame, AndAnswer::Kind kind) {
  wanted_ = kind;
  heard_ = 0;
  frames_ = 0;
  differ_ = false;
  ++run.report.requests;
  const auto times = run.times(kind);
  const auto sent = co_await exchanges_.request(frame, times);
  if (!sent) co_return fail(sent.error());
  const auto pause = run.options.discovery.t_proc;
  if (pause.count() > 0) co_await rt::sleep_for(pause);
  co_return frames_ > 0;
}

// One device: the remaining phases, then DIRS.
rt::Task<Result<AndMaster::Outcome>> AndMaster::procedure(Run& run) {
  using Kind = AndAnswer::Kind;
  run.last = {};
  if (run.next == 0) run.left = {};
  for (unsigned phase = run.next; phase < and_direct_phase; ++phase) {
    const auto frame = and_iurs(phase, run.path);
    const auto answered = co_await ask(run, frame, Kind::ius);
    if (!answered) co_return fail(answered.error());
    if (!*answered) co_return phase == 0 ? Outcome::nobody : Outcome::silent;
    const auto lowest = static_cast<std::uint8_t>(std::countr_zero(heard_));
    run.path = run.path.prefix(phase).with(phase, lowest);
    run.left[phase] = static_cast<std::uint16_t>(heard_ & (heard_ - 1U));
  }
  const auto frame = and_dirs(run.path);
  const auto answered = co_await ask(run, frame, Kind::dis);
  if (!answered) co_return fail(answered.error());
  if ((heard_ >> run.path.nibble(11) & 1U) == 0) {
    // Its DIS may have been late or lost: without this no master would ever find it.
    const auto back = and_switch_selective(run.path, nodeid::Identification::unknown);
    const auto told = co_await tell(back);
    if (!told) co_return fail(told.error());
    co_return Outcome::silent;
  }
  run.last = {.short_address = run.path, .at = first_, .dis_frames = frames_, .ambiguous = frames_ > 1};
  co_return Outcome::found;
}

// The whole LSS address of the slave that sent the last DIS.
rt::Task<Result<void>> AndMaster::inquire(Run& run, AndFound& device) {
  LssAddress address;
  for (unsigned part = 0; part < 2; ++part) {
    const auto frame = and_inquire(part);
    part_ = static_cast<std::uint8_t>(part);
    bool told = false;
    for (run.streak = 0; !told && run.streak <= run.options.discovery.retries; ++run.streak) {
      const auto answered = co_await ask(run, frame, AndAnswer::Kind::address);
      if (!answered) co_return fail(answered.error());
      told = *answered;
    }
    run.streak = 0;
    device.ambiguous |= differ_;
    if (!told) co_return Result<void>{};
    (part == 0 ? address.vendor : address.revision) = last_.first;
    (part == 0 ? address.product : address.serial) = last_.second;
  }
  // Halves from two devices may form an address of neither; it must also be the found address.
  if (!device.ambiguous && AndAddress(address) == device.short_address) device.address = address;
  co_return Result<void>{};
}

// Enters run.last into the report.
rt::Task<Result<void>> AndMaster::record(Run& run) {
  auto& found = run.report.found;
  if (run.options.inquire) {
    const auto inquired = co_await inquire(run, run.last);
    if (!inquired) co_return fail(inquired.error());
  }
  auto device = std::ranges::find(found, run.last.short_address, &AndFound::short_address);
  const bool again = device != found.end();
  if (again) {
    ++device->times_found;
    device->ambiguous |= device->address != run.last.address;
  } else {
    found.push_back(run.last);
    device = found.end() - 1;
    run.report.known = exchanges_.dispatcher().executor().now();
  }
  if (run.observer != nullptr) run.observer->found(*device);
  if (!again) co_return Result<void>{};
  const auto frame = and_switch_selective(run.last.short_address, nodeid::Identification::identified);
  const auto told = co_await tell(frame);
  co_return told;
}

rt::Task<Result<AndReport>> AndMaster::discover(const AndOptions& options, AndObserver* observer) {
  using End = nodeid::DiscoveryReport::End;
  if (busy_) co_return fail(Errc::invalid, and_busy);
  const Lease lease(*this);
  Run run{.options = options, .observer = observer};
  auto& report = run.report;
  report.began = report.known = exchanges_.dispatcher().executor().now();
  for (bool more = true; more;) {
    const auto outcome = co_await procedure(run);
    if (!outcome) co_return fail(outcome.error());
    if (*outcome == Outcome::nobody) break;
    if (*outcome == Outcome::silent) {
      ++report.restarts;
      run.next = 0;
      if (++run.streak <= options.discovery.retries) continue;
      report.end = End::gave_up;
      break;
    }
    run.streak = 0;
    const auto recorded = co_await record(run);
    if (!recorded) co_return fail(recorded.error());
    run.go_on();
    const auto often = [](const AndFound& d) { return d.times_found >= nodeid::most_times_found; };
    if (std::ranges::any_of(report.found, often)) report.end = End::stuck;
    if (report.found.size() >= options.discovery.most_devices) report.end = End::limit;
    const bool stops = report.end == End::complete && observer != nullptr && !observer->goes_on();
    if (stops) report.end = End::stopped;
    more = report.end == End::complete;
  }
  report.ended = exchanges_.dispatcher().executor().now();
  co_return std::move(report);
}

rt::Task<Result<bool>> AndMaster::any_unknown(const AndOptions& options) {
  if (busy_) co_return fail(Errc::invalid, and_busy);
  const Lease lease(*this);
  Run run{.options = options};
  const auto frame = and_iurs(0, run.path);
  co_return co_await ask(run, frame, AndAnswer::Kind::ius);
}

}  // namespace berth::research

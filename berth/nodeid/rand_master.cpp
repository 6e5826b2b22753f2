#include "berth/nodeid/rand_master.hpp"

#include <algorithm>
#include <utility>

#include "berth/can/empty_bus.hpp"
#include "berth/can/full_queue.hpp"

namespace berth::nodeid {

// ---- one request and its window ---------------------------------------------------------------------------------

Collect::~Collect() { end(); }

bool Collect::start() noexcept {
  master_->current_ = this;
  master_->heard_.clear();
  limit_ = executor().now() + waits_.send_timeout;
  send();
  return true;
}

void Collect::send() noexcept {
  executor().at(limit_, *this);
  switch (master_->dispatcher_->send(frame_, *this)) {
    case can::Queued::yes: break;
    case can::Queued::full: executor().at(can::again_at(executor().now(), limit_), *this); break;
    default: fail_with("the port does not take a RAND request");
  }
}

void Collect::sent(rt::Time at) noexcept {
  outcome_ = at;
  if (waits_.window.count() == 0) {
    end();
    finish();
    return;
  }
  listening_ = true;
  limit_ = at + waits_.most;
  const auto first = at + (waits_.first.count() > 0 ? waits_.first : waits_.window);
  executor().at(waits_.most.count() == 0 ? first : std::min(first, limit_), *this);
}

void Collect::heard(rt::Time at) noexcept {
  if (waits_.most.count() > 0) executor().at(std::min(at + waits_.window, limit_), *this);
}

// The only timer: for the confirmation, then for the window.
void Collect::run() noexcept {
  if (!listening_) return executor().now() < limit_ ? send() : fail_with(can::no_acknowledge);
  end();
  finish();
}

void Collect::fail_with(const char* text) noexcept {
  outcome_ = fail(Errc::bus, text);
  end();
  finish();
}

void Collect::end() noexcept {
  cancel();
  if (master_->current_ != this) return;
  master_->current_ = nullptr;
  master_->dispatcher_->withdraw(*this);
}

// ---- the master ---------------------------------------------------------------------------------------------------

const char* name(DiscoveryReport::End end) noexcept {
  switch (end) {
    case DiscoveryReport::End::complete: return "complete";
    case DiscoveryReport::End::gave_up: return "gave up";
    case DiscoveryReport::End::stuck: return "stuck";
    case DiscoveryReport::End::limit: return "limit";
    case DiscoveryReport::End::stopped: return "stopped";
  }
  return "?";
}

struct RandMaster::Run {
  const DiscoveryOptions& options;
  DiscoveryObserver* observer;
  PhaseEvent::Kind kind = PhaseEvent::Kind::identify;
  unsigned streak = 0;  // restarts since the last device was found
  DiscoveryReport report{};
  Discovered last{};  // the result of the procedure

  [[nodiscard]] Collect::Waits waits(bool direct) const noexcept {
    const unsigned factor = options.widen ? 1U << std::min(streak, 4U) : 1U;
    Collect::Waits w{.send_timeout = options.send_timeout};
    if (options.window == DiscoveryOptions::Window::fixed) {
      w.window = factor * (direct && options.direct.count() > 0 ? options.direct : options.collect);
    } else {
      w.window = factor * options.t_resp;
      w.first = factor * options.first;
      w.most = factor * std::max({options.most, options.t_resp, options.first});
    }
    return w;
  }
};

struct RandMaster::Lease {
  explicit Lease(RandMaster& master) noexcept : master_(master) { master_.busy_ = true; }
  ~Lease() { master_.busy_ = false; }
  Lease(const Lease&) = delete;
  Lease& operator=(const Lease&) = delete;
  RandMaster& master_;
};

namespace {
constexpr std::size_t most_heard = 256;  // the lowest distinct chunks of one window that are kept
constexpr const char* rand_busy = "another RAND procedure is under way";
}  // namespace

RandMaster::RandMaster(can::Dispatcher& dispatcher) : dispatcher_(&dispatcher) {
  heard_.reserve(most_heard);
  dispatcher.add(ius_answers, *this);
  dispatcher.add(dis_answers, *this);
}

void RandMaster::received(const can::Frame& frame, rt::Time at) noexcept {
  if (current_ == nullptr || !current_->listening_) return;  // before `sent`: belongs to the previous request
  const auto answer = decode_rand_answer(frame);
  if (!answer || answer->direct != direct_) return;
  note(answer->chunk, at);
  current_->heard(at);
}

void RandMaster::note(std::uint16_t chunk, rt::Time at) noexcept {
  const auto place = std::ranges::lower_bound(heard_, chunk, {}, &Heard::chunk);
  if (place != heard_.end() && place->chunk == chunk) {
    if (place->times < 0xFFFF) ++place->times;
    return;
  }
  const auto index = place - heard_.begin();
  if (heard_.size() == most_heard) {
    if (place == heard_.end()) return;
    heard_.pop_back();
  }
  heard_.insert(heard_.begin() + index, Heard{.chunk = chunk, .times = 1, .first = at});
}

Collect RandMaster::request(const can::Frame& frame, const Collect::Waits& waits) noexcept {
  return {*this, frame, waits};
}

rt::Task<Result<void>> RandMaster::switch_global(Identification state) {
  if (busy_) co_return fail(Errc::invalid, rand_busy);
  if (state == Identification::selected) co_return fail(Errc::invalid, "no slave can be switched to selected");
  const Lease lease(*this);
  const auto frame = switch_identification_global(state);
  const Collect::Waits waits{.send_timeout = DiscoveryOptions{}.send_timeout};
  const auto sent = co_await request(frame, waits);
  if (!sent) co_return fail(sent.error());
  co_return Result<void>{};
}

rt::Task<Result<void>> RandMaster::switch_selective(LssAddress address, Identification target, rt::Duration inhibit) {
  if (busy_) co_return fail(Errc::invalid, rand_busy);
  const Lease lease(*this);
  const Collect::Waits waits{.window = inhibit, .send_timeout = DiscoveryOptions{}.send_timeout};
  for (unsigned part = 0; part < 4; ++part) {
    const auto frame = switch_identification_selective(address, part, target);
    const auto sent = co_await request(frame, waits);
    if (!sent) co_return fail(sent.error());
  }
  co_return Result<void>{};
}

// As switch_selective, within a discovery.
rt::Task<Result<void>> RandMaster::tell(Run& run, LssAddress address, Identification target) {
  const Collect::Waits waits{.window = run.options.inhibit, .send_timeout = run.options.send_timeout};
  for (unsigned part = 0; part < 4; ++part) {
    const auto frame = switch_identification_selective(address, part, target);
    const auto sent = co_await request(frame, waits);
    if (!sent) co_return fail(sent.error());
  }
  co_return Result<void>{};
}

// One request, its window and T_proc. True when a slave answered; for DIRS, when the asked chunk did.
rt::Task<Result<bool>> RandMaster::ask(Run& run, unsigned phase, std::uint16_t mask) {
  direct_ = phase == direct_phase;
  const auto frame = direct_ ? dirs(mask) : iurs(phase, mask);
  const auto waits = run.waits(direct_);
  ++run.report.requests;
  const auto sent = co_await request(frame, waits);
  if (!sent) co_return fail(sent.error());
  bool answered = !heard_.empty();
  if (direct_) answered = std::ranges::find(heard_, mask, &Heard::chunk) != heard_.end();
  if (run.observer != nullptr) {
    auto kind = run.kind;
    if (direct_ && kind == PhaseEvent::Kind::identify) kind = PhaseEvent::Kind::direct;
    const auto chosen = answered ? (direct_ ? mask : heard_.front().chunk) : std::uint16_t{0};
    run.observer->phase({.kind = kind,
                         .phase = phase,
                         .mask = phase > 0 ? mask : std::uint16_t{0},
                         .sent = *sent,
                         .ended = dispatcher_->executor().now(),
                         .heard = heard_,
                         .answered = answered,
                         .chosen = chosen});
  }
  if (run.options.t_proc.count() > 0) {
    const auto pause = run.options.t_proc;
    co_await rt::sleep_for(pause);
  }
  co_return answered;
}

// One pass of phases 0 to 7 and DIRS: finds the lowest unknown device (paper 1 §II; S1.17, S1.18).
rt::Task<Result<RandMaster::Outcome>> RandMaster::procedure(Run& run) {
  run.last = {};
  std::array<std::uint16_t, 8> chunks{};
  std::uint16_t mask = 0;
  unsigned silent_phase = 0;
  for (unsigned phase = 0; phase <= direct_phase; ++phase) {
    const auto answered = co_await ask(run, phase, mask);
    if (!answered) co_return fail(answered.error());
    silent_phase = phase;
    if (!*answered) break;
    if (phase == direct_phase) {
      const auto& heard = *std::ranges::find(heard_, mask, &Heard::chunk);
      run.last.at = heard.first;
      run.last.dis_frames = heard.times;
    } else {
      run.last.distinct[phase] = static_cast<std::uint16_t>(heard_.size());
      mask = heard_.front().chunk;
      chunks[phase] = mask;
    }
  }
  const auto join = [&](unsigned i) {
    return static_cast<std::uint32_t>(chunks[i]) << 16 | static_cast<std::uint32_t>(chunks[i + 1]);
  };
  run.last.address = {join(0), join(2), join(4), join(6)};
  if (run.last.dis_frames > 0) co_return Outcome::found;
  if (silent_phase == 0) co_return Outcome::nobody;
  if (silent_phase == direct_phase) {
    // It may have answered too late or unheard, and consider itself identified: without this no master would ever find
    // it.
    const auto told = co_await tell(run, run.last.address, Identification::unknown);
    if (!told) co_return fail(told.error());
  }
  if (run.observer != nullptr) run.observer->restarted(silent_phase, dispatcher_->executor().now());
  co_return Outcome::silent;
}

// Asks one address a second time: true if DIS comes twice again (S1.22).
rt::Task<Result<bool>> RandMaster::asked_again(Run& run, LssAddress address) {
  const auto woken = co_await tell(run, address, Identification::unknown);
  if (!woken) co_return fail(woken.error());
  run.kind = PhaseEvent::Kind::confirm;
  bool answered = true;
  for (unsigned phase = 0; phase <= direct_phase && answered; ++phase) {
    const auto mask = phase == 0 ? std::uint16_t{0} : address.chunk(phase - 1);
    const auto asked = co_await ask(run, phase, mask);
    if (!asked) co_return fail(asked.error());
    answered = *asked;
  }
  run.kind = PhaseEvent::Kind::identify;
  if (answered) {
    const auto place = std::ranges::find(heard_, address.chunk(7), &Heard::chunk);
    co_return place != heard_.end() && place->times > 1;
  }
  const auto left = co_await tell(run, address, Identification::identified);
  if (!left) co_return fail(left.error());
  co_return false;
}

// Enters run.last into the report.
rt::Task<Result<void>> RandMaster::record(Run& run) {
  auto& found = run.report.found;
  auto device = std::ranges::find(found, run.last.address, &Discovered::address);
  const bool again = device != found.end();
  if (again) {
    ++device->times_found;
  } else {
    found.push_back(run.last);
    device = found.end() - 1;
  }
  const auto index = device - found.begin();
  if (run.observer != nullptr) run.observer->found(found[index]);
  if (again) {
    const auto told = co_await tell(run, run.last.address, Identification::identified);
    if (!told) co_return fail(told.error());
  }
  const bool suspect = (again || run.last.dis_frames > 1) && !found[index].possible_clone;
  if (!suspect) co_return Result<void>{};
  bool twice = true;
  if (run.options.confirm_clones) {
    const auto repeated = co_await asked_again(run, run.last.address);
    if (!repeated) co_return fail(repeated.error());
    twice = *repeated;
  }
  if (twice) {
    found[index].possible_clone = true;
    if (run.observer != nullptr) run.observer->found(found[index]);
  }
  co_return Result<void>{};
}

rt::Task<Result<DiscoveryReport>> RandMaster::discover(const DiscoveryOptions& options, DiscoveryObserver* observer) {
  using End = DiscoveryReport::End;
  if (busy_) co_return fail(Errc::invalid, rand_busy);
  const Lease lease(*this);
  Run run{.options = options, .observer = observer};
  auto& report = run.report;
  report.began = dispatcher_->executor().now();
  for (bool more = true; more;) {
    const auto outcome = co_await procedure(run);
    if (!outcome) co_return fail(outcome.error());
    if (*outcome == Outcome::nobody) break;
    if (*outcome == Outcome::silent) {
      ++report.restarts;
      if (++run.streak <= options.retries) continue;
      report.end = End::gave_up;
      break;
    }
    run.streak = 0;
    const auto recorded = co_await record(run);
    if (!recorded) co_return fail(recorded.error());
    const auto often = [](const Discovered& d) { return d.times_found >= most_times_found; };
    if (std::ranges::any_of(report.found, often)) report.end = End::stuck;
    if (report.found.size() >= options.most_devices) report.end = End::limit;
    const bool stops = report.end == End::complete && observer != nullptr && !observer->goes_on();
    if (stops) report.end = End::stopped;
    more = report.end == End::complete;
  }
  report.ended = dispatcher_->executor().now();
  co_return std::move(report);
}

rt::Task<Result<UnknownReport>> RandMaster::any_unknown(const DiscoveryOptions& options, DiscoveryObserver* observer) {
  if (busy_) co_return fail(Errc::invalid, rand_busy);
  const Lease lease(*this);
  Run run{.options = options, .observer = observer, .kind = PhaseEvent::Kind::any_unknown};
  const auto answered = co_await ask(run, 0, 0);
  if (!answered) co_return fail(answered.error());
  UnknownReport report{.anybody = *answered, .heard = heard_};
  co_return report;
}

}  // namespace berth::nodeid

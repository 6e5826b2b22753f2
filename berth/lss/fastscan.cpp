#include "berth/lss/fastscan.hpp"

#include <algorithm>
#include <utility>

#include "berth/lss/select_alone.hpp"

namespace berth::lss {
namespace {

constexpr unsigned width_of(Feedback feedback) noexcept { return feedback == Feedback::base ? 4 : 16; }

}  // namespace

const char* name(FastscanReport::End end) noexcept {
  switch (end) {
    case FastscanReport::End::complete: return "complete";
    case FastscanReport::End::gave_up: return "gave up";
    case FastscanReport::End::held: return "held";
    case FastscanReport::End::limit: return "limit";
    case FastscanReport::End::stuck: return "stuck";
    case FastscanReport::End::stopped: return "stopped";
  }
  return "?";
}

// ---- from the whole procedure down to one request -------------------------------------------------------------------

rt::Task<Result<FastscanReport>> Fastscan::discover(FastscanOwner& owner) {
  using End = FastscanReport::End;
  FastscanReport report;
  report.began = master_->now();
  const unsigned requests_before = requests_;
  const unsigned restarts_before = restarts_;
  if (options_.wait_first) {
    const auto waiting = co_await master_->switch_global(State::waiting);
    if (!waiting) co_return fail(waiting.error());
  }
  unsigned streak = 0;  // devices in a row that were found and took no node-ID
  for (bool more = true; more;) {
    const auto found = co_await scan();
    if (!found && found.error().code != Errc::timeout) co_return fail(found.error());
    if (!found) report.end = End::gave_up;
    if (!found || !*found) break;
    const bool told = std::ranges::find(report.found, device_.address, &FastscanDevice::address) != report.found.end();
    if (!told) report.known = device_.at;
    Result<End> end = End::stuck;
    if (options_.confirm && told) {
      end = co_await leave(report);
    } else {
      end = co_await give(report, owner);
    }
    if (!end) co_return fail(end.error());
    streak = *end == End::gave_up ? streak + 1 : 0;
    const bool again = *end == End::gave_up && streak <= options_.retries;
    if (!again) report.end = *end;
    if (report.found.size() >= options_.most_devices) report.end = End::limit;
    const bool stops = report.end == End::complete && !owner.goes_on();
    if (stops) report.end = End::stopped;
    more = report.end == End::complete;
  }
  report.requests = requests_ - requests_before;
  report.restarts = restarts_ - restarts_before;
  report.ended = master_->now();
  co_return std::move(report);
}

// The device was found and got a node-ID before, but keeps answering: another node-ID would not end that either.
rt::Task<Result<FastscanReport::End>> Fastscan::leave(FastscanReport& report) {
  const auto waiting = co_await master_->switch_global(State::waiting);
  if (!waiting) co_return fail(waiting.error());
  const auto known = std::ranges::find(report.found, device_.address, &FastscanDevice::address);
  known->possible_clone = known->possible_clone || device_.possible_clone;
  co_return FastscanReport::End::stuck;
}

// Empty: a device in configuration that missed the proof answered, too, and would hear the 11h.
rt::Task<Result<std::optional<NodeId>>> Fastscan::active_id() {
  const ServiceOptions service{
      .timeout = options_.window, .retries = 0, .full_window = false, .listen = window_of(*master_)};
  const auto told = co_await master_->inquire_node_id(service);
  std::optional<NodeId> id;
  const bool others = told && suspicious(*told);
  if (others) master_->suspect_strangers();
  if (others) co_return id;
  if (told) id = NodeId::make(told->byte()).value_or(NodeId());
  if (told) co_return id;
  if (told.error().code != Errc::timeout) co_return fail(told.error());
  master_->suspect_strangers();  // its answer may come during the next question
  id = NodeId();
  co_return id;
}

// The device in configuration gets a node-ID and goes back to waiting; there it takes the node-ID and boots (S4.18).
rt::Task<Result<FastscanReport::End>> Fastscan::give(FastscanReport& report, FastscanOwner& owner) {
  using End = FastscanReport::End;
  // Two devices with one address would take one node-ID; `prove_alone` has sent them back to waiting.
  const bool clones = options_.confirm && device_.possible_clone;
  if (options_.confirm && !clones) {
    const auto active = co_await active_id();
    if (!active) co_return fail(active.error());
    if (!*active) co_return co_await give_up();
    device_.active = **active;
  }
  const bool seated = device_.active.configured();
  const NodeId id = clones || seated ? NodeId() : owner.assign(device_);
  auto end = End::complete;
  if (id.configured() && options_.confirm) {
    const AloneOptions how{.vacancy = &owner};
    const auto given = co_await configure_alone(*master_, device_.address, id, options_.store, how);
    if (!given) co_return fail(given.error());
    const bool refused = given->outcome == Given::Outcome::refused;
    if (given->outcome != Given::Outcome::taken) end = refused ? End::held : End::gave_up;
    device_.stored = given->stored;
  } else if (id.configured()) {
    const auto configured = co_await master_->configure_node_id(id);
    if (!configured && configured.error().code != Errc::timeout && configured.error().code != Errc::aborted) {
      co_return fail(configured.error());
    }
    if (!configured) end = configured.error().code == Errc::timeout ? End::gave_up : End::held;
  } else {
    end = seated ? End::stuck : End::held;
  }
  if (end == End::complete) device_.assigned = id;
  if (end == End::complete && options_.store && !options_.confirm) {
    const auto stored = co_await master_->store();
    device_.stored = stored.has_value();
  }
  const auto waiting = co_await master_->switch_global(State::waiting);
  if (!waiting) co_return fail(waiting.error());
  if (end == End::gave_up) {
    ++restarts_;
    co_return end;
  }
  report.found.push_back(device_);
  if (end == End::complete || seated) owner.assigned(device_);
  co_return end;
}

rt::Task<Result<FastscanReport::End>> Fastscan::give_up() {
  const auto waiting = co_await master_->switch_global(State::waiting);
  if (!waiting) co_return fail(waiting.error());
  ++restarts_;
  co_return FastscanReport::End::gave_up;
}

rt::Task<Result<std::optional<FastscanDevice>>> Fastscan::scan() {
  for (unsigned attempt = 0; attempt <= options_.retries; ++attempt) {
    const auto outcome = co_await once();
    if (!outcome) co_return fail(outcome.error());
    if (*outcome == Outcome::nobody) {
      std::optional<FastscanDevice> nobody;
      co_return nobody;
    }
    if (*outcome == Outcome::found) {
      std::optional<FastscanDevice> found = device_;
      co_return found;
    }
    ++restarts_;
    // A device may be in configuration unheard: 80h would then never find it.
    const auto waiting = co_await master_->switch_global(State::waiting);
    if (!waiting) co_return fail(waiting.error());
  }
  co_return fail(Errc::timeout, "a device answers LSS Fastscan and cannot be identified");
}

// As in CiA 305: asks whether a device is there, then for its vendor-ID, product code, revision number and serial
// number.
rt::Task<Result<Fastscan::Outcome>> Fastscan::once() {
  device_ = {};
  const unsigned before = requests_;
  const FastscanRequest start;
  auto anybody = co_await ask(start);
  // Feedback is sent before the answer, which other frames may delay beyond the window.
  const bool late = anybody && !*anybody && heard_.count > 0;
  if (late) anybody = co_await ask(start);
  if (!anybody) co_return fail(anybody.error());
  if (!*anybody) co_return Outcome::nobody;
  std::array<std::uint32_t, 4> parts{};
  for (std::uint8_t sub = 0; sub < 4; ++sub) {
    const auto known = co_await part(sub);
    if (!known) co_return fail(known.error());
    if (!*known) co_return Outcome::lost;
    parts[sub] = id_;
  }
  device_.address = {parts[0], parts[1], parts[2], parts[3]};
  device_.requests = requests_ - before;
  device_.at = master_->now();
  device_.possible_clone = heard_.answers > 1;
  if (!options_.confirm) co_return Outcome::found;
  const auto confirmation = co_await confirmed();
  if (!confirmation) co_return fail(confirmation.error());
  co_return *confirmation ? Outcome::found : Outcome::lost;
}

// One part: by feedback as long as there is any, then bit by bit. True: it was confirmed as a whole, and the next part
// was asked for.
rt::Task<Result<bool>> Fastscan::part(std::uint8_t sub) {
  id_ = 0;
  unsigned unknown = 32;  // in bits
  while (unknown > 0 && heard_.count > 0) {
    unknown -= width_of(options_.feedback);
    const auto found = co_await chunk(sub, unknown);
    if (!found) co_return fail(found.error());
    if (!*found) co_return false;
  }
  if (unknown == 0) co_return true;
  const bool merged = options_.form != FastscanForm::standard;
  for (unsigned bit = unknown; bit-- > 0;) {
    const std::uint32_t one = 1U << bit;
    if ((options_.known_bits.part(sub) & one) != 0) {
      id_ |= options_.known.part(sub) & one;
      continue;
    }
    const bool last = merged && bit == 0;
    const std::uint8_t next = last ? after(sub) : sub;
    const auto zero = co_await ask(sub, bit, next);
    if (!zero) co_return fail(zero.error());
    if (*zero && last) co_return true;
    if (!*zero) id_ |= one;
  }
  // The bits that are 1 were never confirmed: they were inferred from silence.
  const std::uint8_t next = after(sub);
  co_return co_await ask(sub, 0, next);
}

// Paper 4: asks for the lowest value that was heard, in one message. Silence: no device has this value, or none has it
// any more.
rt::Task<Result<bool>> Fastscan::chunk(std::uint8_t sub, unsigned shift) {
  const Heard heard = heard_;
  const std::uint32_t before = id_;
  const std::uint8_t next = shift == 0 ? after(sub) : sub;
  for (unsigned i = 0; i < heard.count; ++i) {
    id_ = before | static_cast<std::uint32_t>(heard.values[i]) << shift;
    const auto answered = co_await ask(sub, shift, next);
    if (!answered) co_return fail(answered.error());
    if (*answered) co_return true;
  }
  co_return false;
}

rt::Task<Result<bool>> Fastscan::ask(std::uint8_t sub, unsigned bit, std::uint8_t next) {
  FastscanRequest request{.id = id_, .bit_checked = static_cast<std::uint8_t>(bit), .sub = sub, .next = next};
  co_return co_await ask(request);
}

rt::Task<Result<bool>> Fastscan::ask(FastscanRequest request) {
  const ServiceOptions whole_window{.timeout = options_.window, .retries = 0, .full_window = true};
  ++requests_;
  const auto reply = co_await master_->fastscan(request, whole_window);
  if (!reply) co_return fail(reply.error());
  const bool upper_half_confirmed = !request.starts() && request.bit_checked == 16;
  keep(*reply, upper_half_confirmed);
  co_return reply->answers > 0;
}

// The match brought the device into configuration. There it reports its address itself, and 40h to 43h are not served.
// A device that lost a `04 00` is in configuration, too, and would take the same node-ID.
rt::Task<Result<bool>> Fastscan::confirmed() {
  const AloneOptions followed{.followed = true};
  const auto selection = co_await prove_alone(*master_, device_.address, followed);
  if (!selection) co_return fail(selection.error());
  device_.possible_clone = *selection == Selection::clones;
  co_return *selection == Selection::alone || *selection == Selection::clones;
}

std::uint8_t Fastscan::after(std::uint8_t sub) const noexcept {
  if (sub < 3) return static_cast<std::uint8_t>(sub + 1);
  return options_.form == FastscanForm::literal ? FastscanRequest::after_last : std::uint8_t{0};
}

// Values of the half that was asked for come before others, which are late, or come from a slave that toggles in its
// own way.
void Fastscan::keep(const Reply& reply, bool lower) noexcept {
  heard_ = {.answers = reply.answers};
  for (const bool fitting : {true, false}) {
    for (const auto& h : reply.feedback) {
      const bool fits = h.feedback.kind == Feedback::base || h.feedback.toggle == lower;
      if (h.feedback.kind != options_.feedback || fits != fitting || heard_.count == heard_.values.size()) continue;
      heard_.values[heard_.count++] = h.feedback.value;
    }
  }
}

}  // namespace berth::lss

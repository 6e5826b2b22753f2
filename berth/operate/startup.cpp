#include "berth/operate/startup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace berth::operate {

using co::NmtCommand;
using manager::StartupPhase;
using places::SlotState;

Startup::Startup(BusServices& services, SlotTable& slots) noexcept
    : s_(services), slots_(slots), boot_time_over_(*this, services.executor) {}

void Startup::begin() {
  s_.nmt.set_inhibit(s_.bus.startup.nmt_inhibit);
  master_operational_ = released_ = false;
  has_mandatory_ = std::ranges::any_of(slots_.seats(), [](const auto& s) { return s->slot.spec.mandatory; });
  error_.reset();
  halted_by_.clear();
  boot_time_over_.cancel();
  if (!s_.may_command()) return phase_.end();
  phase_.begin(s_.bus.startup.rules);
  if (has_mandatory_ && s_.bus.startup.boot_time.count() > 0) boot_time_over_.arm(s_.bus.startup.boot_time);
}

void Startup::end() noexcept {
  phase_.end();
  boot_time_over_.cancel();
}

void Startup::tell(const std::string& text) { slots_.events().tell(EventKind::startup, "", text); }

manager::SlaveRules Startup::rules_of(const Seat& seat) {
  const places::SlotSpec& spec = seat.slot.spec;
  manager::SlaveRules rules;
  rules.assigned = rules.boots = true;
  rules.mandatory = spec.mandatory;
  rules.device_type = spec.device_type;
  if (const auto device = seat.slot.record.device()) {
    rules.vendor = device->vendor;
    rules.product = device->product;
    rules.revision = device->revision;
    rules.serial = device->serial;
  }
  return rules;
}

// ---- when devices are started ---------------------------------------------------------------------------------------

const Seat* Startup::missing() const noexcept {
  const auto it = std::ranges::find_if(
      slots_.seats(), [](const auto& s) { return s->slot.spec.mandatory && !(s->there && s->boot.ready); });
  return it == slots_.seats().end() ? nullptr : it->get();
}

// Its boot-up has ended, and not well. One that is silent is waited for, as long as the boot time is not over.
const Seat* Startup::failed() const noexcept {
  const auto it = std::ranges::find_if(slots_.seats(), [](const auto& s) {
    const bool bad =
        s->state == SlotState::failed || s->state == SlotState::wrong_type || s->state == SlotState::duplicate;
    return s->slot.spec.mandatory && bad;
  });
  return it == slots_.seats().end() ? nullptr : it->get();
}

std::string Startup::why_waiting() const {
  if (phase_.is(Phase::stopped)) return "ready; the network is stopped: `berth nmt start all` starts it";
  if (phase_.is(Phase::halted)) {
    return fmt::format("ready; the startup is halted: slot \"{}\" is mandatory and not ready", halted_by_);
  }
  if (phase_.application_starts()) return "ready; `berth nmt start` starts it (start = \"by-hand\")";
  if (const Seat* const seat = missing(); seat != nullptr) {
    return fmt::format("ready; it is started when slot \"{}\" is ready, which is mandatory", seat->name());
  }
  return fmt::format("ready; it is started when the master is: `berth nmt start {}`", s_.bus.master.value());
}

bool Startup::starts(Seat& seat) {
  seat.boot.ready = true;
  const bool now = seat.boot.released || phase_.starts(rules_of(seat), master_operational_);
  seat.boot.waits = !now;
  seat.started = true;
  if (!now) slots_.set_state(seat, SlotState::present, why_waiting());
  return now;
}

bool Startup::goes_on() {
  if (const Seat* const seat = failed(); seat != nullptr && phase_.is(Phase::booting)) halt(*seat, seat->reason);
  const bool released = std::exchange(released_, false);
  if (missing() != nullptr) {
    tell_the_waiting();
    return false;
  }
  if (phase_.is(Phase::halted)) {
    tell(fmt::format("the startup goes on: slot \"{}\" is ready", halted_by_));
    phase_.resume();
  }
  const bool now = phase_.all_ready();
  if (!now && !released) return false;
  boot_time_over_.cancel();
  if (now && has_mandatory_) tell("all mandatory devices are ready");
  if (now && has_mandatory_ && phase_.operates_itself()) make_operational();
  const bool starts = !together() || master_operational_;
  if (!starts) tell_the_waiting();
  return starts;
}

// Why a device waits changes while it does.
void Startup::tell_the_waiting() {
  for (const auto& seat : slots_.seats()) {
    if (seat->boot.waits && seat->there) slots_.set_state(*seat, SlotState::present, why_waiting());
  }
}

void Startup::make_operational() noexcept {
  master_operational_ = true;
  if (master_ != nullptr) master_->apply(NmtCommand::start);
  phase_.operate();
}

void Startup::network_operational() noexcept {
  const bool stays = s_.bus.startup.rules.application_operates || phase_.is(Phase::stopped);
  if (!stays && s_.may_command()) make_operational();
}

void Startup::halt(const Seat& seat, const std::string& why) {
  boot_time_over_.cancel();
  if (!phase_.halt()) return;
  halted_by_ = seat.name();
  tell(fmt::format("the startup is halted: slot \"{}\", which is mandatory: {}", seat.name(), why));
}

void Startup::boot_time_over() noexcept {
  const Seat* const seat = missing();
  if (seat == nullptr) return;
  halt(*seat,
       fmt::format("it was not ready within the boot time of {}", text::write_duration(s_.bus.startup.boot_time)));
}

// ---- errors ---------------------------------------------------------------------------------------------------------

void Startup::error_event(const Seat& seat, std::string_view what) {
  const auto asks_for = phase_.on_error(rules_of(seat));
  const bool runs = s_.may_command() && !phase_.is(Phase::off) && !phase_.is(Phase::stopped);
  if (!runs || asks_for == StartupPhase::OnError::one) return;
  error_ = ErrorEvent{asks_for, fmt::format("slot \"{}\", which is mandatory: {}", seat.name(), what)};
}

rt::Task<void> Startup::act_on_error() {
  if (!error_) co_return;
  const ErrorEvent error = *std::exchange(error_, std::nullopt);
  const bool stops = error.asks_for == StartupPhase::OnError::stop;
  tell(fmt::format("{}: all devices are {}", error.text, stops ? "stopped" : "reset"));
  const NmtCommand command = stops ? NmtCommand::stop : NmtCommand::reset_node;
  if (stops) {
    stop_all(error.text);
  } else {
    await_all(error.text);
  }
  const auto sent = co_await s_.nmt.send(command, co::NmtTarget::all());
  if (!sent) slots_.events().tell_failure("NMT command to all", sent.error());
  if (master_ != nullptr) master_->apply(command);
}

void Startup::stop_all(const std::string& why) {
  phase_.stop();
  for (const auto& seat : slots_.seats()) {
    if (!seat->there) continue;
    seat->held = true;
    slots_.set_state(*seat, SlotState::present, fmt::format("stopped: {}; `berth nmt start all` starts it", why));
  }
}

// What was known of them belongs to the life before.
void Startup::await_all(const std::string& why) {
  begin();
  for (const auto& seat : slots_.seats()) {
    if (!seat->there) continue;
    seat->there = seat->started = false;
    seat->boot = {};
    slots_.set_state(*seat, SlotState::absent, fmt::format("reset: {}; its boot-up is awaited", why));
  }
}

void Startup::commanded(NmtCommand command, co::NmtTarget target) {
  const bool starts = command == NmtCommand::start;
  if (target.node != 0 && NodeId(target.node) == s_.bus.master) {
    if (master_ != nullptr) master_->apply(command);
    master_operational_ = starts;
    released_ = starts && phase_.is(Phase::ready);
    if (released_) phase_.operate();
    return;
  }
  const bool resets = command == NmtCommand::reset_node || command == NmtCommand::reset_communication;
  for (const auto& seat : slots_.seats()) {
    if (resets && target.includes(seat->id())) seat->boot.ready = false;
  }
  if (!starts) return;
  if (phase_.is(Phase::stopped) && target.node == 0) {
    begin();
    released_ = true;
  }
  for (const auto& seat : slots_.seats()) {
    if (!target.includes(seat->id())) continue;
    seat->boot.released = true;
    seat->boot.waits = false;
  }
}

}  // namespace berth::operate

#include "berth/operate/slot_startup.hpp"

#include <fmt/format.h>

#include <utility>

namespace berth::operate {

using co::NmtCommand;
using network::SlavePhase;
using network::StartupPhase;
using places::SlotState;

SlotStartup::SlotStartup(BusServices& services, SlotTable& slots) noexcept
    : s_(services), slots_(slots), network_(services.executor, *this) {}

void SlotStartup::begin() {
  s_.nmt.set_inhibit(s_.bus.startup.nmt_inhibit);
  released_ = false;
  released_by_master_ = Go::nothing;
  error_.reset();
  halted_by_.clear();
  static_cast<void>(network_.own_state(NmtState::pre_operational));
  if (!s_.may_command()) return network_.end();
  network::NetworkStartup::Plan plan;
  plan.rules = s_.bus.startup.rules;
  plan.boot_time = s_.bus.startup.boot_time;
  plan.resumes = plan.awaits_all = true;
  for (const auto& seat : slots_.seats()) plan.slaves.push_back(&seat->slave);
  network_.begin(std::move(plan));
}

void SlotStartup::tell(const std::string& text) { slots_.events().tell(EventKind::startup, "", text); }

// ---- when devices are started ---------------------------------------------------------------------------------------

bool SlotStartup::is_ready(const network::Slave& slave) const noexcept {
  return slave.status.ready() && slots_.at(slave.what.node)->there();
}

bool SlotStartup::has_failed(const network::Slave& slave) const noexcept {
  const SlotState state = slots_.at(slave.what.node)->state();
  return state == SlotState::failed || state == SlotState::wrong_type || state == SlotState::duplicate;
}

std::string SlotStartup::why_waiting() const {
  if (!s_.may_command()) return "ready; the master of its bus starts it, not this Berth (role)";
  if (network_.is(Phase::stopped)) return "ready; the network is stopped: `berth nmt start all` starts it";
  if (network_.is(Phase::halted)) {
    return fmt::format("ready; the startup is halted: slot \"{}\" is mandatory and not ready", halted_by_);
  }
  if (network_.rules().application_starts) return "ready; `berth nmt start` starts it (start = \"by-hand\")";
  if (const auto* const slave = network_.missing(); slave != nullptr) {
    return fmt::format("ready; it is started when slot \"{}\" is ready, which is mandatory",
                       slots_.at(slave->what.node)->name());
  }
  return fmt::format("ready; it is started when the master is: `berth nmt start {}`", s_.bus.master.value());
}

void SlotStartup::tell_why_waiting(Seat& seat) { slots_.happened(seat, SlotEvent::pauses, why_waiting()); }

SlotStartup::Go SlotStartup::goes_on() {
  released_ = false;
  const Go by_master = std::exchange(released_by_master_, Go::nothing);
  Go go = network_.look();
  if (go == Go::nothing && network_.missing() == nullptr) go = by_master;
  if (go == Go::nothing) tell_the_waiting();
  return go;
}

// The reason why a device waits may change.
void SlotStartup::tell_the_waiting() {
  for (const auto& seat : slots_.seats()) {
    if (seat->slave.waits_for_start() && seat->there()) tell_why_waiting(*seat);
  }
}

void SlotStartup::network_operational() noexcept {
  if (s_.may_command()) network_.all_operational();
}

void SlotStartup::heard(network::NetworkStartup::News news, const network::Slave* slave) noexcept {
  using News = network::NetworkStartup::News;
  if (news == News::resumed) return tell(fmt::format("the startup goes on: slot \"{}\" is ready", halted_by_));
  if (news == News::all_ready && network_.has_mandatory()) return tell("all mandatory devices are ready");
  if (slave == nullptr) return;
  const Seat& seat = *slots_.at(slave->what.node);
  halted_by_ = seat.name();
  const std::string boot_time = text::write_duration(s_.bus.startup.boot_time);
  const std::string late = fmt::format("it was not ready within the boot time of {}", boot_time);
  tell(fmt::format("the startup is halted: slot \"{}\", which is mandatory: {}", seat.name(),
                   news == News::late ? late : seat.reason));
}

void SlotStartup::apply(NmtCommand command) noexcept {
  if (master_ != nullptr) master_->apply(command);
}

// ---- errors ---------------------------------------------------------------------------------------------------------

void SlotStartup::error_event(const Seat& seat, std::string_view what) {
  const auto asks_for = network_.on_error(seat.slave);
  if (!s_.may_command() || !asks_for || *asks_for == StartupPhase::OnError::one) return;
  error_ = ErrorEvent{*asks_for, fmt::format("slot \"{}\", which is mandatory: {}", seat.name(), what)};
}

rt::Task<void> SlotStartup::act_on_error() {
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
  apply(command);
}

void SlotStartup::stop_all(const std::string& why) {
  network_.stop();
  for (const auto& seat : slots_.seats()) {
    if (!seat->there()) continue;
    seat->held = true;
    slots_.happened(*seat, SlotEvent::pauses, fmt::format("stopped: {}; `berth nmt start all` starts it", why));
  }
}

// What is known of the devices dates from before the reset.
void SlotStartup::await_all(const std::string& why) {
  begin();
  for (const auto& seat : slots_.seats()) {
    if (!seat->there()) continue;
    slots_.happened(*seat, SlotEvent::gone, fmt::format("reset: {}; its boot-up is awaited", why));
  }
}

void SlotStartup::commanded(NmtCommand command, co::NmtTarget target) {
  const bool starts = command == NmtCommand::start;
  if (target.node != 0 && NodeId(target.node) == s_.bus.master) {
    apply(command);
    released_by_master_ = network_.own_state(starts ? NmtState::operational : NmtState::pre_operational);
    return;
  }
  const bool resets = command == NmtCommand::reset_node || command == NmtCommand::reset_communication;
  for (const auto& seat : slots_.seats()) {
    // The boot-up after this command is no error.
    if (resets && target.includes(seat->id()) && seat->is_booted()) seat->slave.status.phase = SlavePhase::awaited;
  }
  if (!starts) return;
  if (network_.is(Phase::stopped) && target.node == 0) {
    begin();
    released_ = true;
  }
  for (const auto& seat : slots_.seats()) {
    if (!target.includes(seat->id())) continue;
    seat->slave.released = true;
    if (seat->slave.waits_for_start()) seat->slave.status.phase = SlavePhase::started;
  }
}

}  // namespace berth::operate

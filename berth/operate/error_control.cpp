#include "berth/operate/error_control.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/co/guarding.hpp"
#include "berth/od/abort_code.hpp"

namespace berth::operate {

namespace {

using std::chrono::milliseconds;

constexpr std::uint8_t usual_factor = 3;                // unanswered guarding requests
constexpr unsigned some_resets = 2, enough_resets = 4;  // after writes of 1017h (`HeartbeatRate::resets`)

rt::Duration wanted_period(const design::Timing& timing, const Seat& seat) noexcept {
  const auto& watch = seat.slot.spec.watch;
  return watch.heartbeat_period.count() > 0 ? watch.heartbeat_period : timing.heartbeat_period;
}

rt::Duration guard_time(const design::Timing& timing, const Seat& seat) noexcept {
  const auto& watch = seat.slot.spec.watch;
  if (watch.guard_time.count() > 0) return watch.guard_time;
  return std::max<rt::Duration>(wanted_period(timing, seat), milliseconds(1));
}

std::string text_of(rt::Duration time) {
  return fmt::format("{} ms", std::chrono::duration_cast<milliseconds>(time).count());
}

}  // namespace

rt::Duration heartbeat_time(const design::Timing& timing, const Seat& seat) noexcept {
  return seat.rate.period.count() > 0 ? seat.rate.period : wanted_period(timing, seat);
}

rt::Duration heartbeat_period(const design::Timing& timing, const Seat& seat) noexcept {
  return seat.rate.seen.count() > 0 ? seat.rate.seen : heartbeat_time(timing, seat);
}

rt::Duration heartbeat_timeout(const design::Timing& timing, const Seat& seat) noexcept {
  const auto& watch = seat.slot.spec.watch;
  const rt::Duration period = heartbeat_period(timing, seat);
  const bool says = watch.heartbeat_timeout.count() > 0;
  if (says && period < watch.heartbeat_timeout) return watch.heartbeat_timeout;
  const rt::Duration base = timing.heartbeat_period;
  const bool shorter = watch.heartbeat_period.count() == 0 && period <= base;
  if (shorter || base.count() == 0) return timing.heartbeat_timeout;
  const double times = static_cast<double>(period.count()) / static_cast<double>(base.count());
  return rt::Duration(static_cast<std::int64_t>(times * static_cast<double>(timing.heartbeat_timeout.count())));
}

rt::Task<Result<void>> ErrorControl::write(NodeId id, std::uint16_t period_ms) {
  co_return co_await s_.sdo.write<std::uint16_t>(id, 0x1017, 0, period_ms);
}

// The limits of its 1017h are unknown: the wanted period is doubled, or halved, until one is accepted. 0: none is.
rt::Task<std::uint16_t> ErrorControl::nearest(NodeId id, std::uint16_t refused_ms, std::uint32_t abort_code) {
  using od::AbortCode;
  const bool too_high = abort_code == static_cast<std::uint32_t>(AbortCode::value_too_high);
  const bool too_low = abort_code == static_cast<std::uint32_t>(AbortCode::value_too_low) ||
                       abort_code == static_cast<std::uint32_t>(AbortCode::invalid_value);
  constexpr std::uint32_t shortest_ms = 5;
  std::uint32_t ms = refused_ms;
  while (too_high || too_low) {
    ms = too_high ? ms / 2 : ms * 2;
    if (ms < shortest_ms || ms > 0xFFFF) break;
    const auto tried = static_cast<std::uint16_t>(ms);
    const auto written = co_await write(id, tried);
    if (written) co_return tried;
    if (written.error().code != Errc::aborted) break;
  }
  co_return 0;
}

void ErrorControl::tell(Seat& seat, const std::string& instead) {
  slots_.events().tell_once(EventKind::step, fmt::format("{}: its heartbeat is not as configured ({}): {}", seat.name(),
                                                         seat.rate.refused, instead));
}

void ErrorControl::begin_anew(Seat& seat) {
  seat.guarded = seat.rate.by_sdo = false;
  seat.rate.period = {};
  seat.rate.refused.clear();
  seat.rate.how.clear();
}

rt::Task<Result<bool>> ErrorControl::look(Seat& seat) {
  using By = places::SlotWatch::By;
  const By by = seat.slot.spec.watch.by;
  s_.guarding.end(seat.id());
  if (by == By::none || by == By::guarding) {
    const bool there = co_await set(seat);
    if (!there) co_return fail(Errc::timeout, "it did not answer what error_control wants");
    co_return false;
  }
  const std::uint16_t wanted = co::whole_ms(wanted_period(s_.bus.timing, seat));
  const bool stays = co_await leave_as_it_is(seat, wanted);
  if (stays) co_return false;
  const auto has = co_await s_.sdo.read<std::uint16_t>(seat.id(), 0x1017, 0);
  const bool lacks = !has && has.error().code == Errc::aborted;
  if (!has && !lacks) co_return fail(has.error());
  if (has && *has != wanted) note_write(seat);
  if (lacks) begin_anew(seat);
  if (lacks) seat.rate.refused = describe(has.error());
  seat.guarded = lacks || (seat.guarded && !seat.rate.refused.empty());
  seat.rate.by_sdo = false;
  co_return !seat.guarded;
}

rt::Task<bool> ErrorControl::learn(Seat& seat, std::vector<std::uint8_t> held) {
  begin_anew(seat);
  const std::uint32_t ms = held.size() == 2 ? held[0] + (std::uint32_t{held[1]} << 8U) : 0;
  if (ms == 0) {
    const bool there = co_await set_heartbeat(seat);
    if (there && seat.rate.refused.empty()) seat.rate.refused = "it was refused beside the configuration";
    co_return there;
  }
  seat.rate.refused = fmt::format("{} ms: it has another", co::whole_ms(wanted_period(s_.bus.timing, seat)));
  seat.rate.period = milliseconds(ms);
  tell(seat, fmt::format("it comes every {} ms, as the device has it", ms));
  co_return true;
}

rt::Task<bool> ErrorControl::set(Seat& seat) {
  using By = places::SlotWatch::By;
  s_.guarding.end(seat.id());
  begin_anew(seat);
  switch (seat.slot.spec.watch.by) {
    case By::automatic:
    case By::heartbeat: break;
    case By::guarding: co_return co_await set_guarding(seat);
    case By::none: seat.guarded = true; co_return true;
  }
  co_return co_await set_heartbeat(seat);
}

// A device that boots between two writes without cause also boots by itself after writes.
void ErrorControl::note_write(Seat& seat) const {
  const std::uint64_t boot_ups = s_.boots.boot_ups(seat.id());
  if (boot_ups != seat.rate.boot_ups) seat.rate.resets = 0;
  seat.rate.boot_ups = boot_ups;
  seat.rate.written = s_.executor.now();
}

// Each write is examined once. A device that ran before it booted may have been reset by a user, or lost its power. One
// that resets itself does so after the same time at each write.
void ErrorControl::note_reset(Seat& seat) const {
  constexpr rt::Duration at_once = milliseconds(100), soon = std::chrono::seconds(3);
  const rt::Time written = std::exchange(seat.rate.written, rt::Time{});
  if (written == rt::Time{}) {
    if (s_.boots.boot_ups(seat.id()) != seat.rate.boot_ups) seat.rate.resets = 0;
    seat.rate.boot_ups = s_.boots.boot_ups(seat.id());
    return;
  }
  const auto booted = s_.boots.boot_up(seat.id());
  const bool boots = booted && *booted > written && *booted < written + s_.bus.timing.boot_timeout;
  const bool ran = boots && seat.rate.ran > written && *booted > seat.rate.ran + at_once;
  seat.rate.boot_ups = s_.boots.boot_ups(seat.id());
  if (!boots || (ran && *booted > written + soon)) {
    seat.rate.resets = 0;
    return;
  }
  const rt::Duration behind = *booted - written;
  const bool as_soon = std::chrono::abs(behind - seat.rate.boots_behind) <= behind / 4 + at_once / 2;
  if (!as_soon) seat.rate.resets = 0;
  seat.rate.boots_behind = behind;
  seat.rate.resets += ran ? 1 : 2;
}

// Some devices reset themselves when 1017h is written: without this they would be started, written and lost forever.
rt::Task<bool> ErrorControl::leave_as_it_is(Seat& seat, std::uint16_t wanted) {
  note_reset(seat);
  if (seat.rate.resets < some_resets) co_return false;
  const auto own = co_await s_.sdo.read<std::uint16_t>(seat.id(), 0x1017, 0);
  const std::uint16_t has = own.value_or(std::uint16_t{0});
  seat.guarded = false;
  if (has == wanted) {
    slots_.events().tell_once(
        EventKind::step,
        fmt::format("{}: it booted after 1017h was written: it has {} ms now, and 1017h is not written again",
                    seat.name(), has));
    co_return true;
  }
  if (seat.rate.resets < enough_resets) co_return false;
  seat.rate.refused = fmt::format("{} ms: it resets itself each time 1017h is written", wanted);
  seat.guarded = has == 0;
  if (has != 0) seat.rate.period = milliseconds(has);
  if (has != 0) tell(seat, fmt::format("it comes every {} ms, as the device has it", has));
  co_return true;
}

void ErrorControl::take_period(Seat& seat, rt::Duration steady) {
  const rt::Duration promised = heartbeat_time(s_.bus.timing, seat);
  const bool as_promised = steady < promised + promised / 8 && promised < steady + steady / 8;
  seat.rate.seen = as_promised ? rt::Duration{} : std::max<rt::Duration>(steady, milliseconds(1));
  seat.rate.fast = 0;
  seat.rate.how.clear();
  seat.guarded = seat.rate.by_sdo = false;
  s_.heartbeats.supervise(seat.id(), heartbeat_timeout(s_.bus.timing, seat));
  if (seat.letter() == manager::BootStatus::k && seat.life == Life::operational) {
    seat.slave.status.result = {};
    slots_.happened(seat, SlotEvent::operational);
  }
  if (as_promised) return;
  slots_.events().tell_once(
      EventKind::step,
      fmt::format("{}: its heartbeat comes every {}, and 1017h was {} when it booted: Berth uses the observed period",
                  seat.name(), text_of(steady), text_of(promised)));
}

// It has another value than was written. Either it booted and its boot-up message was lost: it keeps the value written
// now. Or it keeps none.
rt::Task<ErrorControl::Keeps> ErrorControl::look_at_what_it_keeps(Seat& seat) {
  const std::uint16_t given = co::whole_ms(heartbeat_time(s_.bus.timing, seat));
  const auto has = co_await s_.sdo.read<std::uint16_t>(seat.id(), 0x1017, 0);
  if (!has || *has == given) co_return Keeps::all;
  note_write(seat);
  const auto written = co_await write(seat.id(), given);
  if (!written) co_return Keeps::all;
  const auto keeps = co_await s_.sdo.read<std::uint16_t>(seat.id(), 0x1017, 0);
  if (keeps && *keeps == given) co_return Keeps::again;
  const bool none = keeps.has_value() && *keeps == 0;
  co_return none ? Keeps::none : Keeps::all;
}

rt::Task<bool> ErrorControl::watch_unheard(Seat& seat) {
  const auto type = co_await s_.sdo.read<std::uint32_t>(seat.id(), 0x1000, 0);
  const bool answers = type || type.error().code == Errc::aborted;
  if (!answers || seat.life != Life::present) co_return answers;
  const Keeps keeps = co_await look_at_what_it_keeps(seat);
  if (keeps == Keeps::again) co_return false;
  if (keeps == Keeps::none) {
    seat.rate.refused = fmt::format("{} ms: the device accepts the write and keeps 0",
                                    co::whole_ms(heartbeat_time(s_.bus.timing, seat)));
    seat.guarded = true;
    s_.heartbeats.supervise(seat.id(), {});
    co_await ask_started(seat);
    co_return true;
  }
  seat.guarded = seat.rate.by_sdo = true;
  s_.heartbeats.supervise(seat.id(), {});  // a late first heartbeat must not make the next one count as missed
  seat.rate.at = s_.executor.now();
  co_return true;
}

std::string ErrorControl::text_of_unheard(const Seat& seat) const {
  const std::string every = text_of(heartbeat_timeout(s_.bus.timing, seat));
  return fmt::format(
      "it was started, and no heartbeat came for {}, though 1017h was set to {}; it answers SDO, and is asked by SDO, "
      "every {}, until a heartbeat comes: reset it, or error_control = \"none\" in the machine file",
      every, text_of(heartbeat_time(s_.bus.timing, seat)), every);
}

rt::Task<bool> ErrorControl::set_heartbeat(Seat& seat) {
  const NodeId id = seat.id();
  const std::uint16_t wanted = co::whole_ms(wanted_period(s_.bus.timing, seat));
  const bool stays = co_await leave_as_it_is(seat, wanted);
  if (stays) co_return true;
  note_write(seat);
  const auto written = co_await write(id, wanted);
  if (!written && written.error().code != Errc::aborted) {
    slots_.set_absent(seat, "its heartbeat could not be set: " + describe(written.error()));
    co_return false;
  }
  if (written) co_return true;
  seat.rate.refused = fmt::format("{} ms: {}", wanted, describe(written.error()));
  const auto own = co_await s_.sdo.read<std::uint16_t>(id, 0x1017, 0);
  const bool beats = own && *own != 0;
  std::uint16_t taken = beats ? *own : 0;
  if (!beats) taken = co_await nearest(id, wanted, written.error().detail);
  seat.guarded = taken == 0;
  if (seat.guarded) co_return true;
  seat.rate.period = milliseconds(taken);
  tell(seat, fmt::format("it comes every {} ms{}", taken, beats ? ", as the device has it" : ""));
  co_return true;
}

// A device guards or sends heartbeats, not both: 1017h decides (CiA 301 §7.2.8.3.2). A device that has no 1017h, or
// refuses its guard time, is still asked.
rt::Task<bool> ErrorControl::set_guarding(Seat& seat) {
  const NodeId id = seat.id();
  const auto& watch = seat.slot.spec.watch;
  seat.guarded = true;
  const auto beats = co_await s_.sdo.read<std::uint16_t>(id, 0x1017, 0);
  Result<void> done = {};
  if (beats && *beats != 0) done = co_await write(id, 0);
  const bool stays = !done && done.error().code == Errc::aborted;
  if (stays) {
    slots_.events().tell_once(EventKind::step,
                              fmt::format("{}: it cannot be guarded while it sends a heartbeat, and refuses to send "
                                          "none ({}): it is watched by its heartbeat",
                                          seat.name(), describe(done.error())));
    seat.guarded = false;
    co_return co_await set_heartbeat(seat);
  }
  if (watch.guard_time.count() > 0)
    done = co_await s_.sdo.write<std::uint16_t>(id, 0x100C, 0, co::whole_ms(watch.guard_time));
  if (!done && done.error().code == Errc::aborted) seat.rate.refused = "100Ch: " + describe(done.error());
  if (watch.life_time_factor > 0) {
    const auto factor = co_await s_.sdo.write<std::uint8_t>(id, 0x100D, 0, watch.life_time_factor);
    if (!factor && factor.error().code == Errc::aborted) seat.rate.refused = "100Dh: " + describe(factor.error());
    done = factor;
  }
  if (!seat.rate.refused.empty())
    slots_.events().tell_once(EventKind::step, fmt::format("{}: it is guarded, and does not guard Berth ({})",
                                                           seat.name(), seat.rate.refused));
  const bool there = done || done.error().code == Errc::aborted;
  if (!there) slots_.set_absent(seat, "its guard time could not be set: " + describe(done.error()));
  co_return there;
}

void ErrorControl::guard(Seat& seat) {
  const auto& factor = seat.slot.spec.watch.life_time_factor;
  s_.guarding.guard(seat.id(), guard_time(s_.bus.timing, seat), factor > 0 ? factor : usual_factor);
}

rt::Task<void> ErrorControl::watch_running(Seat& seat) {
  using By = places::SlotWatch::By;
  const NodeId id = seat.id();
  const By by = seat.slot.spec.watch.by;
  bool asked = seat.guarded || by == By::none;
  if (!asked && by == By::guarding) {
    // A device that still sends heartbeats refused to stop them.
    const auto own = co_await s_.sdo.read<std::uint16_t>(id, 0x1017, 0);
    asked = !own || *own == 0;
    if (!asked) seat.rate.period = milliseconds(*own);
  }
  seat.guarded = asked;
  if (by == By::none) co_return;
  if (asked && !seat.rate.by_sdo && !s_.guarding.guarded(id)) guard(seat);
  if (asked) co_return;
  if (seat.last.seen && seat.rate.period.count() == 0) {
    const auto own = co_await s_.sdo.read<std::uint16_t>(id, 0x1017, 0);
    if (own && *own != 0 && *own != co::whole_ms(wanted_period(s_.bus.timing, seat)))
      seat.rate.period = milliseconds(*own);
  }
  const auto steady = s_.boots.steady(id);
  if (steady && *steady > heartbeat_timeout(s_.bus.timing, seat)) co_return take_period(seat, *steady);
  s_.heartbeats.supervise(id, heartbeat_timeout(s_.bus.timing, seat));
}

rt::Task<void> ErrorControl::ask_started(Seat& seat) {
  const NodeId id = seat.id();
  const bool none = seat.slot.spec.watch.by == places::SlotWatch::By::none;
  auto guarded = co_await co::guard_once(s_.dispatcher, id, s_.bus.timing.guard_timeout, s_.bus.timing.tries);
  // The message may have been under way before the command, and a slow device obeys as late as it answers.
  const rt::Duration slow = 2 * std::max(s_.bus.timing.sdo_timeout, seat.slot.spec.watch.sdo_timeout);
  const rt::Time deadline = s_.executor.now() + slow;
  while (guarded && guarded->state != NmtState::operational && s_.executor.now() < deadline) {
    co_await rt::sleep_for(s_.bus.timing.guard_timeout);
    guarded = co_await co::guard_once(s_.dispatcher, id, s_.bus.timing.guard_timeout, s_.bus.timing.tries);
  }
  if (guarded && guarded->state != NmtState::operational) {
    slots_.happened(seat, SlotEvent::boot_failed,
                    fmt::format("it was started, and its error control reports {}", berth::name(guarded->state)));
    co_return;
  }
  const std::string why = seat.rate.refused.empty() ? std::string() : " (1017h refused " + seat.rate.refused + ")";
  std::string how = "it is not watched (error_control = \"none\")";
  seat.rate.how.clear();
  if (guarded && !none) {
    guard(seat);
    how = fmt::format("{}it is watched by guarding, every {}", why.empty() ? why : "it sends no heartbeat" + why + ": ",
                      text_of(guard_time(s_.bus.timing, seat)));
    if (!why.empty()) seat.rate.how = how;
  }
  if (!guarded) {
    // Without either error control protocol, Berth only knows whether it answers.
    const auto type = co_await s_.sdo.read<std::uint32_t>(id, 0x1000, 0);
    const bool answers = type || type.error().code == Errc::aborted;
    if (!answers) {
      slots_.happened(seat, SlotEvent::boot_failed,
                      fmt::format("it was started, and answers neither guarding nor SDO{}", why));
      co_return;
    }
    how = fmt::format(
        "it has neither heartbeat{} nor guarding: it was started and answers SDO, and whether it runs is not known",
        why);
    seat.rate.by_sdo = !none;
    seat.rate.at = s_.executor.now();
    if (!none) how += fmt::format("; it is asked by SDO, every {}", text_of(heartbeat_timeout(s_.bus.timing, seat)));
    // CiA 302-2 starts error control by one of the two: this device has neither, and whether it runs is unknown.
    if (!none) seat.slave.status.result.status = manager::BootStatus::k;
    if (!none) seat.rate.how = how;
  }
  // A reason is reported with the state.
  if (seat.rate.how.empty()) slots_.events().tell_once(EventKind::step, fmt::format("{}: {}", seat.name(), how));
  slots_.happened(seat, SlotEvent::operational);
}

}  // namespace berth::operate

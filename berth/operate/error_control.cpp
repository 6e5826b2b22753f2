#include "berth/operate/error_control.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/co/guarding.hpp"
#include "berth/od/abort_code.hpp"

namespace berth::operate {

namespace {

using std::chrono::milliseconds;

std::uint16_t in_ms(rt::Duration period) {
  const auto ms = std::chrono::duration_cast<milliseconds>(period).count();
  return static_cast<std::uint16_t>(std::clamp<std::int64_t>(ms, 0, 0xFFFF));
}

}  // namespace

rt::Duration heartbeat_period(const design::Timing& timing, const Seat& seat) noexcept {
  return seat.rate.period.count() > 0 ? seat.rate.period : timing.heartbeat_period;
}

rt::Duration heartbeat_timeout(const design::Timing& timing, const Seat& seat) noexcept {
  if (seat.rate.period <= timing.heartbeat_period || timing.heartbeat_period.count() == 0)
    return timing.heartbeat_timeout;
  const double times =
      static_cast<double>(seat.rate.period.count()) / static_cast<double>(timing.heartbeat_period.count());
  return rt::Duration(static_cast<std::int64_t>(times * static_cast<double>(timing.heartbeat_timeout.count())));
}

rt::Task<Result<void>> ErrorControl::write(NodeId id, std::uint16_t period_ms) {
  co_return co_await s_.sdo.write<std::uint16_t>(id, 0x1017, 0, period_ms);
}

// The limits of its 1017h are not known: the wanted period is doubled, or halved, until one is taken. 0: none is.
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
  slots_.events().tell_once(EventKind::step, fmt::format("{}: its heartbeat is not what was wanted ({}): {}",
                                                         seat.name(), seat.rate.refused, instead));
}

rt::Task<bool> ErrorControl::set(Seat& seat) {
  const NodeId id = seat.id();
  const std::uint16_t wanted = in_ms(s_.bus.timing.heartbeat_period);
  const auto written = co_await write(id, wanted);
  if (!written && written.error().code != Errc::aborted) {
    slots_.set_absent(seat, "its heartbeat could not be set: " + describe(written.error()));
    co_return false;
  }
  seat.guarded = false;
  seat.rate.period = {};
  seat.rate.refused.clear();
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

rt::Task<void> ErrorControl::learn(Seat& seat) {
  if (!seat.last.seen || seat.rate.period.count() > 0) co_return;
  const auto own = co_await s_.sdo.read<std::uint16_t>(seat.id(), 0x1017, 0);
  if (own && *own != 0 && *own != in_ms(s_.bus.timing.heartbeat_period)) seat.rate.period = milliseconds(*own);
}

rt::Task<void> ErrorControl::ask_started(Seat& seat) {
  const NodeId id = seat.id();
  const auto guarded = co_await co::guard_once(s_.dispatcher, id, s_.bus.timing.guard_timeout, s_.bus.timing.tries);
  if (guarded && guarded->state == NmtState::operational) {
    slots_.happened(seat, SlotEvent::operational);
    co_return;
  }
  if (guarded) {
    slots_.happened(seat, SlotEvent::boot_failed,
                    fmt::format("it was started, and says by guarding that it is {}", berth::name(guarded->state)));
    co_return;
  }
  // Neither error control protocol: that it answers is all that can be known.
  const auto type = co_await s_.sdo.read<std::uint32_t>(id, 0x1000, 0);
  const bool answers = type || type.error().code == Errc::aborted;
  if (!answers) {
    slots_.happened(
        seat, SlotEvent::boot_failed,
        fmt::format("it was started, and answers neither guarding nor SDO; 1017h refused {}", seat.rate.refused));
    co_return;
  }
  slots_.events().tell_once(
      EventKind::step,
      fmt::format("{}: it has neither heartbeat (1017h refused {}) nor guarding: it was told to start and answers SDO, "
                  "and whether it runs is not known",
                  seat.name(), seat.rate.refused));
  slots_.happened(seat, SlotEvent::operational);
}

}  // namespace berth::operate

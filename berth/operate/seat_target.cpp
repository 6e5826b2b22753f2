#include "berth/operate/seat_target.hpp"

#include "berth/co/guarding.hpp"
#include "berth/operate/error_control.hpp"

namespace berth::operate {

rt::Task<Result<rt::Time>> SeatTarget::command(co::NmtCommand command) {
  co_return co_await s_.nmt.send(command, seat_.id());
}

rt::Task<bool> SeatTarget::boots(rt::Time since, rt::Time deadline) {
  co_return co_await s_.boots.wait(seat_.id(), since, deadline);
}

rt::Task<std::optional<NmtState>> SeatTarget::heartbeat(rt::Duration within) {
  const NodeId id = seat_.id();
  const auto beats = s_.boots.beats(id);
  const rt::Time deadline = s_.executor.now() + within;
  while (s_.boots.beats(id) == beats && s_.executor.now() < deadline) {
    co_await rt::sleep_for(std::chrono::milliseconds(1));
  }
  if (s_.boots.beats(id) == beats) co_return std::nullopt;
  co_return s_.boots.state(id);
}

rt::Task<std::optional<NmtState>> SeatTarget::guard() {
  const auto guarded =
      co_await co::guard_once(s_.dispatcher, seat_.id(), s_.bus.timing.guard_timeout, s_.bus.timing.tries);
  if (!guarded) co_return std::nullopt;
  co_return guarded->state;
}

void SeatTarget::supervise(const manager::SlaveRules&) {
  if (!seat_.guarded) s_.heartbeats.supervise(seat_.id(), heartbeat_timeout(s_.bus.timing, seat_));
}

}  // namespace berth::operate

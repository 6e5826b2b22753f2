// Makes a device show itself (CiA 303-3): in LSS configuration state both indicators flicker alternately.
#include "berth/co/guarding.hpp"
#include "berth/lss/frames.hpp"
#include "berth/operate/network.hpp"

namespace berth::operate {
namespace {

// Returns to LSS waiting, also if the command is interrupted.
class Shown {
 public:
  explicit Shown(can::Dispatcher& dispatcher) noexcept : dispatcher_(&dispatcher) {}
  ~Shown() {
    if (dispatcher_ == nullptr) return;
    const can::Frame waiting =
        lss::request(lss::Command::switch_global, static_cast<std::uint8_t>(lss::State::waiting));
    (void)dispatcher_->send(waiting);
  }
  Shown(const Shown&) = delete;
  Shown& operator=(const Shown&) = delete;
  void over() noexcept { dispatcher_ = nullptr; }

 private:
  can::Dispatcher* dispatcher_;
};

}  // namespace

rt::Task<Result<Network::Located>> Network::locate(Identity device, rt::Duration time, bool anyway) {
  co_await parts_.bus.turn.take();
  const rt::Held held(parts_.bus.turn);
  Located located;
  located.device = device;
  Shown shown(parts_.bus.dispatcher);  // asking for its node-ID selects it, too
  const auto active = co_await parts_.asking.active_id(device);
  if (!active) {
    if (active.error().code != Errc::timeout) co_return fail(active.error());
    co_return fail(Errc::not_found, "no device answers to this LSS address");
  }
  located.id = *active;
  if (located.id.configured()) {
    if (parts_.bus.heard_within(located.id, parts_.bus.bus.timing.heartbeat_timeout)) {
      located.state = parts_.bus.boots.state(located.id);
    } else {
      const auto guarded = co_await co::guard_once(parts_.bus.dispatcher, located.id,
                                                   parts_.bus.bus.timing.guard_timeout, parts_.bus.bus.timing.tries);
      if (guarded) located.state = guarded->state;
    }
  } else {
    located.state = NmtState::initialising;
  }
  if (!anyway && !located.state) co_return fail(Errc::invalid, "whether it is operational cannot be known");
  if (!anyway && *located.state == NmtState::operational) co_return fail(Errc::invalid, "it is operational");
  const auto selected = co_await parts_.bus.lss.switch_selective(device.address);
  if (!selected) {
    if (selected.error().code != Errc::timeout) co_return fail(selected.error());
    co_return fail(Errc::not_found, "no device answers to this LSS address");
  }
  parts_.slots.events().tell(EventKind::step, "", "showing " + to_string(device));
  co_await rt::sleep_for(time);
  const auto quiet = co_await parts_.bus.lss.switch_global(lss::State::waiting);
  if (!quiet) co_return fail(quiet.error());
  shown.over();
  co_return located;
}

}  // namespace berth::operate

#include "berth/operate/extended_frames.hpp"

namespace berth::operate {

bool may_send_extended_frames(const BusServices& s, const Agenda& agenda) noexcept {
  return s.bus.extended_frames && agenda.extended.pass.value_or(true);
}

rt::Task<Result<void>> tell_all_unknown(BusServices& s, Agenda& agenda, Events& events) {
  const std::uint32_t before = agenda.extended.bus_offs;
  const auto sent = co_await s.rand.switch_global(nodeid::Identification::unknown);
  if (sent) agenda.extended.pass = true;
  const bool drove_off = !sent && agenda.extended.bus_offs != before && !agenda.extended.pass;
  if (!drove_off) co_return sent;
  // A cut wire, or a node at another bit rate, stops every frame.
  co_await rt::sleep_for(s.bus.timing.bus_off_pause);
  const auto standard = co_await s.lss.switch_global(lss::State::waiting);
  if (!standard) co_return sent;
  agenda.extended.pass = false;
  events.tell(EventKind::error, "",
              "an extended frame drove this port to bus-off, and a standard frame passes: a device with a controller "
              "of CAN 2.0A is on the bus. Berth goes on without extended frames and RAND; extended_frames = false in "
              "the machine file avoids that frame");
  co_return sent;
}

}  // namespace berth::operate

/// Whether extended frames can be sent on a bus. A controller of CAN 2.0A takes each for an error in form, and answers
/// it with an error frame: its sender is bus-off after 32 tries, and no other frame passes meanwhile.
#pragma once

#include "berth/operate/agenda.hpp"
#include "berth/operate/bus_services.hpp"
#include "berth/operate/events.hpp"

namespace berth::operate {

/// Not where the machine file says `extended_frames = false`, nor after `tell_all_unknown` that learnt it.
[[nodiscard]] bool may_send_extended_frames(const BusServices& services, const Agenda& agenda) noexcept;
/// RAND's 80h, the first extended frame of a run: every device answers the search after it (paper 1 §III.b). Errors:
/// RAND's own. When it drives the port to bus-off, and a standard frame passes after the restart, that is told, and no
/// extended frame is sent in this run.
rt::Task<Result<void>> tell_all_unknown(BusServices& services, Agenda& agenda, Events& events);

}  // namespace berth::operate

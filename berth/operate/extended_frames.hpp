/// Whether extended frames can be sent on a bus. A CAN 2.0A controller treats each as a form error and answers with an
/// error frame: the sender is bus-off after 32 tries, and no other frame passes meanwhile.
#pragma once

#include "berth/operate/agenda.hpp"
#include "berth/operate/bus_services.hpp"
#include "berth/operate/events.hpp"

namespace berth::operate {

/// False if the machine file says `extended_frames = false`, or after `tell_all_unknown` found that they do not pass.
[[nodiscard]] bool may_send_extended_frames(const BusServices& services, const Agenda& agenda) noexcept;
/// RAND's 80h, the first extended frame of a run: every device answers the search after it (paper 1 §III.b). Errors:
/// RAND's own. If it drives the port to bus-off, and a standard frame passes after the restart, this is reported, and
/// no extended frame is sent in this run.
rt::Task<Result<void>> tell_all_unknown(BusServices& services, Agenda& agenda, Events& events);

}  // namespace berth::operate

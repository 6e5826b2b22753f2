#include "berth/operate/port_health.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/text/quantity.hpp"

namespace berth::operate {

PortHealth::PortHealth(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found, Owner& owner)
    : s_(services),
      slots_(slots),
      agenda_(agenda),
      found_(found),
      owner_(owner),
      device_(s_.dispatcher, s_.bus),
      job_(*this) {}

bool PortHealth::begin() {
  s_.dispatcher.on_status(this);
  watches_ = true;
  const can::Status status = s_.port.status();
  count(status);
  if (status.bus_off && !job_.timed()) way_out_of_bus_off();
  resting_ = !usable(status);
  return !resting_;
}

void PortHealth::end() noexcept {
  s_.dispatcher.on_status(nullptr);
  job_.cancel();
  watches_ = resting_ = false;
}

bool PortHealth::usable(const can::Status& status) const noexcept {
  return status.up && (s_.only_observes() || !status.listen_only);
}

// A port that stays bus-off reports more than one change.
void PortHealth::count(const can::Status& status) noexcept {
  if (status.bus_off && !off_) ++slots_.diagnosis().bus_offs;
  off_ = status.bus_off;
}

void PortHealth::changed(const can::Status& status, rt::Time) noexcept {
  count(status);
  if (status.error_passive() && agenda_.speaks) {
    // Something on the bus disturbs this node's frames: be silent, examine it, then speak again.
    fall_silent();
    slots_.events().tell(
        EventKind::error, "",
        "this port is error-passive: is a wire loose, or another node at a wrong bit rate or with our node-ID?");
  }
  if (status.bus_off && !job_.timed()) way_out_of_bus_off();
  if (watches_) rest_or_go_on(status);
}

// A port that was away may be on another machine, and devices may have been changed: everything known of them is asked
// again, as after a start.
void PortHealth::rest_or_go_on(const can::Status& status) {
  if (!usable(status) && !resting_) {
    const bool stands_by = status.up && s_.bus.flying.has_value();
    go_to_rest(stands_by   ? "another device is the NMT master, or the masters agree on one"
               : status.up ? (s_.shut_by.empty() ? "the port accepts no frames" : s_.shut_by)
                           : "the port is down; what is wrong with cable, adapter or "
                             "interface? Berth waits for it");
  } else if (usable(status) && resting_) {
    resting_ = false;
    s_.shut_by.clear();
    agenda_.look_anew = true;
    slots_.events().tell(EventKind::step, "", "the port accepts frames again: looking for devices");
    owner_.port_goes_on();
  }
}

void PortHealth::go_to_rest(const std::string& why) {
  resting_ = true;
  owner_.port_rests();
  fall_silent();
  s_.vacancy = {};
  found_.clear();
  slots_.events().tell_again();
  for (auto& seat : slots_.seats()) {
    s_.unwatch(seat->id());
    seat->checked = {};
    slots_.happened(*seat, SlotEvent::rests, why);
  }
  // The part that shut the port has reported more.
  if (why != s_.shut_by) slots_.events().tell(s_.bus.flying ? EventKind::step : EventKind::error, "", why);
}

void PortHealth::way_out_of_bus_off() {
  ++agenda_.extended.bus_offs;
  const auto& timing = s_.bus.timing;
  if (s_.bus.bus_off == design::BusOff::stay) {
    return slots_.events().tell_once(
        EventKind::error, "this port is bus-off and stays so (bus_off = \"stay\"); find the fault, then restart Berth");
  }
  const auto calm = std::max<rt::Duration>(10 * timing.bus_off_pause, std::chrono::seconds(10));
  if (restarts_ > 0 && s_.executor.now() - restarted_ > calm) restarts_ = 0;
  if (timing.bus_off_limit > 0 && restarts_ >= timing.bus_off_limit) {
    return slots_.events().tell_once(EventKind::error,
                                     fmt::format("this port is bus-off again after {} restarts (bus_off_limit), and "
                                                 "stays so; find the fault, then restart Berth",
                                                 restarts_));
  }
  slots_.events().tell(
      EventKind::error, "",
      fmt::format("this port is bus-off; it is started again in {}", text::write_duration(timing.bus_off_pause)));
  s_.executor.after(timing.bus_off_pause, job_);
}

void PortHealth::restart() {
  slots_.events().tell(EventKind::step, "", "starting the port again after bus-off");
  ++restarts_;
  restarted_ = s_.executor.now();
  // The port's own rate: the network may have moved to another (`move_bit_rate`).
  const auto rate = s_.port.status().bit_rate;
  s_.port.restart(rate != 0 ? rate : s_.bus.bitrate);
  agenda_.look_anew = true;
}

// Two nodes that boot under one node-ID, with no other node to acknowledge them, would repeat their messages against
// each other forever.
void PortHealth::speak() {
  const auto& vacant = s_.vacancy[s_.bus.master.value()];
  const bool free = vacant && s_.boots.silent_since(s_.bus.master, *vacant);
  if (agenda_.speaks || !free || s_.only_observes() || s_.port.status().error_passive()) return;
  agenda_.speaks = true;
  device_.power_on();
}

void PortHealth::fall_silent() noexcept {
  if (!agenda_.speaks) return;
  agenda_.speaks = false;
  device_.power_off();
  s_.vacancy[s_.bus.master.value()].reset();
  agenda_.look_anew = true;
}

}  // namespace berth::operate

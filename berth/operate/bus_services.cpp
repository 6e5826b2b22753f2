#include "berth/operate/bus_services.hpp"

#include <algorithm>

#include "berth/operate/timing_options.hpp"

namespace berth::operate {

BusServices::BusServices(rt::Executor& clock, can::Port& port_used, const design::Bus& bus_line,
                         co::HeartbeatConsumer::Observer& heartbeat_listener,
                         co::GuardingMaster::Observer& guarding_listener, co::EmcyConsumer::Observer& emcy_listener)
    : executor(clock),
      bus(bus_line),
      port(port_used),
      dispatcher(clock, port_used),
      lss(dispatcher, lss_options(bus_line.timing)),
      rand(dispatcher),
      sdo(dispatcher, sdo_options(bus_line.timing)),
      nmt(dispatcher),
      heartbeats(dispatcher, heartbeat_listener),
      guarding(dispatcher, guarding_listener),
      emergencies(dispatcher, emcy_listener),
      boots(dispatcher, &sdo),
      foreign_stores(dispatcher, bus_line.timing.store_timeout) {
  const auto& timing = bus.timing;
  // A device may leave between its last heartbeat before the watch and the first one after: it is missed too.
  heartbeats.set_never_seen_time(timing.heartbeat_timeout + timing.heartbeat_period);
  co::SdoOptions options = sdo.options();
  patience.most = 2 * timing.sdo_timeout;
  options.least = &patience.times;
  sdo.set_options(options);
  // A store may be answered long after its timeout.
  sdo.set_late_window(std::max<rt::Duration>(std::chrono::seconds(5), 2 * timing.save_timeout), &patience);
}

std::optional<NmtState> BusServices::watched_state(NodeId node) const noexcept {
  return guarding.guarded(node) ? guarding.state(node) : heartbeats.state(node);
}

bool BusServices::heard_within(NodeId node, rt::Duration time) const noexcept {
  const auto heard = boots.heard(node);
  return heard && executor.now() - *heard <= time;
}

void BusServices::unwatch(NodeId node) noexcept {
  heartbeats.supervise(node, rt::Duration{0});
  guarding.end(node);
}

}  // namespace berth::operate

/// The services of one bus that the parts of a `Network` work with: one of each, on one port.
///
/// A task that has the turn may use LSS and RAND, and changes what devices keep; SDO to one node, NMT and what is heard
/// need no turn. `lss_turn` is the bindings' that run side by side under it.
#pragma once

#include <array>

#include "berth/can/dispatcher.hpp"
#include "berth/co/emcy.hpp"
#include "berth/co/guarding.hpp"
#include "berth/co/heartbeat.hpp"
#include "berth/co/nmt_master.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/design/machine.hpp"
#include "berth/lss/master.hpp"
#include "berth/manager/sdo_requests.hpp"
#include "berth/nodeid/rand_master.hpp"
#include "berth/operate/foreign_stores.hpp"
#include "berth/operate/report.hpp"
#include "berth/places/binder.hpp"
#include "berth/places/boot_watch.hpp"
#include "berth/rt/turn.hpp"

namespace berth::operate {

struct BusServices {
  /// All must stay. The listeners hear what `heartbeats`, `guarding` and `emergencies` are told to hear.
  BusServices(rt::Executor& clock, can::Port& port_used, const design::Bus& bus_line,
              co::HeartbeatConsumer::Observer& heartbeat_listener, co::GuardingMaster::Observer& guarding_listener,
              co::EmcyConsumer::Observer& emcy_listener);

  /// The last state that the error control protocol by which a node is watched told; empty: it is not watched, has told
  /// none yet, or is lost.
  [[nodiscard]] std::optional<NmtState> watched_state(NodeId node) const noexcept;
  /// A frame that only this node sends was heard, not longer ago than that.
  [[nodiscard]] bool heard_within(NodeId node, rt::Duration time) const noexcept;
  /// No error control protocol watches it any more.
  void unwatch(NodeId node) noexcept;

  /// NMT commands are Berth's to send.
  [[nodiscard]] bool may_command() const noexcept { return bus.role == design::Role::master; }
  /// LSS, and all that changes a device, is not.
  [[nodiscard]] bool only_observes() const noexcept { return bus.role == design::Role::observer; }

  rt::Executor& executor;
  const design::Bus& bus;
  can::Port& port;
  can::Dispatcher dispatcher;
  lss::Master lss;
  nodeid::RandMaster rand;
  /// By node-ID: each SDO answer is waited for at least so long. `sdo_timeout` of its slot, or what its late answers
  /// taught; 0: neither.
  co::SdoPatience patience{};
  co::SdoClient sdo;
  co::NmtMaster nmt;
  co::HeartbeatConsumer heartbeats;
  co::GuardingMaster guarding;
  co::EmcyConsumer emergencies;
  places::BootWatch boots;
  places::VacancyTable vacancy;
  /// Why the port takes no frame, in words: whoever shuts it knows. Empty: its own state says it.
  std::string shut_by{};
  std::optional<MasterReport> master{};  ///< who is, on a bus with several; kept by `Mastership`
  /// The SDO manager of the bus (CiA 302-5; docs/sdo-manager.md), which begins with the first request. Made with the
  /// objects of the master's own device.
  std::unique_ptr<manager::SdoRequests> channels{};
  ForeignStores foreign_stores;
  rt::Turn turn;
  rt::Turn lss_turn;
};

}  // namespace berth::operate

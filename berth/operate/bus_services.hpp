/// The services of one bus that the parts of a `Network` use: one of each, on one port.
///
/// Only the task that holds `turn` may use LSS and RAND or change what devices store. SDO to one node, NMT and
/// listening need no turn. Bindings that run side by side under `turn` share LSS by `lss_turn`.
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
  /// All must outlive this. The listeners get the events of `heartbeats`, `guarding` and `emergencies`.
  BusServices(rt::Executor& clock, can::Port& port_used, const design::Bus& bus_line,
              co::HeartbeatConsumer::Observer& heartbeat_listener, co::GuardingMaster::Observer& guarding_listener,
              co::EmcyConsumer::Observer& emcy_listener);

  /// The last NMT state that the node reported by the error control protocol which watches it. Empty: it is not
  /// watched, has reported none yet, or is lost.
  [[nodiscard]] std::optional<NmtState> watched_state(NodeId node) const noexcept;
  /// A frame that only this node sends was heard within the last `time`.
  [[nodiscard]] bool heard_within(NodeId node, rt::Duration time) const noexcept;
  /// No error control protocol watches the node any more.
  void unwatch(NodeId node) noexcept;

  /// Berth may send NMT commands.
  [[nodiscard]] bool may_command() const noexcept { return bus.role == design::Role::master; }
  /// Berth may not use LSS or change a device.
  [[nodiscard]] bool only_observes() const noexcept { return bus.role == design::Role::observer; }

  rt::Executor& executor;
  const design::Bus& bus;
  can::Port& port;
  can::Dispatcher dispatcher;
  lss::Master lss;
  nodeid::RandMaster rand;
  /// By node-ID: the shortest SDO timeout. From `sdo_timeout` of its slot, or learnt from late answers; 0: neither.
  co::SdoPatience patience{};
  co::SdoClient sdo;
  co::NmtMaster nmt;
  co::HeartbeatConsumer heartbeats;
  co::GuardingMaster guarding;
  co::EmcyConsumer emergencies;
  places::BootWatch boots;
  places::VacancyTable vacancy;
  /// Why the port takes no frame, in words, set by the part that shut it. Empty: the port's own state explains it.
  std::string shut_by{};
  std::optional<MasterReport> master{};  ///< the active master, on a bus with several; kept by `Mastership`
  /// The SDO manager of the bus (CiA 302-5; docs/sdo-manager.md). It begins with the first request, and is made with
  /// the objects of the master's own device.
  std::unique_ptr<manager::SdoRequests> channels{};
  ForeignStores foreign_stores;
  rt::Turn turn;
  rt::Turn lss_turn;
};

}  // namespace berth::operate

/// One CANopen network from a client's view: the services that its nodes share, on one port.
///
///     can::Dispatcher dispatcher(executor, port);
///     client::Network network(dispatcher);
///     client::RemoteNode drive(network, NodeId(5), file.description);
///
/// No globals: any number of networks and nodes in one process, each bound to its executor and not to a thread.
#pragma once

#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/co/heartbeat.hpp"
#include "berth/co/nmt_master.hpp"
#include "berth/co/sdo_client.hpp"

namespace berth::client {

class RemoteNode;

class Network final : private co::HeartbeatConsumer::Observer {
 public:
  /// `dispatcher` must outlive the network. The network uses the default SDO channels of the nodes: no other SDO client
  /// may use the same nodes on the bus (CiA 301 §7.4.4).
  explicit Network(can::Dispatcher& dispatcher, const co::SdoOptions& options = {});
  /// Pending operations end with Errc::cancelled; remaining nodes refuse everything afterwards.
  ~Network();
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;

  [[nodiscard]] can::Dispatcher& dispatcher() noexcept { return *dispatcher_; }
  [[nodiscard]] rt::Executor& executor() noexcept { return dispatcher_->executor(); }
  [[nodiscard]] co::SdoClient& sdo() noexcept { return sdo_; }
  [[nodiscard]] co::NmtMaster& nmt_master() noexcept { return nmt_; }
  [[nodiscard]] const co::HeartbeatConsumer& heartbeats() const noexcept { return heartbeats_; }

  /// Sends a command to all nodes, without waiting. For one node: `RemoteNode::nmt`.
  void nmt_all(co::NmtCommand command) { nmt_.queue(command, co::NmtTarget::all()); }

  /// Reports a node whose first heartbeat is missing for so long after its `RemoteNode` was made, or after its boot-up
  /// (`StateEvent`, kind never_seen). 0 = never. Call it before making the nodes.
  void set_never_seen_time(rt::Duration time) noexcept { heartbeats_.set_never_seen_time(time); }

  /// Sends one SYNC (080h, no counter).
  can::Queued send_sync() noexcept;
  /// Sends a SYNC at once and then every `period`; 0 ends it. Queues no second SYNC while one waits in the port.
  void produce_sync(rt::Duration period) noexcept;

 private:
  friend class RemoteNode;
  /// The SYNC producer.
  class Sync final : public rt::Job, public can::Confirmation {
   public:
    explicit Sync(Network& network) noexcept : network_(&network) {}
    void run() noexcept override;
    void sent(rt::Time) noexcept override {}
    rt::Duration period{};
    rt::Time next{};

   private:
    Network* network_;
  };
  void add(RemoteNode& node);
  void remove(RemoteNode& node) noexcept;
  void heartbeat(const co::HeartbeatEvent& event, rt::Time at) noexcept override;

  can::Dispatcher* dispatcher_;
  co::SdoClient sdo_;
  co::NmtMaster nmt_;
  co::HeartbeatConsumer heartbeats_;
  Sync sync_{*this};
  std::vector<RemoteNode*> nodes_;
};

}  // namespace berth::client

/// One CANopen network as a client sees it: the services that its nodes share, on one port.
///
///     can::Dispatcher dispatcher(executor, port);
///     client::Network network(dispatcher);
///     client::RemoteNode drive(network, NodeId(5), file.description);
///
/// No globals: any number of networks and nodes in one process, each bound to its executor and to no thread.
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
  /// may be on the same bus with the same nodes (CiA 301 §7.4.4).
  explicit Network(can::Dispatcher& dispatcher, const co::SdoOptions& options = {});
  /// What is pending ends with Errc::cancelled; nodes that are still there refuse everything from then on.
  ~Network();
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;

  [[nodiscard]] can::Dispatcher& dispatcher() noexcept { return *dispatcher_; }
  [[nodiscard]] rt::Executor& executor() noexcept { return dispatcher_->executor(); }
  [[nodiscard]] co::SdoClient& sdo() noexcept { return sdo_; }
  [[nodiscard]] co::NmtMaster& nmt_master() noexcept { return nmt_; }
  [[nodiscard]] const co::HeartbeatConsumer& heartbeats() const noexcept { return heartbeats_; }

  /// A command to all nodes, without waiting. To one node: `RemoteNode::nmt`.
  void nmt_all(co::NmtCommand command) { nmt_.queue(command, co::NmtTarget::all()); }

  /// A node whose first heartbeat is missing for so long after its `RemoteNode` was made, or after its boot-up, is told
  /// (`StateEvent`, kind never_seen). 0 = never. Before the nodes are made.
  void set_never_seen_time(rt::Duration time) noexcept { heartbeats_.set_never_seen_time(time); }

  /// Sends one SYNC (080h, no counter).
  can::Queued send_sync() noexcept;
  /// Sends a SYNC now and every `period` from now on; 0 ends it. One that waits in the port is not doubled.
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

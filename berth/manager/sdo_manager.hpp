/// The SDO manager of a network (CiA 302-5; docs/sdo-manager.md): gives a node its own SDO channel to another one. It
/// writes 1280h to 12FFh of the client and 1201h to 127Fh of the server through their default channels. It takes the
/// channel back when its lease ends, when it is released, or when the client is lost.
///
///     SdoManager manager(dispatcher, sdo, {.nodes = {NodeId(3), NodeId(5)}});
///     co_await manager.recover();                             // what an earlier manager left
///     auto channel = co_await manager.connect(NodeId(3), NodeId(5), 60s);
///     ... channel->client_object: 1280h of node 3 has the CAN-IDs
///     co_await manager.disconnect(NodeId(3), NodeId(5));
///
/// No CAN-ID is in two channels: they come from a pool. One that may still be in an unreachable node is not given again
/// before that node was read (`SdoConnections`).
///
/// A node is lost when its heartbeat stops (`SdoManagerOptions::heartbeat`), or by a boot-up message, because a reset
/// removes dynamic channels:
/// - a lost client's channels are taken back
/// - a lost server's channels are taken back; one that booted gets its end written again, with the same CAN-IDs
/// Requests are served in order of arrival.
#pragma once

#include <deque>
#include <functional>

#include "berth/co/heartbeat.hpp"
#include "berth/co/sdo_access.hpp"
#include "berth/manager/sdo_connections.hpp"
#include "berth/rt/later.hpp"
#include "berth/rt/scope.hpp"
#include "berth/rt/turn.hpp"

namespace berth::manager {

struct SdoManagerOptions {
  std::vector<NodeId> nodes = {};  ///< the network: the nodes that `recover` reads; others may be named too
  can::IdRange pool = SdoConnections::default_pool;
  rt::Duration lease = std::chrono::minutes(10);  ///< default, and for what `recover` finds
  rt::Duration heartbeat{};                       ///< a party silent for so long is lost; 0: only boot-ups count
  /// Listens to the dynamic SDO request 6E0h: two bytes, client and server. CiA 302-5's own content is not public; this
  /// one is Berth's.
  bool hears_requests = false;
};

class SdoManager final : private can::Handler, private co::HeartbeatConsumer::Observer {
 public:
  /// Both must outlive this; `sdo` is the client of the default channels.
  SdoManager(can::Dispatcher& dispatcher, co::SdoClient& sdo, SdoManagerOptions options);
  ~SdoManager();

  /// Reads every node's channels. Two ends that fit together become a connection with a new lease; others (one end
  /// alone, one CAN-ID twice) are removed from the nodes. A node that does not answer is read when it boots or is asked
  /// for. Call first: requests wait until it is done. A later call reads everything again.
  [[nodiscard]] rt::Task<void> recover();
  /// Makes a connection, or renews the lease of an existing one. `lease` 0: the default. Errors: Errc::invalid the
  /// nodes are the same, or have no node-ID; Errc::not_found a party has no free channel object (`Error::node`);
  /// Errc::unsupported no CAN-ID is left; those of SDO, after partial writes were taken back.
  [[nodiscard]] rt::Task<Result<SdoConnection>> connect(NodeId client, NodeId server, rt::Duration lease);
  /// Errc::not_found: there is none.
  [[nodiscard]] rt::Task<Result<void>> disconnect(NodeId client, NodeId server);
  /// The manager gives up its role: it does nothing more by itself, and connections stay in the nodes.
  void end() noexcept;

  [[nodiscard]] const SdoConnections& connections() const noexcept { return connections_; }
  /// It did not answer `recover`, and was not read since: its channels are unknown.
  [[nodiscard]] bool unread(NodeId node) const noexcept { return unread_.test(node.value()); }
  /// Called when a connection was added or removed.
  void on_change(std::function<void()> callback) { changed_ = std::move(callback); }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void heartbeat(const co::HeartbeatEvent& event, rt::Time at) noexcept override;
  void lease_over() noexcept;
  void arm() noexcept;
  void tell();
  void supervise(NodeId node);

  rt::Task<Result<ChannelEnd>> read_end(NodeId node, std::uint16_t object);
  rt::Task<Result<std::uint16_t>> free_object(NodeId node, std::uint16_t first, std::uint16_t last);
  rt::Task<Result<void>> write_end(ChannelEnd end);
  rt::Task<bool> clear_end(ChannelEnd end);
  rt::Task<bool> read_node(NodeId node, std::vector<ChannelEnd>& ends);
  rt::Task<Result<void>> clean(NodeId node);
  rt::Task<Result<SdoConnection>> make(NodeId client, NodeId server);
  rt::Task<void> take_back(SdoConnection connection);
  rt::Task<void> look_at(NodeId node, bool lost);
  rt::Task<void> work();
  rt::Task<void> expire();
  rt::Task<void> answer(NodeId client, NodeId server);

  can::Dispatcher* dispatcher_;
  co::SdoClient* sdo_;
  SdoManagerOptions options_;
  SdoConnections connections_;
  co::HeartbeatConsumer heartbeats_;
  std::function<void()> changed_;
  rt::Turn turn_;
  struct Due {
    NodeId node;
    bool lost = false;  // else it booted
  };
  std::deque<Due> due_;
  std::bitset<128> unread_;  // did not answer `recover`
  rt::Later<SdoManager, &SdoManager::lease_over> lease_over_;
  bool works_ = false;
  rt::Scope scope_;  // the last member: its tasks use the others
};

}  // namespace berth::manager

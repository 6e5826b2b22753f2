/// Which CAN-IDs the SDO manager has given to which connections (CiA 302-5; docs/sdo-manager.md). Pure bookkeeping
/// without frames. Its one rule is that **no CAN-ID is in two connections**. A CAN-ID that may still be in the
/// dictionary of an unreachable node is held for that node until it was seen to have lost it.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::manager {

/// From client to server, and back.
struct ConnectionIds {
  std::uint32_t request = 0;
  std::uint32_t response = 0;
  friend bool operator==(const ConnectionIds&, const ConnectionIds&) = default;
};

struct SdoConnection {
  NodeId client;
  NodeId server;
  std::uint16_t client_object = 0;  ///< 1280h to 12FFh, of the client
  std::uint16_t server_object = 0;  ///< 1201h to 127Fh, of the server
  ConnectionIds ids;
  rt::Time until = rt::never;  ///< end of the lease
};

/// One party's channel object.
struct ChannelEnd {
  NodeId node;
  std::uint16_t object = 0;
  ConnectionIds ids = {};
  NodeId other = {};   ///< sub-index 3; unconfigured if not set
  bool valid = false;  ///< both COB-IDs are valid
};
[[nodiscard]] constexpr ChannelEnd client_end(const SdoConnection& c) noexcept {
  return {c.client, c.client_object, c.ids, c.server, true};
}
[[nodiscard]] constexpr ChannelEnd server_end(const SdoConnection& c) noexcept {
  return {c.server, c.server_object, c.ids, c.client, true};
}

class SdoConnections {
 public:
  /// CAN-IDs that CiA 301 does not restrict, and that no other service of the predefined set has.
  static constexpr can::IdRange default_pool{0x680, 0x6DF};

  /// Base format; pairs of neighbours; an odd one at the end is not used.
  explicit SdoConnections(can::IdRange pool = default_pool) noexcept;

  /// The lowest free pair; empty: none is left.
  [[nodiscard]] std::optional<ConnectionIds> take() noexcept;
  /// Takes a pair that was found in a node. False: it is no pair of this pool, or is already taken.
  [[nodiscard]] bool claim(const ConnectionIds& ids) noexcept;
  void put_back(const ConnectionIds& ids) noexcept;
  /// `node` may still have this identifier (one of the pool; others are ignored).
  void hold(std::uint32_t id, NodeId node) noexcept;
  /// The node no longer has CAN-IDs of the pool except those of its connections.
  void unhold(NodeId node) noexcept;
  [[nodiscard]] bool holds(NodeId node) const noexcept;
  [[nodiscard]] bool in_pool(std::uint32_t id) const noexcept { return id >= first_ && id < first_ + 2 * pairs_; }
  [[nodiscard]] std::size_t free() const noexcept;

  void add(const SdoConnection& connection) { all_.push_back(connection); }
  /// Forgets it; its CAN-IDs stay taken until `put_back`.
  void remove(NodeId client, NodeId server) noexcept;
  [[nodiscard]] SdoConnection* find(NodeId client, NodeId server) noexcept;
  [[nodiscard]] std::span<const SdoConnection> all() const noexcept { return all_; }
  /// An object of this node is in a connection.
  [[nodiscard]] bool uses(NodeId node, std::uint16_t object) const noexcept;
  void clear() noexcept;

 private:
  static constexpr std::size_t most = 1024;
  [[nodiscard]] std::size_t pair_of(std::uint32_t id) const noexcept { return (id - first_) / 2; }
  [[nodiscard]] bool is_free(std::size_t pair) const noexcept { return !taken_.test(pair) && holders_[pair].none(); }

  std::uint32_t first_;
  std::uint32_t pairs_;
  std::bitset<most> taken_;
  std::vector<std::bitset<128>> holders_;  // by pair
  std::vector<SdoConnection> all_;
};

}  // namespace berth::manager

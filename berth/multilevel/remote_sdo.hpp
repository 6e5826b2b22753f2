/// Remote SDO of CiA 302-7, as far as public sources describe it (docs/multilevel.md §CiA 302-7): the client names
/// network and node in an indication (command specifier 7), the router confirms it and forwards the next transfer on
/// the same channel frame by frame. Paper 3's way, by objects of the gateway: `gateway_access.hpp` (client) and
/// `sdo_gateway.hpp` (gateway).
///
///     E0 nn nn id 00 00 00 00    network-ID little-endian, node-ID; both ways (the layout is Berth's reading: no
///     public
///                                source gives it)
///
/// An indication applies to the next transfer, up to its end. Network 0 is the router itself: its own server handles
/// the transfer.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/co/sdo_access.hpp"
#include "berth/od/values.hpp"
#include "berth/rt/turn.hpp"

namespace berth::multilevel {

/// A network that a router reaches.
struct RemoteNetwork {
  std::uint16_t network = 1;           ///< its ID, not 0
  can::Dispatcher* beneath = nullptr;  ///< the bus on the way there
  const co::SdoClient* client =
      nullptr;      ///< the router's own client on that bus: a transfer to a node that it is using waits; null: none
  NodeId router{};  ///< the next router on that bus; unconfigured: the network is that bus
};

class RemoteSdo final : private od::ChannelRelay {
 public:
  /// `upper` is the router's dictionary, whose SDO servers hear the indications. All must outlive it. Uses the heap.
  RemoteSdo(rt::Executor& executor, od::Values& upper, std::vector<RemoteNetwork> networks,
            rt::Duration timeout = std::chrono::seconds(1));
  ~RemoteSdo();
  /// Transfers in progress.
  [[nodiscard]] std::size_t busy() const noexcept;

 private:
  class Way;
  [[nodiscard]] rt::Executor& executor() const noexcept { return *executor_; }
  bool request(std::uint8_t channel, od::ChannelBytes bytes) noexcept override;
  void stopped(std::uint8_t channel) noexcept override;
  void indicated(std::uint8_t channel, od::ChannelBytes bytes) noexcept;
  void refuse(std::uint8_t channel, od::ChannelBytes bytes, od::AbortCode code) noexcept;

  rt::Executor* executor_;
  od::Values* upper_;
  std::vector<RemoteNetwork> networks_;
  rt::Duration timeout_;
  std::array<std::unique_ptr<Way>, od::Channels::most> ways_;
};

/// The client's side: accesses a node of another network, by a router on this bus. `turn`: shared by all accesses
/// through that router, because its channel must not be used for anything else between indication and transfer.
class RemoteAccess final : public co::SdoAccess {
 public:
  RemoteAccess(can::Dispatcher& dispatcher, co::SdoClient& client, NodeId router, std::uint16_t network, NodeId node,
               rt::Turn& turn) noexcept
      : dispatcher_(&dispatcher), client_(&client), router_(router), network_(network), node_(node), turn_(&turn) {}
  rt::Task<Result<co::SdoValue>> read(std::uint16_t index, std::uint8_t sub) override;
  rt::Task<Result<void>> write(std::uint16_t index, std::uint8_t sub, std::span<const std::uint8_t> data) override;

 private:
  [[nodiscard]] Error about(const Error& error) const noexcept;
  // Sends the network indication, holding the turn; returns how to do the transfer.
  rt::Task<Result<co::SdoOptions>> reach();

  can::Dispatcher* dispatcher_;
  co::SdoClient* client_;
  NodeId router_;
  std::uint16_t network_;
  NodeId node_;
  rt::Turn* turn_;
};

}  // namespace berth::multilevel

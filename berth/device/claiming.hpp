/// Claims a node-ID for a device as SAE J1939-81 does (docs/claim.md): connects `research::ClaimSlave` to the device's
/// dispatcher. No heap after construction except for the dispatcher's lists.
#pragma once

#include "berth/can/dispatcher.hpp"
#include "berth/research/claim_slave.hpp"

namespace berth::device {

class Claiming final : private can::Handler, private research::ClaimOwner {
 public:
  /// Implemented by the device; called from jobs.
  class Owner {
   public:
    /// Use this node-ID: leave initialising, send the boot-up message.
    virtual void claimed(NodeId id) noexcept = 0;
    /// Report the reason, then reset communication without a node-ID.
    virtual void claim_lost(NodeId id) noexcept = 0;

   protected:
    ~Owner() = default;
  };
  Claiming(can::Dispatcher& dispatcher, Owner& owner, const research::ClaimOptions& options)
      : dispatcher_(&dispatcher),
        owner_(&owner),
        slave_(dispatcher.executor(), static_cast<research::ClaimOwner&>(*this), options) {}

  /// Power comes on, with this address; claiming begins with `ready`.
  void power_on(const LssAddress& address) noexcept { slave_.set_address(address); }
  void power_off() noexcept;
  /// A reset begins: the device receives nothing until `ready`.
  void resetting() noexcept;
  /// The reset is over. `id`: in use; if unconfigured, claim one.
  void ready(NodeId id);

  [[nodiscard]] const research::ClaimSlave& slave() const noexcept { return slave_; }

 private:
  void received(const can::Frame& frame, rt::Time) noexcept override { slave_.received(frame); }
  void send(const can::Frame& frame) noexcept override { dispatcher_->send(frame); }
  void claimed(NodeId id) noexcept override;
  void claim_lost(NodeId id) noexcept override { owner_->claim_lost(id); }

  can::Dispatcher* dispatcher_;
  Owner* owner_;
  research::ClaimSlave slave_;
  NodeId claimed_;  // claimed since power-on: not firm
};

}  // namespace berth::device

/// A device's part in claiming a node-ID as SAE J1939-81 does (docs/claim.md): lets `research::ClaimSlave` hear and send
/// through the device's dispatcher. No heap after construction beyond what the dispatcher's lists grow to.
#pragma once

#include "berth/can/dispatcher.hpp"
#include "berth/research/claim_slave.hpp"

namespace berth::device {

class Claiming final : private can::Handler, private research::ClaimOwner {
 public:
  /// What the device does; called from jobs.
  class Owner {
   public:
    /// Use it: leave initialising, boot-up.
    virtual void claimed(NodeId id) noexcept = 0;
    /// Tell why, then reset communication without a node-ID.
    virtual void claim_lost(NodeId id) noexcept = 0;

   protected:
    ~Owner() = default;
  };
  Claiming(can::Dispatcher& dispatcher, Owner& owner, const research::ClaimOptions& options)
      : dispatcher_(&dispatcher),
        owner_(&owner),
        slave_(dispatcher.executor(), static_cast<research::ClaimOwner&>(*this), options) {}

  /// Power comes on, with this address; it begins with `ready`.
  void power_on(const LssAddress& address) noexcept { slave_.set_address(address); }
  void power_off() noexcept;
  /// A reset begins: the device hears nothing until `ready`.
  void resetting() noexcept;
  /// The reset is over. `id`: in use; unconfigured: claim one.
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
  NodeId claimed_;  // what a claim gave since power-on: not firm
};

}  // namespace berth::device

/// The schemes besides LSS that give a device a node-ID: RAND and AND, which it answers (`NodeIdMethods`), the
/// negotiation of paper 2 (`Negotiation`) and claiming as in SAE J1939-81 (`Claiming`). While a master works on the
/// device by LSS, RAND or AND, the negotiation waits (SX.6).
///
/// No heap after construction except for the dispatcher's lists.
#pragma once

#include <memory>

#include "berth/device/claiming.hpp"
#include "berth/device/errors.hpp"
#include "berth/device/lss_slave.hpp"
#include "berth/device/negotiation.hpp"
#include "berth/device/node_id_methods.hpp"
#include "berth/device/own_identifiers.hpp"

namespace berth::device {

class NodeIdSchemes final : public OwnIdentifiers::Owner,
                            private can::Handler,
                            private Negotiation::Owner,
                            private Claiming::Owner {
 public:
  /// Implemented by the device; called from jobs, or when a frame is received.
  class Owner {
   public:
    /// `id` was negotiated or claimed and is active: leave initialising, send the boot-up message.
    virtual void node_id_given(NodeId id) noexcept = 0;
    /// The device lost its node-ID to another node, and the error is raised: reset communication without one.
    virtual void node_id_lost() noexcept = 0;
    /// The negotiation failed: all 127 are in use.
    virtual void changed() noexcept = 0;

   protected:
    ~Owner() = default;
  };
  /// `memory`: for the last negotiated node-ID; null = it is not kept. All must outlive it.
  NodeIdSchemes(can::Dispatcher& dispatcher, const Options& options, NvMemory* memory, const Host& host, LssSlave& lss,
                Errors& errors, Owner& owner);

  /// @name Power and resets, called by the device
  /// @{
  /// Call after `LssSlave::power_on`.
  void power_on() noexcept;
  void power_off() noexcept;
  /// A reset begins: receives nothing until `listen` and `ready`.
  void resetting() noexcept;
  /// Receives RAND and AND requests.
  void listen();
  /// The reset is over. `id`: in use; if unconfigured, negotiate or claim one.
  void ready(NodeId id);
  /// @}

  /// A master sent a request, by LSS or by one of these schemes; `answered`: by this device.
  void master_heard(bool answered) noexcept;
  /// Another node sent with this device's identifiers.
  void doubled() noexcept override;

  [[nodiscard]] nodeid::Identification identification() const noexcept { return methods_.identification(); }
  [[nodiscard]] nodeid::Identification and_identification() const noexcept { return methods_.and_identification(); }
  /// Null when the device does not claim.
  [[nodiscard]] const research::ClaimSlave* claimer() const noexcept {
    return claiming_ ? &claiming_->slave() : nullptr;
  }
  /// Null when the device does not negotiate.
  [[nodiscard]] const research::Negotiator* negotiator() const noexcept {
    return negotiation_ ? &negotiation_->negotiator() : nullptr;
  }

  /// Bytes held outside the object.
  [[nodiscard]] std::size_t memory() const noexcept {
    return (negotiation_ ? sizeof(Negotiation) : 0) + (claiming_ ? sizeof(Claiming) : 0);
  }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void negotiated(NodeId id) noexcept override;
  void negotiation_lost(NodeId id, research::IdLoss why) noexcept override;
  void negotiation_failed() noexcept override { owner_->changed(); }
  void negotiation_kept(NodeId id) noexcept override;
  [[nodiscard]] rt::Duration in_world(rt::Duration own) const noexcept override { return host_->in_world(own); }
  void claimed(NodeId id) noexcept override { negotiated(id); }
  void claim_lost(NodeId id) noexcept override { negotiation_lost(id, research::IdLoss::none); }

  can::Dispatcher* dispatcher_;
  const Options* options_;
  const Host* host_;
  LssSlave* lss_;
  Errors* errors_;
  Owner* owner_;
  NodeIdMethods methods_;
  std::unique_ptr<Negotiation> negotiation_;  // only with Options::negotiation
  std::unique_ptr<Claiming> claiming_;        // only with Options::claim
};

}  // namespace berth::device

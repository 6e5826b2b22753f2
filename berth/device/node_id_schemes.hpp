/// The schemes besides LSS by which a device comes to a node-ID: RAND and AND, which it answers (`NodeIdMethods`), the
/// negotiation of paper 2 (`Negotiation`) and claiming as SAE J1939-81 has it (`Claiming`). A master that works on the
/// device by LSS, RAND or AND shall not be raced: while it does, the negotiation waits (SX.6).
///
/// No heap after construction beyond what the dispatcher's lists grow to.
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
  /// What the device does; called from jobs, or while a frame is heard.
  class Owner {
   public:
    /// `id` was negotiated or claimed and is active: leave initialising, boot-up.
    virtual void node_id_given(NodeId id) noexcept = 0;
    /// It lost its node-ID to another node, the error is raised: reset communication without one.
    virtual void node_id_lost() noexcept = 0;
    /// The negotiation failed: all 127 are in use.
    virtual void changed() noexcept = 0;

   protected:
    ~Owner() = default;
  };
  /// `memory`: where the last negotiated node-ID is kept; null = it is not. All must outlive it.
  NodeIdSchemes(can::Dispatcher& dispatcher, const Options& options, NvMemory* memory, const Host& host, LssSlave& lss,
                Errors& errors, Owner& owner);

  /// @name Power and resets, as the device orders them
  /// @{
  /// Behind `LssSlave::power_on`.
  void power_on() noexcept;
  void power_off() noexcept;
  /// A reset begins: hears nothing until `listen` and `ready`.
  void resetting() noexcept;
  /// Hears RAND and AND requests.
  void listen();
  /// The reset is over. `id`: in use; unconfigured: negotiate, or claim one.
  void ready(NodeId id);
  /// @}

  /// A master asks, by LSS or by one of these schemes; `answered`: by this device.
  void master_heard(bool answered) noexcept;
  /// Another node sent with this device's identifiers.
  void doubled() noexcept override;

  [[nodiscard]] nodeid::Identification identification() const noexcept { return methods_.identification(); }
  [[nodiscard]] nodeid::Identification and_identification() const noexcept { return methods_.and_identification(); }
  /// Null when the device does not claim.
  [[nodiscard]] const research::ClaimSlave* claimer() const noexcept { return claiming_ ? &claiming_->slave() : nullptr; }
  /// Null when the device does not negotiate.
  [[nodiscard]] const research::Negotiator* negotiator() const noexcept {
    return negotiation_ ? &negotiation_->negotiator() : nullptr;
  }

  /// Bytes beyond itself.
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

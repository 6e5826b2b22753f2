/// A device's part in the negotiation of node-IDs (paper 2): connects `research::Negotiator` to the device's
/// dispatcher, keeps the last node-ID in non-volatile memory, and instructs the device. No heap after construction
/// except for the dispatcher's lists.
#pragma once

#include "berth/can/dispatcher.hpp"
#include "berth/device/nv_memory.hpp"
#include "berth/research/negotiator.hpp"

namespace berth::device {

/// Whether the device negotiates a node-ID when it has none (paper 2).
enum class NegotiationMode : std::uint8_t {
  off,
  on,       ///< an established node defends its node-ID
  literal,  ///< with the paper's conflict rule: both nodes lose their node-ID (S2.17)
};

class Negotiation final : private can::Handler,
                          private can::Confirmation,
                          private research::NegotiatorOwner,
                          private NvMemory::Done,
                          private rt::Job {
 public:
  /// Implemented by the device; called from jobs.
  class Owner {
   public:
    /// Use this node-ID: leave initialising, send the boot-up message.
    virtual void negotiated(NodeId id) noexcept = 0;
    /// Report the reason, then reset communication without a node-ID.
    virtual void negotiation_lost(NodeId id, research::IdLoss why) noexcept = 0;
    virtual void negotiation_failed() noexcept = 0;  ///< all 127 are in use
    virtual void negotiation_kept(NodeId id) noexcept = 0;
    [[nodiscard]] virtual rt::Duration in_world(rt::Duration own) const noexcept = 0;

   protected:
    ~Owner() = default;
  };
  /// Place of the last node-ID in a device's memory, and how many bytes it may take.
  static constexpr std::size_t memory_at = 32;
  /// A request of another scheme to this device stops the negotiation for so long (SX.6).
  static constexpr rt::Duration pause_for_others = std::chrono::seconds(2);

  /// `memory`: null = the last node-ID is lost at power-off.
  Negotiation(can::Dispatcher& dispatcher, Owner& owner, NvMemory* memory, const research::NegotiatorOptions& options);
  ~Negotiation();

  /// Power comes on, with this address; negotiation begins with `ready`.
  void power_on(const LssAddress& address) noexcept;
  void power_off() noexcept;
  /// A reset begins: the device receives nothing until `ready`.
  void resetting() noexcept;
  /// The reset is over. `id`: in use; if unconfigured, negotiate.
  void ready(NodeId id) noexcept;
  /// Another scheme addresses this device.
  void others_at_work() noexcept { negotiator_.suspend(pause_for_others); }
  /// Another node sent under this device's identifiers.
  void doubled() noexcept { negotiator_.doubled(); }

  [[nodiscard]] const research::Negotiator& negotiator() const noexcept { return negotiator_; }
  /// The last node-ID in memory.
  [[nodiscard]] NodeId last() const noexcept { return last_; }

 private:
  void received(const can::Frame& frame, rt::Time) noexcept override { negotiator_.received(frame); }
  void sent(rt::Time) noexcept override { negotiator_.sent(); }
  bool send(const can::Frame& frame) noexcept override;
  void withdraw() noexcept override;
  [[nodiscard]] bool nothing_queued() const noexcept override { return dispatcher_->port().status().queued == 0; }
  [[nodiscard]] std::uint32_t bit_rate() const noexcept override { return dispatcher_->port().status().bit_rate; }
  void node_id_taken(NodeId id) noexcept override;
  void node_id_lost(NodeId id, research::IdLoss why) noexcept override;
  void all_taken() noexcept override { owner_->negotiation_failed(); }
  void node_id_kept(NodeId id) noexcept override { owner_->negotiation_kept(id); }
  [[nodiscard]] rt::Duration in_world(rt::Duration own) const noexcept override { return owner_->in_world(own); }
  void written(bool ok) noexcept override;
  void run() noexcept override { keep(); }
  void keep() noexcept;
  void listen(bool all);
  [[nodiscard]] bool stored() noexcept;

  can::Dispatcher* dispatcher_;
  Owner* owner_;
  std::optional<NvRecord> record_;
  research::NegotiatorOptions options_;
  research::Negotiator negotiator_;
  NodeId last_;        // preferred; kept in memory
  NodeId negotiated_;  // negotiated since power-on: not firm
  bool hears_ = false;
  bool lost_ = false;  // the reset under way is because the node-ID was lost
};

}  // namespace berth::device

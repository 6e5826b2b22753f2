/// A device's part in the negotiation of node-IDs (paper 2): lets `research::Negotiator` hear and send through the
/// device's dispatcher, keeps the last node-ID in non-volatile memory, and tells the device what to do. No heap after
/// construction beyond what the dispatcher's lists grow to.
#pragma once

#include "berth/can/dispatcher.hpp"
#include "berth/device/nv_memory.hpp"
#include "berth/research/negotiator.hpp"

namespace berth::device {

/// Does the device negotiate a node-ID when it has none (paper 2)?
enum class NegotiationMode : std::uint8_t {
  off,
  on,       ///< an established node defends its node-ID
  literal,  ///< with the paper's conflict rule: both lose theirs (S2.17)
};

class Negotiation final : private can::Handler,
                          private can::Confirmation,
                          private research::NegotiatorOwner,
                          private NvMemory::Done,
                          private rt::Job {
 public:
  /// What the device does; called from jobs.
  class Owner {
   public:
    /// Use it: leave initialising, boot-up.
    virtual void negotiated(NodeId id) noexcept = 0;
    /// Tell why, then reset communication without a node-ID.
    virtual void negotiation_lost(NodeId id, research::IdLoss why) noexcept = 0;
    virtual void negotiation_failed() noexcept = 0;  ///< all 127 are in use
    virtual void negotiation_kept(NodeId id) noexcept = 0;
    [[nodiscard]] virtual rt::Duration in_world(rt::Duration own) const noexcept = 0;

   protected:
    ~Owner() = default;
  };
  /// Where in a device's memory the last node-ID stands, and how many bytes it may take.
  static constexpr std::size_t memory_at = 32;
  /// Another scheme's request to this device stops the negotiation for so long (SX.6).
  static constexpr rt::Duration pause_for_others = std::chrono::seconds(2);

  /// `memory`: null = the last node-ID is forgotten with the power.
  Negotiation(can::Dispatcher& dispatcher, Owner& owner, NvMemory* memory, const research::NegotiatorOptions& options);
  ~Negotiation();

  /// Power comes on, with this address; it begins with `ready`.
  void power_on(const LssAddress& address) noexcept;
  void power_off() noexcept;
  /// A reset begins: the device hears nothing until `ready`.
  void resetting() noexcept;
  /// The reset is over. `id`: in use; unconfigured: negotiate.
  void ready(NodeId id) noexcept;
  /// Another scheme talks to this device.
  void others_at_work() noexcept { negotiator_.suspend(pause_for_others); }
  /// Another node sent under this device's identifiers.
  void doubled() noexcept { negotiator_.doubled(); }

  [[nodiscard]] const research::Negotiator& negotiator() const noexcept { return negotiator_; }
  /// The last node-ID, as memory has it.
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
  NodeId last_;        // to be preferred; is kept in memory
  NodeId negotiated_;  // what the negotiation gave since power-on: not firm
  bool hears_ = false;
  bool lost_ = false;  // the reset under way is because of it
};

}  // namespace berth::device

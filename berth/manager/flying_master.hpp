/// A device on a bus that can be NMT master (CiA 302-2, flying master; docs/flying-master.md): adds frames, timers and
/// the heartbeat supervision of the active master to `FlyingNegotiation`.
///
///     FlyingMaster flying(dispatcher, owner);
///     flying.begin(options, heartbeat_of);     // the device has booted
///     ...                                      // owner.role_changed(): commands, or no longer
///     flying.end();                            // it is reset
///
/// It shares the dispatcher with the device, whose heartbeat (1017h) shows the others that it is there.
#pragma once

#include <functional>

#include "berth/can/dispatcher.hpp"
#include "berth/co/heartbeat.hpp"
#include "berth/manager/flying_negotiation.hpp"

namespace berth::manager {

class FlyingMaster final : private can::Handler,
                           private can::Confirmation,
                           private co::HeartbeatConsumer::Observer,
                           private rt::Job {
 public:
  /// Called from frames, timers and the functions below; may call back, must not destroy it.
  class Owner {
   public:
    /// It became the active master, or no longer is, or the active master (`active`) changed.
    virtual void role_changed() noexcept = 0;
    /// NMT reset communication to all nodes, this device included: at a cold start without an active master.
    virtual void reset_all() noexcept = 0;
    /// An NMT command of another node, while this one is the active master.
    virtual void overheard(const co::NmtRequest& request) noexcept = 0;

   protected:
    ~Owner() = default;
  };
  /// How long a master with this node-ID may be silent; 0: its heartbeat is not supervised.
  using HeartbeatOf = std::function<rt::Duration(NodeId)>;

  /// Both must outlive this.
  FlyingMaster(can::Dispatcher& dispatcher, Owner& owner);
  ~FlyingMaster();

  /// Errc::invalid: the priority is above 2, there is no node-ID, or the times are not sound (`FlyingTiming::sound`).
  [[nodiscard]] Result<void> begin(const FlyingOptions& options, HeartbeatOf heartbeat_of);
  /// Stops taking part; an active master stops being one, without a call to the owner.
  void end() noexcept;
  /// The next `begin` is a cold start.
  void power_off() noexcept;

  [[nodiscard]] bool is_master() const noexcept { return rules_.is_master(); }
  [[nodiscard]] bool took_over() const noexcept { return rules_.took_over(); }
  [[nodiscard]] FlyingNegotiation::State state() const noexcept { return rules_.state(); }
  [[nodiscard]] std::optional<MasterRank> active() const noexcept { return rules_.active(); }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void sent(rt::Time at) noexcept override;
  void heartbeat(const co::HeartbeatEvent& event, rt::Time at) noexcept override;
  void run() noexcept override;
  void carry_out(const FlyingNegotiation::Step& step) noexcept;
  void send(FlyingService service) noexcept;
  void supervise(std::optional<NodeId> node) noexcept;

  can::Dispatcher* dispatcher_;
  Owner* owner_;
  HeartbeatOf heartbeat_of_;
  FlyingNegotiation rules_;
  co::HeartbeatConsumer heartbeats_;
  std::optional<MasterRank> known_;  // the active master last reported to the owner
  NodeId supervised_;
  bool was_master_ = false;
};

}  // namespace berth::manager

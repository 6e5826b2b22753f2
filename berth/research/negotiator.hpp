/// One device's side of the negotiation of node-IDs without a master (paper 2; S2.1 to S2.31): the state machine.
/// Frames in, frames out; no heap, no exceptions.
///
///     start -> listening -> asking -> asked -> competing -> announcing -> settled
///                 ^  100 ms silence    100 ms   16 bytes      100 ms         |
///                 |                                                          | conflict lost
///                 +--- waiting <--- a lower byte was heard -----------------+
///
/// Default rules, where the paper leaves a gap or is not safe (`literal` = as published):
/// - A heard byte is compared with the own byte of that number throughout the negotiation (S2.27); a queued frame is
///   dropped when a lower byte is heard. A frame equal to the one just heard counts as sent: no device could see the
///   difference, and the bus is spared (not in `literal`).
/// - Frames of one device are 5 ms and two frame times apart, twice that while the bus load that it hears is above a
///   limit (S2.26, S2.28).
/// - Each waiting device joins another device's ReqUsedNodeId; if it is sent twice, the window begins anew (S2.22,
///   S2.23).
/// - Devices answer ReqUsedNodeId one after another: each leaves a gap after the previous answer, so that 127 answers,
///   which outrank every PDO, never block the bus in one piece. The asking device waits until they end.
/// - Frames that begin at the same moment merge; if all nodes of a bus send, none acknowledges. So a device that asks
///   waits an additional random time; one that only joined sends each byte two frame times later; and a frame that is
///   not acknowledged soon is taken back and sent again after a random time (in `literal` only this).
/// - An announcement comes after 100 ms and an additional random time; a device that hears it chooses another node-ID.
///   This separates clones with one identity, and two winners after a lost frame (S2.24, S2.25).
/// - A device with a node-ID defends it: it answers an announcement of its own node-ID by ActUsedNodeId (S2.17). For
///   `probation` after its own announcement it is the newcomer and yields. Two long-time holders (two segments joined,
///   clones) both defend, then toss a coin each time the other insists, until one yields. A holder of a node-ID that
///   was not negotiated (`firm`) never yields.
/// - A device with a node-ID sends ActUsedNodeId at random intervals of about `check`: if nothing else is ever sent
///   under the node-ID, this traffic reveals two holders.
/// - All 127 in use: `exhausted`; asks again after `retry` (S2.29).
#pragma once

#include <cstdint>

#include "berth/research/negotiation_cycle.hpp"
#include "berth/research/negotiation_rules.hpp"
#include "berth/research/node_id_defence.hpp"
#include "berth/rt/executor.hpp"

namespace berth::research {

class Negotiator final : private NegotiationCycle::Owner, private NodeIdDefence::Owner {
 public:
  Negotiator(rt::Executor& executor, NegotiatorOwner& owner, const NegotiatorOptions& options) noexcept;
  Negotiator(const Negotiator&) = delete;
  Negotiator& operator=(const Negotiator&) = delete;

  /// While off: sets another identity, from power-on.
  void set_address(const LssAddress& address) noexcept { options_.address = address; }
  /// The device has no valid node-ID. `last`: its previous one, which is preferred; unconfigured: none.
  void start(NodeId last = {}) noexcept;
  /// The device hears the bus (again) after it lost its node-ID and was reset: its present work begins anew. Without
  /// effect unless it negotiates.
  void begin_anew() noexcept;
  /// The device has a node-ID from another source (memory, switches, LSS): it answers and defends. `firm`: never
  /// yields.
  void settle(NodeId id, bool firm) noexcept;
  /// Power off or reset: forgets everything and takes back the queued frame.
  void stop() noexcept;
  /// Another scheme is active: the negotiation begins anew after `time`, without a further call (SX.6). No effect with
  /// a node-ID.
  void suspend(rt::Duration time) noexcept;

  /// A frame that another node sent: all of `negotiation_frames`; all others count as bus load.
  void received(const can::Frame& frame) noexcept;
  /// The frame given to `send` was sent.
  void sent() noexcept;
  /// Another node sent under one of this device's identifiers (e.g. a heartbeat; S2.24).
  void doubled() noexcept;

  [[nodiscard]] Negotiating state() const noexcept {
    return node_id().configured() ? Negotiating::settled : cycle_.state();
  }
  /// In use; unconfigured unless settled.
  [[nodiscard]] NodeId node_id() const noexcept { return defence_.node_id(); }
  /// Last loss.
  [[nodiscard]] IdLoss lost() const noexcept { return lost_; }
  /// Another device won a cycle that this one won: a clone, or a frame was lost.
  [[nodiscard]] bool had_rival() const noexcept { return cycle_.had_rival(); }
  /// Cycles begun, frames given to `send`.
  [[nodiscard]] std::uint32_t cycles() const noexcept { return cycle_.begun(); }
  [[nodiscard]] std::uint32_t frames() const noexcept { return sender_.frames(); }
  /// Bus load of the last 100 ms by others' frames, as this device heard them, 0..1.
  [[nodiscard]] double load() noexcept { return sender_.load(); }
  /// Its choice if no node-ID were in use.
  [[nodiscard]] NodeId preferred() const noexcept { return choice_.preferred(); }

 private:
  void id_won(NodeId id) noexcept override;
  void none_free() noexcept override;
  void id_lost(NodeId id, IdLoss why) noexcept override;
  void id_kept(NodeId id) noexcept override;

  NegotiatorOwner* owner_;
  NegotiatorOptions options_;
  NegotiationSender sender_;
  NodeIdChoice choice_{options_};
  NegotiationCycle cycle_;
  NodeIdDefence defence_;
  IdLoss lost_ = IdLoss::none;
};

}  // namespace berth::research

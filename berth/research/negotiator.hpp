/// One device's side of the negotiation of node-IDs without a master (paper 2; S2.1 to S2.31): the state machine.
/// Frames in, frames out; no heap, no exceptions.
///
///     start -> listening -> asking -> asked -> competing -> announcing -> settled
///                 ^  100 ms silence    100 ms   16 bytes      100 ms         |
///                 |                                                          | conflict lost
///                 +--- waiting <--- a lower byte was heard -----------------+
///
/// Default rules, where the paper leaves a gap or is not safe (`literal` = as published):
/// - A byte is compared with the own byte of that number whenever it is heard while negotiating (S2.27); a frame that
///   is still queued is dropped when a lower byte is heard. One that is equal to what was just heard counts as sent:
///   no device could tell the difference, and the bus is spared (not in `literal`).
/// - Frames of one device are 5 ms and two frame times apart, twice that while the bus load that the device hears is
///   above a limit (S2.26, S2.28).
/// - ReqUsedNodeId of another device is joined by each that waits; asked twice, the window begins anew (S2.22, S2.23).
/// - ReqUsedNodeId is answered one after another: each device leaves a gap after the answer before its own, so that
///   127 answers, which outrank every PDO, never block the bus in one piece. The device that asked waits until they
///   end.
/// - Frames that begin in one instant merge; when all nodes of a bus send, none acknowledges. So a device that asks
///   waits a random time more, one that only joined is two frame times behind with each byte, and a frame that is not
///   acknowledged soon is taken back and sent again after a random time (in `literal` only this).
/// - An announcement comes after 100 ms and a random time more; a device that hears it chooses another node-ID. So
///   clones with one identity, and two winners after a lost frame, part here (S2.24, S2.25).
/// - A device with a node-ID defends it: it answers an announcement of its own node-ID by ActUsedNodeId (S2.17). For
///   `probation` after its own announcement it is the newcomer and yields. Two that have both had it for long (two
///   segments joined, clones) both defend, then throw a coin each time the other insists, until one yields. One that
///   has a node-ID that was not negotiated (`firm`) never yields.
/// - With a node-ID, one ActUsedNodeId is sent at random about every `check`: where nothing else under the node-ID is
///   ever sent, this is the traffic that tells two holders apart.
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

  /// While off: another identity, from power-on.
  void set_address(const LssAddress& address) noexcept { options_.address = address; }
  /// The device has no valid node-ID. `last`: the one it had before, preferred; unconfigured: none.
  void start(NodeId last = {}) noexcept;
  /// The device hears the bus (again) after it lost its node-ID and made its reset: what it does now begins anew. Only
  /// while it negotiates; else nothing.
  void begin_anew() noexcept;
  /// The device has a node-ID from elsewhere (memory, switches, LSS): it answers and defends. `firm`: never yields.
  void settle(NodeId id, bool firm) noexcept;
  /// Power off, reset: forgets all, takes back what is queued.
  void stop() noexcept;
  /// Another scheme is at work: the negotiation begins anew after `time` without a further call (SX.6). With a node-ID:
  /// nothing.
  void suspend(rt::Duration time) noexcept;

  /// A frame that another node sent: all of `negotiation_frames`; every other one counts for the bus load.
  void received(const can::Frame& frame) noexcept;
  /// The frame given to `send` is on the wire.
  void sent() noexcept;
  /// Another node sent under one of this device's identifiers (heartbeat, say; S2.24).
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
  /// What it would choose if nothing were in use.
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

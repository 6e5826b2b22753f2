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
/// - ReqUsedNodeId is answered one after another: each device leaves a gap behind the answer before its own, so that
///   127 answers, which outrank every PDO, never block the bus in one piece. The device that asked waits until they
///   end.
/// - Frames that begin in one instant merge; when all nodes of a bus send, none acknowledges. So a device that asks
///   waits a random time more, one that only joined is two frame times behind with each byte, and a frame that is not
///   acknowledged soon is taken back and sent again after a random time (in `literal` only this).
/// - An announcement comes after 100 ms and a random time more; a device that hears it chooses another node-ID. So
///   twins with one identity, and two winners after a lost frame, part here (S2.24, S2.25).
/// - A device with a node-ID defends it: it answers an announcement of its own node-ID by ActUsedNodeId (S2.17). For
///   `probation` after its own announcement it is the newcomer and yields. Two that have both had it for long (two
///   segments joined, twins) both defend, then throw a coin each time the other insists, until one yields. One that has
///   a node-ID that was not negotiated (`firm`) never yields.
/// - With a node-ID, one ActUsedNodeId is sent at random about every `check`: where nothing else under the node-ID is
///   ever sent, this is the traffic that tells two holders apart.
/// - All 127 in use: `exhausted`; asks again after `retry` (S2.29).
#pragma once

#include <array>
#include <bitset>
#include <chrono>
#include <cstdint>

#include "berth/base/ids.hpp"
#include "berth/base/random.hpp"
#include "berth/nodeid/negotiation_frames.hpp"
#include "berth/rt/executor.hpp"

namespace berth::nodeid {

enum class Negotiating : std::uint8_t {
  off,
  suspended,   ///< another scheme is at work (SX.6)
  listening,   ///< has just begun: waits for silence (S2.23)
  asking,      ///< ReqUsedNodeId is queued
  asked,       ///< hears which node-IDs are used
  competing,   ///< sends its identity
  waiting,     ///< lost this cycle: waits for its end (S2.14)
  announcing,  ///< has won: waits, then announces
  settled,     ///< has a node-ID
  exhausted,   ///< all 127 are in use
};
[[nodiscard]] const char* name(Negotiating state) noexcept;

/// Why a device lost its node-ID.
enum class IdLoss : std::uint8_t {
  none,
  defended,   ///< it was the newcomer, and the holder defended its node-ID
  contested,  ///< two held it; this one yielded
  literal,    ///< the paper's rule: both lose it (S2.17)
};
[[nodiscard]] const char* name(IdLoss why) noexcept;

struct NegotiatorOptions {
  LssAddress address{};    ///< all four parts are used (S2.8)
  bool literal = false;    ///< the rules as published
  NodeId configured{};     ///< preferred when no last one is known; else it is derived from the identity (S2.21)
  std::uint64_t seed = 1;  ///< of this device; twins need different ones

  // All by the device's own clock (SX.4).
  rt::Duration quiet = std::chrono::milliseconds(100);      ///< silence before asking, and after a cycle that was lost
  rt::Duration answers = std::chrono::milliseconds(100);    ///< ReqUsedNodeId to the first byte
  rt::Duration pause = std::chrono::milliseconds(100);      ///< last byte to the announcement
  rt::Duration spacing = std::chrono::milliseconds(5);      ///< least time from one own byte to the next
  rt::Duration after_pause = std::chrono::milliseconds(5);  ///< `quiet` is so much longer for a loser: the winner,
                                                            ///< which waits as long, announces first (Table 4)
  // Not in `literal`:
  rt::Duration jitter = std::chrono::milliseconds(3);         ///< most that a request, announcement or defence waits
  rt::Duration answer_slot = std::chrono::microseconds(500);  ///< from one node-ID's turn to answer to the next's
  rt::Duration straggler = std::chrono::milliseconds(30);     ///< the last answer to the first byte, at least
  rt::Duration probation = std::chrono::seconds(1);           ///< a newcomer for so long
  rt::Duration contest = std::chrono::seconds(30);            ///< conflicts are one quarrel within this time
  rt::Duration check = std::chrono::seconds(20);              ///< mean time of a holder's checks; 0 = none
  rt::Duration retry = std::chrono::seconds(5);               ///< from `exhausted`
  double load_limit = 0.5;                                    ///< bus load above which the pace halves, 0..1
};

/// The device. Called from `Negotiator`'s calls and timers; may not call back into it, except `received`'s caller.
class NegotiatorOwner {
 public:
  /// Queues a frame, in place of one that is still queued; `Negotiator::sent` is called when it is on the wire. False:
  /// not possible now, it is tried again.
  virtual bool send(const can::Frame& frame) noexcept = 0;
  /// Takes the queued frame back. `sent` is not called for it, even if it is on the wire already.
  virtual void withdraw() noexcept = 0;
  /// The controller has nothing to send: a frame that was given to it and never confirmed is gone.
  [[nodiscard]] virtual bool nothing_queued() const noexcept = 0;
  [[nodiscard]] virtual std::uint32_t bit_rate() const noexcept = 0;  ///< bit/s; 0 = unknown
  /// This node-ID is its own from now on: leave initialising, keep it in memory.
  virtual void node_id_taken(NodeId id) noexcept = 0;
  /// Tell why (EMCY 8150h while it has the node-ID), then reset communication. It negotiates already for another.
  virtual void node_id_lost(NodeId id, IdLoss why) noexcept = 0;
  /// No node-ID is free.
  virtual void all_taken() noexcept = 0;
  /// A quarrel about the own node-ID is over, and it was kept.
  virtual void node_id_kept(NodeId id) noexcept = 0;
  /// Duration of the device's clock in the world's.
  [[nodiscard]] virtual rt::Duration in_world(rt::Duration own) const noexcept { return own; }

 protected:
  ~NegotiatorOwner() = default;
};

class Negotiator final {
 public:
  Negotiator(rt::Executor& executor, NegotiatorOwner& owner, const NegotiatorOptions& options) noexcept;

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

  [[nodiscard]] Negotiating state() const noexcept { return state_; }
  /// In use; unconfigured unless settled.
  [[nodiscard]] NodeId node_id() const noexcept { return node_id_; }
  /// Last loss.
  [[nodiscard]] IdLoss lost() const noexcept { return lost_; }
  /// Another device won a cycle that this one won: a twin, or a frame was lost.
  [[nodiscard]] bool had_rival() const noexcept { return rival_; }
  /// Cycles begun, frames given to `send`.
  [[nodiscard]] std::uint32_t cycles() const noexcept { return cycles_; }
  [[nodiscard]] std::uint32_t frames() const noexcept { return frames_; }
  /// Bus load of the last 100 ms by others' frames, as this device heard them, 0..1.
  [[nodiscard]] double load() noexcept;
  /// What it would choose if nothing were in use.
  [[nodiscard]] NodeId preferred() const noexcept;

 private:
  class Timer final : public rt::Job {
   public:
    using Action = void (Negotiator::*)() noexcept;
    Timer(Negotiator& negotiator, Action action) noexcept : negotiator_(&negotiator), action_(action) {}
    void run() noexcept override { (negotiator_->*action_)(); }

   private:
    Negotiator* negotiator_;
    Action action_;
  };
  static constexpr unsigned buckets = 4;
  static constexpr rt::Duration bucket = std::chrono::milliseconds(25);

  void step() noexcept;   // the negotiation's timer
  void speak() noexcept;  // a holder's: answer, defence or check is due
  void calm() noexcept;   // a quarrel is over
  void enter(Negotiating state, rt::Duration own) noexcept;
  void restart_step(rt::Duration own) noexcept;
  void offer(const can::Frame& frame) noexcept;
  void listen() noexcept;
  void ask() noexcept;
  void join() noexcept;
  void send_byte() noexcept;
  void byte_done() noexcept;
  void announce() noexcept;
  void take() noexcept;
  void lose_cycle() noexcept;
  void wait() noexcept;
  void heard_request() noexcept;
  void heard_used(NodeId id) noexcept;
  void heard_identity(unsigned byte, std::uint8_t value) noexcept;
  void conflict() noexcept;
  void lose_id(IdLoss why) noexcept;
  bool put(const can::Frame& frame) noexcept;
  void drop() noexcept;
  void speak_at(rt::Duration own) noexcept;
  void schedule_check() noexcept;
  void count_load(unsigned bits) noexcept;
  void roll_load() noexcept;
  [[nodiscard]] NodeId choose() const noexcept;
  [[nodiscard]] rt::Duration frame_time() const noexcept;
  [[nodiscard]] rt::Duration pace() noexcept;
  [[nodiscard]] rt::Duration behind() const noexcept;
  [[nodiscard]] rt::Duration random(rt::Duration most) noexcept;

  rt::Executor* executor_;
  NegotiatorOwner* owner_;
  NegotiatorOptions options_;
  Random random_;
  Timer step_{*this, &Negotiator::step};
  Timer speak_{*this, &Negotiator::speak};
  Timer calm_{*this, &Negotiator::calm};
  std::bitset<128> used_;  // heard since the cycle began
  NodeId last_;            // preferred
  NodeId node_id_;
  NodeId candidate_;  // announced, not yet on the wire
  NodeId avoid_;      // lost in a conflict, until `avoided_until_`
  rt::Time avoided_until_{};
  rt::Time since_{};        // settled: when
  rt::Time window_ends_{};  // listening, asked: not before
  std::array<std::uint32_t, buckets> bits_{};
  rt::Time bucket_ends_{};
  unsigned bucket_ = 0;
  std::uint32_t cycles_ = 0;
  std::uint32_t frames_ = 0;
  unsigned insisted_ = 0;  // times the other came back after a defence
  std::uint8_t byte_ = 0;  // next to send
  Negotiating state_ = Negotiating::off;
  IdLoss lost_ = IdLoss::none;
  bool queued_ = false;  // a frame is with the owner
  bool firm_ = false;
  bool owes_ = false;      // an answer or a defence is due
  bool defended_ = false;  // a defence went out since the other was last heard
  bool rival_ = false;
  bool leads_ = false;  // sent the last frame of this cycle itself
};

}  // namespace berth::nodeid

/// Shared by the parts of `Negotiator`: its states, rules and times, and its device.
#pragma once

#include <chrono>
#include <cstdint>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::research {

enum class Negotiating : std::uint8_t {
  off,
  suspended,   ///< another scheme is active (SX.6)
  listening,   ///< has just begun: waits for silence (S2.23)
  asking,      ///< ReqUsedNodeId is queued
  asked,       ///< learns which node-IDs are in use
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
  NodeId configured{};     ///< preferred if no last one is known; if unset, derived from the identity (S2.21)
  std::uint64_t seed = 1;  ///< of this device; clones need different ones

  // All by the device's own clock (SX.4).
  rt::Duration quiet = std::chrono::milliseconds(100);      ///< silence before asking, and after a lost cycle
  rt::Duration answers = std::chrono::milliseconds(100);    ///< ReqUsedNodeId to the first byte
  rt::Duration pause = std::chrono::milliseconds(100);      ///< last byte to the announcement
  rt::Duration spacing = std::chrono::milliseconds(5);      ///< shortest time from one own byte to the next
  rt::Duration after_pause = std::chrono::milliseconds(5);  ///< added to `quiet` for a loser: the winner, which waits
                                                            ///< as long, announces first (Table 4)
  // Not in `literal`:
  rt::Duration jitter = std::chrono::milliseconds(3);         ///< longest delay of a request, announcement or defence
  rt::Duration answer_slot = std::chrono::microseconds(500);  ///< from one node-ID's turn to answer to the next's
  rt::Duration straggler = std::chrono::milliseconds(30);     ///< the last answer to the first byte, at least
  rt::Duration probation = std::chrono::seconds(1);           ///< how long a device is a newcomer
  rt::Duration contest = std::chrono::seconds(30);            ///< conflicts within this time are one quarrel
  rt::Duration check = std::chrono::seconds(20);              ///< mean interval of a holder's checks; 0 = none
  rt::Duration retry = std::chrono::seconds(5);               ///< from `exhausted`
  double load_limit = 0.5;                                    ///< bus load above which the pace halves, 0..1
};

/// The device. Called from `Negotiator`'s calls and timers; must not call back into it, except from the caller of
/// `received`.
class NegotiatorOwner {
 public:
  /// Queues a frame, replacing one that is still queued; `Negotiator::sent` is called when it was sent. False: not
  /// possible now; it is tried again.
  virtual bool send(const can::Frame& frame) noexcept = 0;
  /// Takes the queued frame back. `sent` is not called for it, even if it was already sent.
  virtual void withdraw() noexcept = 0;
  /// The controller has nothing to send: a frame given to it but never confirmed is lost.
  [[nodiscard]] virtual bool nothing_queued() const noexcept = 0;
  [[nodiscard]] virtual std::uint32_t bit_rate() const noexcept = 0;  ///< bit/s; 0 = unknown
  /// The device has this node-ID from now on: leave initialising, store it.
  virtual void node_id_taken(NodeId id) noexcept = 0;
  /// Report the reason (EMCY 8150h while it has the node-ID), then reset communication. It already negotiates for
  /// another one.
  virtual void node_id_lost(NodeId id, IdLoss why) noexcept = 0;
  /// No node-ID is free.
  virtual void all_taken() noexcept = 0;
  /// A quarrel about the own node-ID ended, and the node-ID was kept.
  virtual void node_id_kept(NodeId id) noexcept = 0;
  /// Converts a duration of the device's clock to the world's.
  [[nodiscard]] virtual rt::Duration in_world(rt::Duration own) const noexcept { return own; }

 protected:
  ~NegotiatorOwner() = default;
};

}  // namespace berth::research

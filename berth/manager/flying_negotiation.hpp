/// The rules by which one of several devices becomes NMT master (CiA 302-2, flying master; docs/flying-master.md), as a
/// state machine without bus and clock. Input: frames, times and the loss of the active master. Output: the frame to be
/// sent and the next time to be woken. `FlyingMaster` connects it to a bus.
///
///     off ── begin ──> waiting ── delay ──> detecting ── an active one answers ──> standby
///                        ^                      │                                    │ ^
///           076, or      │             nobody v │       its heartbeat is lost, 072 v │ │ 071
///           worse 071 ───┘                    negotiating <────────────────────────┘─┘
///                                               │ slot time
///                                             claiming ── 071 is on the wire ──> master
///
/// CiA 302-2, as publicly known, leaves some points open. Berth's choices:
/// - **Equal priority.** A candidate does not replace an active master of the same priority, whichever node-ID is
///   lower: no needless take-over. Node-IDs decide among candidates of one priority (slot time), and between two active
///   masters.
/// - **072 at an active master** is answered with 071: the sender did not hear it.
/// - **Two active masters**: the worse one yields when it hears the other's 071; the better one answers 071. 076, which
///   each sends every cycle, makes the other one negotiate.
/// - **An active master that hears an NMT command of another node** sends 076 at once, in addition to each cycle: two
///   active masters are separated before they boot the same slaves.
/// - **A standby master asks** (073) after `quiet_cycles` cycles without a 071: however frames got lost, all learn the
///   same active master, and a bus with a candidate always gets one.
/// - **The boot-up message of the active master** counts as its loss: it was reset, and is no longer master.
#pragma once

#include <cstdint>
#include <optional>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::manager {

/// The services, by the identifiers of their frames (base format).
enum class FlyingService : std::uint8_t {
  active_master = 0x71,     ///< DLC 2, priority and node-ID: the sender is the active master
  negotiation = 0x72,       ///< DLC 0: the slot times begin
  detect_active = 0x73,     ///< DLC 0: asks for the active master
  capable = 0x74,           ///< DLC 0: the sender can be master
  detect_capable = 0x75,    ///< DLC 0: asks for devices that can be master
  force_negotiation = 0x76  ///< DLC 0: makes an active master negotiate anew
};
inline constexpr can::IdRange flying_master_ids{0x071, 0x076};

/// Lower is better: the priority first, then the node-ID.
struct MasterRank {
  std::uint8_t priority = 1;  ///< 1F90h:03: 0 high, 1 medium, 2 low
  NodeId node;
  friend constexpr bool operator==(const MasterRank&, const MasterRank&) noexcept = default;
  [[nodiscard]] constexpr bool better_than(const MasterRank& other) const noexcept {
    return priority != other.priority ? priority < other.priority : node.value() < other.node.value();
  }
};

/// A decoded frame.
struct FlyingMessage {
  FlyingService service = FlyingService::active_master;
  MasterRank sender;  ///< of `active_master`
  friend constexpr bool operator==(const FlyingMessage&, const FlyingMessage&) noexcept = default;
};
[[nodiscard]] can::Frame to_frame(const FlyingMessage& message) noexcept;
/// Empty: another identifier, a remote or FD frame, another length, a node-ID of 0 or above 127.
[[nodiscard]] std::optional<FlyingMessage> parse_flying(const can::Frame& frame) noexcept;

/// 1F90h, with its defaults.
struct FlyingTiming {
  rt::Duration detection = std::chrono::milliseconds(100);       ///< sub 1: time in which an active master answers
  rt::Duration delay = std::chrono::milliseconds(500);           ///< sub 2: from the boot-up to 073
  rt::Duration priority_slot = std::chrono::milliseconds(1500);  ///< sub 4; more than 127 device slots
  rt::Duration device_slot = std::chrono::milliseconds(10);      ///< sub 5
  rt::Duration cycle{};  ///< sub 6: interval of an active master's 076; 0: 4 s and 10 ms for each node-ID

  [[nodiscard]] constexpr rt::Duration cycle_of(NodeId node) const noexcept {
    return cycle.count() > 0 ? cycle : std::chrono::milliseconds(4000 + 10 * int{node.value()});
  }
  /// From 072 to this candidate's 071.
  [[nodiscard]] constexpr rt::Duration slot_of(const MasterRank& rank) const noexcept {
    return rank.priority * priority_slot + rank.node.value() * device_slot;
  }
  /// Slots of two priorities do not overlap, and no time is 0.
  [[nodiscard]] constexpr bool sound() const noexcept {
    constexpr int nodes = 127;
    return detection.count() > 0 && device_slot.count() > 0 && priority_slot > nodes * device_slot;
  }
  friend constexpr bool operator==(const FlyingTiming&, const FlyingTiming&) noexcept = default;
};

struct FlyingOptions {
  MasterRank own = {};  ///< node-ID configured, priority 0 to 2
  FlyingTiming timing = {};
  /// After power-on without an active master: all nodes are reset once before the negotiation. If false, the first
  /// master of a bus does not disturb running devices (keep-alive slaves).
  bool resets_when_cold = true;
};

class FlyingNegotiation {
 public:
  enum class State : std::uint8_t {
    off,
    waiting,      ///< the negotiation delay
    detecting,    ///< 073 was sent
    negotiating,  ///< 072 was sent or heard: the slot time runs
    claiming,     ///< 071 waits for the wire
    master,       ///< the active one
    standby,      ///< another one is active
    checking,     ///< 073 was sent by a doubting standby master
  };
  static constexpr int quiet_cycles = 3;

  /// What to do now.
  struct Step {
    std::optional<FlyingService> send;  ///< 071 in `claiming` is confirmed by `claimed`
    bool reset_all = false;             ///< NMT reset communication to all nodes, this device included
  };

  /// The device has booted. It is cold at its first `begin` since `power_off`, or since construction.
  void begin(const FlyingOptions& options, rt::Time now) noexcept;
  /// The device is reset, or stops taking part.
  void end() noexcept;
  void power_off() noexcept;

  [[nodiscard]] Step received(const FlyingMessage& message, rt::Time now) noexcept;
  /// A boot-up message of another node.
  [[nodiscard]] Step booted(NodeId node, rt::Time now) noexcept;
  /// An NMT command of another node.
  [[nodiscard]] Step commanded(rt::Time now) noexcept;
  /// The heartbeat of the active master stopped.
  [[nodiscard]] Step lost(rt::Time now) noexcept;
  /// The 071 that `claiming` requested was sent.
  void claimed(rt::Time now) noexcept;
  /// Call it at `deadline`.
  [[nodiscard]] Step due(rt::Time now) noexcept;

  [[nodiscard]] rt::Time deadline() const noexcept { return deadline_; }
  [[nodiscard]] State state() const noexcept { return state_; }
  [[nodiscard]] bool is_master() const noexcept { return state_ == State::master; }
  /// Another node is the active master, as far as is known.
  [[nodiscard]] bool stands_by() const noexcept { return state_ == State::standby || state_ == State::checking; }
  /// The active master: this device or another; empty while none is known.
  [[nodiscard]] std::optional<MasterRank> active() const noexcept;
  /// As active master: nothing was reset before, so slaves may be running under a previous master.
  [[nodiscard]] bool took_over() const noexcept { return !all_reset_; }
  [[nodiscard]] const FlyingOptions& options() const noexcept { return options_; }

 private:
  Step heard_master(const MasterRank& sender, rt::Time now) noexcept;
  Step step_down(rt::Time now) noexcept;
  void wait(rt::Time now) noexcept;
  void negotiate(rt::Time now) noexcept;
  void stand_by(const MasterRank& active, rt::Time now) noexcept;
  void enter(State state, rt::Time deadline) noexcept;

  FlyingOptions options_;
  rt::Time deadline_ = rt::never;
  rt::Time forced_{};  // when it last sent 076 as active master
  MasterRank active_;
  State state_ = State::off;
  bool cold_ = true;
  bool all_reset_ = false;
};
/// "off", "waiting", ...
[[nodiscard]] const char* name(FlyingNegotiation::State state) noexcept;

}  // namespace berth::manager

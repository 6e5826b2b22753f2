/// Who is NMT master, when several devices can be (CiA 302-2, flying master; docs/flying-master.md): the rules, as a
/// state machine without bus and clock. Frames, times and the loss of the active master go in; the frame to be sent and
/// the next time to be woken come out. `FlyingMaster` puts it on a bus.
///
///     off ── begin ──> waiting ── delay ──> detecting ── an active one answers ──> standby
///                        ^                      │                                    │ ^
///           076, or      │             nobody v │       its heartbeat is lost, 072 v │ │ 071
///           worse 071 ───┘                    negotiating <────────────────────────┘─┘
///                                               │ slot time
///                                             claiming ── 071 is on the wire ──> master
///
/// What CiA 302-2 as it is publicly known leaves open is settled so:
/// - **Equal priority.** An active master is left in office by a candidate of the same priority, whichever node-ID is
///   lower: no needless take-over. Node-IDs count among candidates of one priority (slot time), and between two active
///   masters.
/// - **072 at an active master** is answered with 071: who asks did not hear it.
/// - **Two active masters**: of what hears the other's 071 the worse one yields, and the better one answers 071. 076,
///   which each sends every cycle, makes the other one negotiate.
/// - **An active master that hears an NMT command of another node** sends 076 at once, and not only with the cycle: two
///   that command are parted before they boot the same slaves.
/// - **A standby master asks** (073) when it has heard no 071 for `quiet_cycles` cycles: however frames got lost, all
///   come to know the same active master, and no bus that has a candidate stays without one.
/// - **The boot-up message of the active master** is the loss of it: it was reset, and no longer is master.
#pragma once

#include <cstdint>
#include <optional>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::manager {

/// The services, by the identifiers of their frames (base format).
enum class FlyingService : std::uint8_t {
  active_master = 0x71,     ///< DLC 2, priority and node-ID: I am the active master
  negotiation = 0x72,       ///< DLC 0: the slot times begin
  detect_active = 0x73,     ///< DLC 0: who is active master?
  capable = 0x74,           ///< DLC 0: here is a device that can be master
  detect_capable = 0x75,    ///< DLC 0: is there a device that can be master?
  force_negotiation = 0x76  ///< DLC 0: an active master negotiates anew
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

/// A frame taken apart.
struct FlyingMessage {
  FlyingService service = FlyingService::active_master;
  MasterRank sender;  ///< of `active_master`
  friend constexpr bool operator==(const FlyingMessage&, const FlyingMessage&) noexcept = default;
};
[[nodiscard]] can::Frame to_frame(const FlyingMessage& message) noexcept;
/// Empty: another identifier, a remote or FD frame, another length, a node-ID of 0 or above 127.
[[nodiscard]] std::optional<FlyingMessage> parse_flying(const can::Frame& frame) noexcept;

/// 1F90h, and what it is by default.
struct FlyingTiming {
  rt::Duration detection = std::chrono::milliseconds(100);       ///< sub 1: an active master answers within
  rt::Duration delay = std::chrono::milliseconds(500);           ///< sub 2: from the boot-up to 073
  rt::Duration priority_slot = std::chrono::milliseconds(1500);  ///< sub 4; more than 127 device slots
  rt::Duration device_slot = std::chrono::milliseconds(10);      ///< sub 5
  rt::Duration cycle{};  ///< sub 6: an active master sends 076 so often; 0: 4 s and 10 ms for each node-ID

  [[nodiscard]] constexpr rt::Duration cycle_of(NodeId node) const noexcept {
    return cycle.count() > 0 ? cycle : std::chrono::milliseconds(4000 + 10 * int{node.value()});
  }
  /// From 072 to this candidate's 071.
  [[nodiscard]] constexpr rt::Duration slot_of(const MasterRank& rank) const noexcept {
    return rank.priority * priority_slot + rank.node.value() * device_slot;
  }
  /// Slots of two priorities do not overlap, and every time is one.
  [[nodiscard]] constexpr bool sound() const noexcept {
    constexpr int nodes = 127;
    return detection.count() > 0 && device_slot.count() > 0 && priority_slot > nodes * device_slot;
  }
  friend constexpr bool operator==(const FlyingTiming&, const FlyingTiming&) noexcept = default;
};

struct FlyingOptions {
  MasterRank own = {};  ///< node-ID configured, priority 0 to 2
  FlyingTiming timing = {};
  /// After power-on, and with no active master there: all nodes are reset first (once), and only then is negotiated.
  /// Without it a device that runs is not disturbed by the first master of a bus (keep-alive slaves).
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
    standby,      ///< another is
    checking,     ///< 073 was sent by a standby master that doubts
  };
  static constexpr int quiet_cycles = 3;

  /// What is to be done now.
  struct Step {
    std::optional<FlyingService> send;  ///< 071 in `claiming` is confirmed by `claimed`
    bool reset_all = false;             ///< NMT reset communication to all nodes, this device included
  };

  /// The device has booted. It is cold when it never began before since `power_off`, or since it was made.
  void begin(const FlyingOptions& options, rt::Time now) noexcept;
  /// The device is reset, or takes part no longer.
  void end() noexcept;
  void power_off() noexcept;

  [[nodiscard]] Step received(const FlyingMessage& message, rt::Time now) noexcept;
  /// A boot-up message of another node.
  [[nodiscard]] Step booted(NodeId node, rt::Time now) noexcept;
  /// An NMT command of another node.
  [[nodiscard]] Step commanded(rt::Time now) noexcept;
  /// The heartbeat of the active master is over.
  [[nodiscard]] Step lost(rt::Time now) noexcept;
  /// The 071 that `claiming` asked for is on the wire.
  void claimed(rt::Time now) noexcept;
  /// `deadline` is reached.
  [[nodiscard]] Step due(rt::Time now) noexcept;

  [[nodiscard]] rt::Time deadline() const noexcept { return deadline_; }
  [[nodiscard]] State state() const noexcept { return state_; }
  [[nodiscard]] bool is_master() const noexcept { return state_ == State::master; }
  /// Another node is the active master, as far as is known.
  [[nodiscard]] bool stands_by() const noexcept { return state_ == State::standby || state_ == State::checking; }
  /// The active master: this device or another; empty while nobody is known to be.
  [[nodiscard]] std::optional<MasterRank> active() const noexcept;
  /// As active master: nothing was reset before, so slaves may be running under a former master.
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
  rt::Time forced_{};  // the last 076 as active master
  MasterRank active_;
  State state_ = State::off;
  bool cold_ = true;
  bool all_reset_ = false;
};
/// "off", "waiting", ...
[[nodiscard]] const char* name(FlyingNegotiation::State state) noexcept;

}  // namespace berth::manager

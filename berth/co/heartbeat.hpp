/// Heartbeat producer and consumer (CiA 301 §7.2.8.3.2.2, objects 1016h and 1017h; docs/protocols/cia301.md §Error
/// control).
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <utility>

#include "berth/can/dispatcher.hpp"
#include "berth/co/nmt.hpp"
#include "berth/od/abort_code.hpp"

namespace berth::co {

/// A time as 1016h, 1017h and 100Ch hold it: whole milliseconds, 65535 at most.
[[nodiscard]] constexpr std::uint16_t whole_ms(rt::Duration time) noexcept {
  constexpr std::int64_t most = 0xFFFF;
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(time).count();
  return static_cast<std::uint16_t>(std::clamp<std::int64_t>(ms, 0, most));
}

/// Sends the NMT state every 1017h milliseconds. The first heartbeat follows one period after the start, because the
/// boot-up message counts as the first. At most one heartbeat waits in the port: a later one replaces it.
class HeartbeatProducer final : private rt::Job, private can::Confirmation {
 public:
  explicit HeartbeatProducer(can::Dispatcher& dispatcher) noexcept : dispatcher_(&dispatcher) {}

  /// Starts after the boot-up message of `node` (configured).
  void start(NodeId node, NmtState state = NmtState::pre_operational) noexcept;
  /// Stops: reset, power off. A waiting heartbeat is withdrawn.
  void stop() noexcept;
  /// 1017h; 0 = off. If started, a new period begins.
  void set_period(rt::Duration period) noexcept;
  /// The state that the next heartbeats carry.
  void set_state(NmtState state) noexcept { state_ = state; }

  [[nodiscard]] rt::Duration period() const noexcept { return period_; }
  /// True while heartbeats are sent; guarding is off then.
  [[nodiscard]] bool active() const noexcept { return timed() || ready(); }

 private:
  void run() noexcept override;
  void sent(rt::Time) noexcept override {}
  can::Dispatcher* dispatcher_;
  rt::Duration period_{};
  rt::Time next_{};
  NodeId node_;
  NmtState state_ = NmtState::pre_operational;
};

struct HeartbeatEvent {
  enum class Kind : std::uint8_t {
    started,        ///< first heartbeat of a supervised node: supervision begins
    state_changed,  ///< a heartbeat carries another state than the one before
    lost,           ///< none for the heartbeat time; reported once until `recovered`
    recovered,      ///< first heartbeat after `lost`
    boot_up,        ///< boot-up message: the node was reset; supervision waits for its next heartbeat
    never_seen,     ///< no heartbeat since supervision was set up or since the boot-up; reported once
  };
  Kind kind = Kind::started;
  NodeId node;
  bool supervised = true;                      ///< false only for boot-ups heard by `hear_all_boot_ups`
  NmtState state = NmtState::initialising;     ///< newest state heard
  NmtState previous = NmtState::initialising;  ///< state before this event
};
[[nodiscard]] const char* name(HeartbeatEvent::Kind kind) noexcept;

/// Supervises up to 127 nodes. Supervision of a node starts with its first heartbeat, not with the boot-up message and
/// not with the entry. A frame costs a table look-up and a store; one timer serves all nodes. Frames of a length other
/// than 1 and unknown states are ignored, and so is the reserved bit 7.
class HeartbeatConsumer final : private can::Handler, private rt::Job {
 public:
  class Observer {
   public:
    /// May call the consumer; must not destroy it.
    virtual void heartbeat(const HeartbeatEvent& event, rt::Time at) noexcept = 0;

   protected:
    ~Observer() = default;
  };
  static constexpr unsigned entries = 127;
  static constexpr rt::Duration unlimited = std::chrono::hours(24 * 365);  ///< a node with this time is never lost

  /// `most` (1..127): entries of 1016h, and nodes for which memory is allocated; a device with few saves 3 kB.
  HeartbeatConsumer(can::Dispatcher& dispatcher, Observer& observer, unsigned most = entries);

  /// Writes 1016h:`sub` (1..`most`): bits 23..16 node-ID, 15..0 time in ms. Node-ID 0 or above 127 or time 0 = unused.
  /// A second entry for a node that has one: 0604 0043; bits 31..24 not zero: 0609 0030; sub out of range: 0609 0011.
  /// A refused write changes nothing. Supervision of the node begins anew even when the value is the same.
  od::AbortCode set_entry(std::uint8_t sub, std::uint32_t value) noexcept;
  [[nodiscard]] std::uint32_t entry(std::uint8_t sub) const noexcept;
  /// The same without sub-indices, for managers: time 0 = off. A node has one heartbeat time; if it has a 1016h entry,
  /// the entry's time changes.
  void supervise(NodeId node, rt::Duration time) noexcept;
  /// Forgets all nodes and entries, but keeps `hear_all_boot_ups`.
  void clear() noexcept;

  /// `never_seen` is reported when a node's first heartbeat is missing for this long after its entry was made or its
  /// boot-up message came. A longer heartbeat time of the node replaces it, unless that is `unlimited`. 0 = never
  /// (default; CiA 301 has no such event).
  void set_never_seen_time(rt::Duration time) noexcept;
  /// Reports also boot-up messages of nodes that are not supervised.
  void hear_all_boot_ups(bool on) noexcept;

  /// Newest state of a supervised node; empty before its first heartbeat, while lost, and when it is not supervised.
  [[nodiscard]] std::optional<NmtState> state(NodeId node) const noexcept;
  [[nodiscard]] bool supervised(NodeId node) const noexcept;
  [[nodiscard]] bool lost(NodeId node) const noexcept;
  /// True when every supervised node's heartbeat is there, or when none is supervised.
  [[nodiscard]] bool all_active() const noexcept;
  [[nodiscard]] bool all_operational() const noexcept;

 private:
  enum class Watched : std::uint8_t { waiting, active, lost };
  struct Node {
    rt::Time deadline = rt::never;  // of the next heartbeat, or of never_seen
    rt::Duration time{};
    Watched watched = Watched::waiting;
    bool was_lost = false;  // lost, and no heartbeat since
    NmtState state = NmtState::initialising;
    std::uint8_t entry = 0;  // sub-index of the 1016h entry, 0 = made by `supervise`
    std::uint8_t number = 0;
  };
  static constexpr std::uint8_t nowhere = 0xFF;
  [[nodiscard]] Node* find(unsigned number) noexcept {
    return places_[number] == nowhere ? nullptr : &nodes_[places_[number]];
  }
  [[nodiscard]] const Node* find(NodeId node) const noexcept {
    return !node.configured() || places_[node.value()] == nowhere ? nullptr : &nodes_[places_[node.value()]];
  }
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void run() noexcept override;
  void heard(std::uint8_t node, NmtState state, rt::Time at) noexcept;
  void booted(std::uint8_t node, rt::Time at) noexcept;
  void begin(std::uint8_t node, rt::Duration time, std::uint8_t entry) noexcept;
  void end(std::uint8_t node) noexcept;
  void report(HeartbeatEvent::Kind kind, std::uint8_t node, NmtState previous, rt::Time at) noexcept;
  void arm(rt::Time deadline) noexcept;
  [[nodiscard]] rt::Time never_seen_at(const Node& node, rt::Time since) const noexcept;
  void listen() noexcept;

  can::Dispatcher* dispatcher_;
  Observer* observer_;
  rt::Duration never_seen_time_{};
  std::vector<Node> nodes_;                  // supervised nodes, unordered
  std::array<std::uint8_t, 128> places_;     // by node-ID: the index in nodes_
  std::vector<std::uint32_t> entry_values_;  // by sub-index
  bool hear_all_ = false;
};

}  // namespace berth::co

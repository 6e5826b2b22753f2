/// The nodes of one segment by slot, with counts of their states, so that a frame without errors needs to check none of
/// them. Internal to `sim`.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "berth/sim/bit_time.hpp"
#include "berth/sim/bus_node.hpp"

namespace berth::sim {

class SegmentNodes {
 public:
  /// Gives the node the first free slot. Its state counts from the next `recount` on.
  void join(BusNode& node);
  void leave(BusNode& node) noexcept;
  /// Power, bit rate, listen-only or participation of a node has changed.
  void recount() noexcept;
  /// A node's counters became zero, or are no longer zero.
  void counters_changed(bool clean) noexcept { noisy_ += clean ? -1U : 1U; }
  void suspension(bool begins) noexcept { suspended_ += begins ? 1U : -1U; }
  void lose_acknowledger() noexcept { --acknowledgers_; }
  /// A frame ended without error: its senders and receivers count it (rules 7 and 8 of fault confinement), and a
  /// passive sender suspends transmission from `free`, the end of the intermission, on. Call it while `any_noisy`.
  void count_good_frame(std::span<BusNode* const> senders, rt::Time free) noexcept;

  /// By slot, null where there is none.
  [[nodiscard]] const std::vector<BusNode*>& slots() const noexcept { return slots_; }
  [[nodiscard]] BusNode& at(std::uint32_t slot) const noexcept { return *slots_[slot]; }
  /// The slot of a controller's node; `BusNode::no_slot`: it is not here.
  [[nodiscard]] std::uint32_t find(const Controller* controller) const noexcept;
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  /// Nodes that have power and are not bus-off.
  [[nodiscard]] unsigned present() const noexcept { return present_; }
  [[nodiscard]] unsigned acknowledgers() const noexcept { return acknowledgers_; }
  [[nodiscard]] bool any_noisy() const noexcept { return noisy_ > 0; }  ///< TEC or REC not zero
  [[nodiscard]] bool any_suspended() const noexcept { return suspended_ > 0; }
  [[nodiscard]] bool any_integrating() const noexcept { return integrating_ > 0; }
  /// True if bit rates differ.
  [[nodiscard]] bool mixed() const noexcept { return mixed_; }
  /// Their bit time, when they are not `mixed`.
  [[nodiscard]] rt::Duration bit() const noexcept { return bit_; }
  /// The shortest bit time of those that have power.
  [[nodiscard]] rt::Duration shortest_bit() const noexcept;

 private:
  std::vector<BusNode*> slots_;
  unsigned count_ = 0;
  unsigned present_ = 0;
  unsigned acknowledgers_ = 0;
  unsigned noisy_ = 0;
  unsigned suspended_ = 0;
  unsigned integrating_ = 0;
  bool mixed_ = false;
  rt::Duration bit_{};
};

}  // namespace berth::sim

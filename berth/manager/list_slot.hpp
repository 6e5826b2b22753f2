/// A slave of a network list, as its master's node-ID source uses it.
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "berth/places/plan.hpp"

namespace berth::manager {

/// Why a slave of the list is missing or disturbed. The numbers appear in 5F0Bh.
enum class NodeIdTrouble : std::uint8_t {
  none = 0,
  nobody = 1,       ///< no device of its type was found
  kept = 2,         ///< a device may have stored the node-ID, and does not answer: no other one gets it
  stranger = 3,     ///< an unwanted device answers under it
  doubled = 4,      ///< two devices answer under it
  refuses = 5,      ///< its device takes no node-ID
  power_cycle = 6,  ///< its device has stored it, but uses another one until it is switched off and on
  failed = 7,       ///< assigning it failed; it is tried again
  lost = 8,         ///< the device that has it does not answer: the next one of its type gets it
  equals = 9,       ///< several of its type without serial numbers wait for a node-ID: LSS cannot distinguish them
};

/// A slave of the list, as a slot.
struct ListSlot {
  places::Slot slot;
  bool typed = false;                ///< its vendor-ID and product code are given: it can be assigned to a device
  bool there = false;                ///< known by the master, or it answered
  bool guarded = false;              ///< it answered guarding in this run
  std::optional<Identity> device{};  ///< the device that answered under the node-ID in this run
  NodeIdTrouble trouble = NodeIdTrouble::none;  ///< of its last binding in this run

  [[nodiscard]] NodeId id() const noexcept { return slot.spec.id; }
  /// Its device sets its own node-ID: a device that answers under it and fits the type sits here, and it is not
  /// assigned.
  [[nodiscard]] bool fixed() const noexcept { return slot.spec.assign == places::Assign::fixed; }
  [[nodiscard]] bool free() const noexcept { return typed && !fixed() && !slot.record.device(); }
  /// Missing, and a search may find its device.
  [[nodiscard]] bool missing() const noexcept { return typed && !fixed() && !there; }
  /// The device that answered under the node-ID has given it up.
  void leave() noexcept {
    there = false;
    device.reset();
  }
};

/// Null: there is none.
[[nodiscard]] inline ListSlot* slot_at(std::vector<ListSlot>& slots, NodeId id) noexcept {
  const auto it = std::ranges::find_if(slots, [&](const ListSlot& s) { return s.id() == id; });
  return it == slots.end() ? nullptr : &*it;
}
[[nodiscard]] inline ListSlot* slot_of(std::vector<ListSlot>& slots, const Identity& device) noexcept {
  const auto it = std::ranges::find_if(slots, [&](const ListSlot& s) { return s.slot.record.device() == device; });
  return it == slots.end() ? nullptr : &*it;
}

}  // namespace berth::manager

/// The devices found on the bus of a network list in one run, each under one identity. A device with a serial number is
/// known by its LSS address; one without by its node-ID, because its equals have the same address.
#pragma once

#include <vector>

#include "berth/manager/list_slot.hpp"

namespace berth::manager {

class ListFound {
 public:
  /// `slots` must outlive this.
  explicit ListFound(std::vector<ListSlot>& slots) noexcept : slots_(slots) {}
  ListFound(const ListFound&) = delete;
  ListFound& operator=(const ListFound&) = delete;
  ~ListFound() = default;

  [[nodiscard]] auto begin() const noexcept { return all_.begin(); }
  [[nodiscard]] auto end() const noexcept { return all_.end(); }
  [[nodiscard]] bool empty() const noexcept { return all_.empty(); }
  void clear() noexcept { all_.clear(); }

  void note(const places::Found& device);
  void forget(const Identity& device);
  /// Null: it was not found.
  [[nodiscard]] places::Found* find(const Identity& device) noexcept;
  /// The entry of `device`. A device without a serial number that is to get a node-ID is known by that, but was found
  /// without it.
  [[nodiscard]] places::Found* one_for(const Identity& device) noexcept;
  /// A device that sits in the slot of its node-ID keeps its identity there, if the two report different parts of
  /// 1018h.
  [[nodiscard]] Identity known_as(const places::Found& found) const noexcept;
  /// Other devices answer, or may answer, to its LSS address: 40h to 43h select all of them, and their answers to 5Eh
  /// destroy each other. `own`: the node-ID that the device uses.
  [[nodiscard]] bool has_equals(const Identity& device, NodeId own = {}) const noexcept;
  /// 40h to 43h select this device, and no other.
  [[nodiscard]] bool can_be_selected(const Identity& device) const noexcept {
    return device.unknown == 0 && !has_equals(device, device.at);
  }
  /// Its node-ID cannot be changed: its LSS address is unknown, or shared.
  [[nodiscard]] bool keeps_its_node_id(const places::Found& found) const noexcept {
    return found.active.configured() && (found.device.unknown != 0 || has_equals(found.device, found.active));
  }

 private:
  std::vector<ListSlot>& slots_;
  std::vector<places::Found> all_;
};

}  // namespace berth::manager

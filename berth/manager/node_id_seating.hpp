/// Carries out what `places::plan` says of a network list: node-IDs are taken away and given by `places::Binder`, many
/// devices side by side. What each device was told is in the store before it is.
#pragma once

#include <array>
#include <vector>

#include "berth/manager/list_bus.hpp"
#include "berth/rt/scope.hpp"

namespace berth::manager {

class NodeIdSeating {
 public:
  explicit NodeIdSeating(ListBus& bus) noexcept : bus_(bus) {}

  /// The master has booted.
  void begin();
  /// At each run, of every slave that is there or has answered.
  void seen(NodeId id) noexcept { seen_at_[id.value()] = bus_.executor().now(); }

  /// What answers under the node-ID of a fixed slot is its device, or that one's replacement. `doubled`: and another.
  void take_where_it_is(ListSlot& slot, bool doubled);
  /// Frees the slots of devices that are lost where new ones of their type are there, plans, and does what the plan
  /// says, until nothing is left that can be done.
  rt::Task<void> carry_out();
  /// Devices that have no place, as far as the last plan knows.
  [[nodiscard]] const std::vector<places::Found>& without_place() const noexcept { return without_place_; }

  /// A slave's device is silent for so long before the next one of its type gets its node-ID: what was there since the
  /// master booted, and what was not heard yet (it may boot slowly).
  static constexpr rt::Duration lost_after = std::chrono::seconds(2);
  static constexpr rt::Duration never_seen_after = std::chrono::seconds(10);

 private:
  struct Resting {
    Identity device;
    NodeId old;
    rt::Time since{};
  };
  rt::Task<void> free_lost();
  [[nodiscard]] ListSlot* lost_slot_for(const Identity& device);
  [[nodiscard]] bool is_lost(const ListSlot& slot) const;
  [[nodiscard]] std::vector<Identity> new_devices() const;
  rt::Task<bool> act_on(const ListBus::Planned& planned);
  rt::Task<void> ask_vacancy(const ListBus::Planned& planned);
  rt::Task<void> ask_one(NodeId id);
  rt::Task<void> bind(ListSlot& slot, Identity device, bool& changed);
  rt::Task<bool> blank(Identity device, std::string reason);
  bool adopt(ListSlot& slot, const Identity& device);
  void ended(ListSlot& slot, const places::Binding& binding, bool fresh);
  [[nodiscard]] bool rests(const Identity& device);
  [[nodiscard]] bool was_tried(const Identity& device) const;
  void take_stock(const ListBus::Planned& planned);

  ListBus& bus_;
  std::array<rt::Time, 128> seen_at_{};
  std::vector<Resting> resting_;  // use an old node-ID until their power cycle
  std::vector<Identity> tried_;   // in vain, in this run
  std::vector<places::Found> without_place_;
};

}  // namespace berth::manager

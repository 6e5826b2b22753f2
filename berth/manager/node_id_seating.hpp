/// Carries out `places::plan` for a network list: `places::Binder` takes node-IDs away and assigns them, for many
/// devices side by side. The store has each assignment before the device is told.
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
  /// Called at each run for every slave that is there or has answered.
  void seen(NodeId id) noexcept { seen_at_[id.value()] = bus_.executor().now(); }

  /// The device that answers under the node-ID of a fixed slot is its device, or a replacement. `doubled`: another one
  /// answers, too.
  void take_where_it_is(ListSlot& slot, bool doubled);
  /// Frees the slots of lost devices if new ones of their type are there, then plans and acts until nothing more can be
  /// done.
  rt::Task<void> carry_out();
  /// Devices without a place, according to the last plan.
  [[nodiscard]] const std::vector<places::Found>& without_place() const noexcept { return without_place_; }

  /// How long a slave's device must be silent before the next one of its type gets its node-ID: if it was seen since
  /// the master booted, and if it was not heard yet (it may boot slowly).
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
  std::vector<Resting> resting_;  // these use an old node-ID until their power cycle
  std::vector<Identity> tried_;   // in vain, in this run
  std::vector<places::Found> without_place_;
};

}  // namespace berth::manager

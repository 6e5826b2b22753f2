/// The present states of the slots of a bus beneath a gateway, and their events. Other parts ask or listen and set the
/// states: this class only keeps them, and reports each change once.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "berth/design/machine.hpp"
#include "berth/operate/events.hpp"

namespace berth::tree {

/// One slot.
struct PlaceBeneath {
  places::SlotSpec spec;
  operate::SlotReport now;
  std::uint16_t profile = 0;  ///< of its device: the lower word of 1000h; 0: none, or not known
  bool identified = false;    ///< its device was, since it became operational
  /// When a gateway reported that it stops itself, because a mandatory bus beneath it failed (EMCY FF01h); empty: it
  /// did not.
  std::optional<rt::Time> stops_itself;
  rt::Time booted_again{};           ///< when Berth last had it reset
  unsigned losses = 0;               ///< EMCYs 8130h that may be about it
  std::optional<rt::Time> collided;  ///< the last EMCY 8150h of it
  bool doubled = false;              ///< from two such EMCYs: a second device uses its node-ID

  /// Its device's node-ID is not assigned by the list.
  [[nodiscard]] bool fixed() const noexcept { return spec.assign == places::Assign::fixed; }
  /// Its boot-up failed long ago, for example by lost frames: a master need not try again by itself.
  [[nodiscard]] bool left_lying(rt::Time at) const noexcept {
    constexpr rt::Duration long_enough = std::chrono::seconds(15);
    return at - std::max(now.since, booted_again) > long_enough;
  }
};

class SlotsBeneath {
 public:
  /// `bus` must outlive this.
  SlotsBeneath(rt::Executor& executor, const design::Bus& bus, std::vector<places::SlotSpec> specs,
               operate::NetworkObserver observer);
  /// Called each time all slots that are not optional have become operational; may be empty.
  void on_operational(std::function<void()> call) { operational_call_ = std::move(call); }

  void set_state(PlaceBeneath& place, places::SlotState state, std::string reason = {});
  /// Sets the reason of all slots in state unknown; no event.
  void say_of_unknown(const std::string& reason);
  /// None of them can be asked any more.
  void set_all_absent(const std::string& reason);
  /// Sets the slot's device.
  void set_device(PlaceBeneath& place, const Identity& device);

  /// Ascending by node-ID.
  [[nodiscard]] std::vector<PlaceBeneath>& all() noexcept { return places_; }
  [[nodiscard]] const std::vector<PlaceBeneath>& all() const noexcept { return places_; }
  /// Null: no slot has this node-ID.
  [[nodiscard]] PlaceBeneath* at(NodeId node) noexcept;
  [[nodiscard]] std::vector<places::SlotSpec> specs() const;
  [[nodiscard]] std::vector<NodeId> nodes() const;
  /// Of the slots that are not optional.
  [[nodiscard]] std::vector<NodeId> needed() const;
  [[nodiscard]] std::vector<operate::SlotReport> report() const;
  /// Every slot that is not optional.
  [[nodiscard]] bool operational() const noexcept;
  [[nodiscard]] operate::Events& events() noexcept { return events_; }
  [[nodiscard]] const design::Bus& bus() const noexcept { return bus_; }
  [[nodiscard]] rt::Time now() const noexcept { return executor_.now(); }

 private:
  rt::Executor& executor_;
  const design::Bus& bus_;
  operate::Events events_;
  std::vector<PlaceBeneath> places_;
  std::function<void()> operational_call_;
  bool was_operational_ = false;
};

}  // namespace berth::tree

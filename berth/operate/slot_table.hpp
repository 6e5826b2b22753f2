/// The slots of one bus at run time: their states, their rows in the store, and their events.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/operate/bus_services.hpp"
#include "berth/operate/bus_statistics.hpp"
#include "berth/operate/events.hpp"
#include "berth/operate/seat.hpp"
#include "berth/places/slot.hpp"
#include "berth/places/slot_store.hpp"

namespace berth::operate {

class SlotTable {
 public:
  using Seats = std::vector<std::unique_ptr<Seat>>;

  /// `machine`: the machine file's name.
  SlotTable(BusServices& services, std::string machine, std::vector<places::SlotSpec> specs, places::SlotStore& store,
            NetworkObserver observer);

  /// Declares the slots in the store and loads what it knows.
  Result<void> open();
  [[nodiscard]] places::SlotStore& store() const noexcept { return *store_; }
  /// This bus as the store knows it, and a device on it.
  [[nodiscard]] const places::BusName& bus() const noexcept { return bus_; }
  [[nodiscard]] places::BusDevice known(const Identity& device) const { return {device, bus_}; }

  [[nodiscard]] const Seats& seats() const noexcept { return seats_; }
  /// Null: there is none.
  [[nodiscard]] Seat* at(NodeId id) const noexcept;
  [[nodiscard]] Seat* named(const std::string& name) const noexcept;
  [[nodiscard]] Seat* with_record(places::SlotId slot) const noexcept;
  /// The slot that the device is bound to, intended or confirmed.
  [[nodiscard]] Seat* of(const Identity& device) const noexcept;
  /// For `places::plan`.
  [[nodiscard]] std::vector<places::Slot> plain() const;
  [[nodiscard]] std::vector<SlotReport> report() const;
  /// Every slot that is not optional is operational.
  [[nodiscard]] bool operational() const noexcept;

  /// Reads the slot's row again.
  void refresh(Seat& seat);
  /// Applies an event by the table of slot_life.hpp, and reports a changed state or reason. An event that changes
  /// nothing leaves the reason as it is. `letter`: the letter of a boot-up that did not take place, or ended before its
  /// first step. Returns whether the event had an effect.
  bool happened(Seat& seat, SlotEvent event, std::string reason = {}, std::optional<manager::BootStatus> letter = {});
  /// The same without a report: the slot keeps its reason until the next event changes it.
  bool happened_silently(Seat& seat, SlotEvent event) noexcept;
  /// `SlotEvent::gone`, with letter B: `fact`, and advice for the user, which later facts keep.
  void set_absent(Seat& seat, const std::string& fact);
  /// Forgets which device sits in the slot, in the store too.
  Result<void> clear(Seat& seat, const std::string& reason);

  // Of devices on this bus: the store's entries for a twin on another bus do not count.
  [[nodiscard]] bool is_marked(places::Mark mark, const Identity& device) const;
  void set_mark(places::Mark mark, const Identity& device, NodeId id, const std::string& reason);
  void take_mark(places::Mark mark, const Identity& device, const std::string& reason);
  /// The device's slot on this bus before it was given away.
  [[nodiscard]] std::optional<places::FormerSeat> former_seat_of(const Identity& device) const;
  /// The open intentions begun on this bus to take a node-ID away. Those of stores from before schema 5 count for every
  /// bus.
  [[nodiscard]] std::vector<places::UnfinishedBlank> unfinished_here() const;

  [[nodiscard]] Events& events() noexcept { return events_; }
  [[nodiscard]] BusStatistics& diagnosis() noexcept { return diagnosis_; }

 private:
  Result<void> forget_who_had_switches(Seat& seat);

  BusServices& s_;
  places::BusName bus_;
  places::SlotStore* store_;
  Events events_;
  BusStatistics diagnosis_;
  Seats seats_;
};

/// A device that fits this absent slot is on the bus and has no slot: the slot's advice names it. Empty: there is none,
/// or no longer.
void offer(SlotTable& slots, Seat& seat, const std::optional<Identity>& device);
/// The slot is filled by LSS, has no device, and this one fits it.
[[nodiscard]] bool has_vacancy_for(const SlotTable& slots, const Identity& device);

}  // namespace berth::operate

/// The slots of one bus at run time: their states, their rows in the store, and what tells of them.
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

  /// Declares the slots in the store and takes over what it knows.
  Result<void> open();
  [[nodiscard]] places::SlotStore& store() const noexcept { return *store_; }
  /// This bus, as the store knows it, and a device that is on it.
  [[nodiscard]] const places::BusName& bus() const noexcept { return bus_; }
  [[nodiscard]] places::BusDevice known(const Identity& device) const { return {device, bus_}; }

  [[nodiscard]] const Seats& seats() const noexcept { return seats_; }
  /// Null: there is none.
  [[nodiscard]] Seat* at(NodeId id) const noexcept;
  [[nodiscard]] Seat* named(const std::string& name) const noexcept;
  [[nodiscard]] Seat* with_record(places::SlotId slot) const noexcept;
  /// The slot that the device is bound to, asked for or confirmed.
  [[nodiscard]] Seat* of(const Identity& device) const noexcept;
  /// For `places::plan`.
  [[nodiscard]] std::vector<places::Slot> plain() const;
  [[nodiscard]] std::vector<SlotReport> report() const;
  /// Every slot that is not optional is operational.
  [[nodiscard]] bool operational() const noexcept;

  /// Reads the slot's row again.
  void refresh(Seat& seat);
  /// Changes the slot's life by the table of slot_life.hpp, and tells it when its state or its reason is another one.
  /// An event that changes nothing leaves the reason as it is. `letter`: how its boot-up ended that was none, or ended
  /// before its first step. Returns whether the event counted.
  bool happened(Seat& seat, SlotEvent event, std::string reason = {}, std::optional<manager::BootStatus> letter = {});
  /// The same, and nothing is told: the slot keeps its reason until the next event says more.
  bool happened_silently(Seat& seat, SlotEvent event) noexcept;
  /// `SlotEvent::gone`, with letter B: `fact`, and what a person does about it, which no later fact takes away.
  void set_absent(Seat& seat, const std::string& fact);
  /// Forgets which device sits in the slot, in the store too.
  Result<void> clear(Seat& seat, const std::string& reason);

  // Of devices on this bus: what the store has of a twin on another one is the twin's.
  [[nodiscard]] bool is_marked(places::Mark mark, const Identity& device) const;
  void set_mark(places::Mark mark, const Identity& device, NodeId id, const std::string& reason);
  void take_mark(places::Mark mark, const Identity& device, const std::string& reason);
  /// Where the device sat on this bus before its slot was given away.
  [[nodiscard]] std::optional<places::FormerSeat> former_seat_of(const Identity& device) const;
  /// The intentions to take a node-ID away that were begun on this bus and are open. Those of stores of before schema 5
  /// are of any bus.
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

/// A device that fits the slot is on the bus and has none: what an absent slot says to do names it. Empty: there is
/// none, or none any more.
void offer(SlotTable& slots, Seat& seat, const std::optional<Identity>& device);
/// A slot that LSS fills has no device, and this one fits it.
[[nodiscard]] bool has_vacancy_for(const SlotTable& slots, const Identity& device);

}  // namespace berth::operate

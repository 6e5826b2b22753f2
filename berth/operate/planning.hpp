/// The preparation and use of `places::plan`: which device is to be seated where. Considers used devices in the slots
/// and their history, node-IDs that LSS cannot give, loans, and unfinished work.
#pragma once

#include <vector>

#include "berth/operate/agenda.hpp"
#include "berth/operate/found_devices.hpp"
#include "berth/operate/slot_table.hpp"

namespace berth::operate {

class Planning {
 public:
  Planning(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found, Loans& loans) noexcept
      : s_(services), slots_(slots), agenda_(agenda), found_(found), loans_(loans) {}

  /// Plans anew, with the values read from the devices (`places::SlotSpec::probe`).
  void make(const std::vector<places::Reading>& readings);
  [[nodiscard]] const places::Plan& plan() const noexcept { return plan_; }
  /// A device is to give up a node-ID that is not its own.
  [[nodiscard]] bool has_blanks() const noexcept;
  /// Reports what is new in the plan, and adapts the slots' states to it.
  void report();
  /// The questions as events, with the names of the slots.
  [[nodiscard]] std::vector<Event> question_events() const;

  /// The device refused 11h once, has no LSS address of its own, or fits only slots whose node-IDs LSS does not give.
  [[nodiscard]] bool never_by_lss(const Identity& device) const;
  /// The used device that waits for this slot. Errors: `not_found` none does; `duplicate` several do.
  [[nodiscard]] Result<Identity> used_for(const Seat& seat) const;
  /// For users: the device that sat there is back.
  [[nodiscard]] std::string text_of_return(const Identity& device, const places::FormerSeat& sat) const;
  /// A device came back after its slot was given away. It gave its node-ID up or still holds it.
  void returned(const Identity& device, NodeId holds, const std::string& text);
  /// Work begun with the device on this bus is unfinished: it is to give a node-ID up, or back.
  [[nodiscard]] bool waits_for(const Identity& device) const;
  /// A user decided not to wait any more.
  void drop_unfinished(const Identity& device);

 private:
  struct Used {
    places::Found found;
    places::FormerSeat sat;
  };
  [[nodiscard]] std::string place_of(const places::FormerSeat& sat) const;
  [[nodiscard]] std::vector<Identity> blanks_to_finish() const;
  void return_to_former_slots();
  [[nodiscard]] std::vector<places::Found> without_used();
  void respect_fixed();
  void tell_mismatch(const Identity& device, NodeId active);
  void name_unfinished();
  void name_loans();
  void ask_about_used();
  void release_node_id(const places::Found& f);
  void name_returned();
  void report_questions();
  void report_mismatch(const places::Oddity& oddity);
  void report_clone(const places::Oddity& oddity);

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  FoundDevices& found_;
  Loans& loans_;
  places::Plan plan_;
  std::vector<Used> used_;                // found, and sat somewhere before
  std::vector<places::Oddity> returned_;  // sat in a slot, came back, and gave its node-ID up
};

}  // namespace berth::operate

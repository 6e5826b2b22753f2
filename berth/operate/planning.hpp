/// One pipeline over `places::plan`: which device is to be seated where, with what the slots and their history say of
/// used devices, of node-IDs that LSS does not give, of loans and of what is left unfinished.
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

  /// Plans anew, with what was read from the devices (`places::SlotSpec::probe`).
  void make(const std::vector<places::Reading>& readings);
  [[nodiscard]] const places::Plan& plan() const noexcept { return plan_; }
  /// A device is to give up a node-ID that it holds and that is not its own.
  [[nodiscard]] bool has_blanks() const noexcept;
  /// Tells what is new in the plan, and brings the slots' states in line with it.
  void report();
  /// The questions as events, with the names of the slots.
  [[nodiscard]] std::vector<Event> question_events() const;

  /// It refused 11h once, has no LSS address of its own, or all slots that it fits say that their node-ID is not given
  /// by LSS.
  [[nodiscard]] bool never_by_lss(const Identity& device) const;
  /// The used device that waits for this slot. Errors: `not_found` none does; `duplicate` several do.
  [[nodiscard]] Result<Identity> used_for(const Seat& seat) const;
  /// For people: the device that sat there is back.
  [[nodiscard]] std::string text_of_return(const Identity& device, const places::FormerSeat& sat) const;
  /// A device came back after its slot was given away, and gave its node-ID up or holds it still.
  void returned(const Identity& device, NodeId holds, const std::string& text);
  /// What was begun with the device on this bus is not finished: it is to give a node-ID up, or back.
  [[nodiscard]] bool waits_for(const Identity& device) const;
  /// A person says that nothing is waited for any more.
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

/// Which devices of the slots are there: the preparation step (paper 1 §III.a; S1.30), and later checks of a slot's
/// device that is heard again.
#pragma once

#include "berth/operate/configuring.hpp"
#include "berth/operate/erased_node_ids.hpp"
#include "berth/operate/place_probes.hpp"

namespace berth::operate {

class Presence final : public SeatAsker {
 public:
  Presence(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found, const ErasedNodeIds& erased,
           Asking& asking, PlaceProbes& places, Configuring& configuring) noexcept
      : s_(services),
        slots_(slots),
        agenda_(agenda),
        found_(found),
        erased_(erased),
        asking_(asking),
        places_(places),
        configuring_(configuring) {}

  /// Checks all bound slots without disturbing a running machine: heartbeats are heard first, and only silent devices
  /// are asked.
  rt::Task<void> prepare();
  /// By heartbeat, else SDO 1000h, else guarding; then by identity, because another device may sit at the slot's
  /// node-ID.
  rt::Task<void> ask_seat(Seat& seat) override;
  /// The slot's device was identified and reports operational: it is watched, and otherwise left alone.
  rt::Task<void> take_running(Seat& seat);
  /// A bound device that is silent under its node-ID may have lost it, or have another one: asks it by LSS. The turn
  /// must be held.
  rt::Task<void> look_by_lss(Seat& seat);
  /// For a slot whose device gets its node-ID by switches, plug or firmware: takes the device of the right type that
  /// sits there. Nothing is written to it. A device of another type is shown in the slot as long as it answers there;
  /// one that answers 1018h but not 1000h is letter B.
  rt::Task<void> adopt_fixed(Seat& seat);
  /// Each such slot that has no device yet, side by side.
  rt::Task<void> adopt_all_fixed();
  /// No node-ID needs to be assigned: a device that LSS does not reach, or that does not take a node-ID, already has
  /// the slot's. False: it is no longer there.
  rt::Task<bool> take_where_it_is(Seat& seat, Identity device);
  /// True: a device that stored another node-ID, or none, uses the slot's until its power cycle. The slot's state
  /// reports it.
  bool waits_beside_another(Seat& seat);

 private:
  struct Sign {
    bool alive = false;
    std::optional<NmtState> state;
    bool typed = true;  // or it may be; false: it answers 1018h and not 1000h
  };
  rt::Task<Sign> sign_of_life(NodeId id);
  rt::Task<bool> answers_first(Seat& seat);
  void hear_seat(Seat& seat);
  [[nodiscard]] const Identity* other_at(const Seat& seat) const noexcept;
  void take_stopped(Seat& seat);
  rt::Task<void> take_replacement(Seat& seat, Identity device);
  rt::Task<bool> is_its_own(Seat& seat, std::optional<NmtState> state);
  rt::Task<bool> is_it_all_the_same(Seat& seat, Identity who);
  void take_uncompared(Seat& seat, const places::Uncompared& parts);

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  FoundDevices& found_;
  const ErasedNodeIds& erased_;
  Asking& asking_;
  PlaceProbes& places_;
  Configuring& configuring_;
};

}  // namespace berth::operate

/// Spares and returning devices: what happens to a device whose slot was given away while it was gone, and to one that
/// was used elsewhere before.
#pragma once

#include <vector>

#include "berth/operate/seating.hpp"

namespace berth::operate {

class Spares {
 public:
  Spares(BusServices& services, SlotTable& slots, Agenda& agenda, Asking& asking, Configuring& configuring,
         Presence& presence, Planning& planning, Seating& seating, const ErasedNodeIds& erased) noexcept
      : s_(services),
        slots_(slots),
        agenda_(agenda),
        asking_(asking),
        configuring_(configuring),
        presence_(presence),
        planning_(planning),
        seating_(seating),
        erased_(erased) {}

  /// SDO cannot separate two devices under one node-ID, but LSS can: a device that sat here before is asked for by its
  /// address and gives the node-ID up. This takes an NMT reset, which also resets the slot's own device: at its boot-up
  /// it is checked and started again. True: there was one. The turn must be held.
  rt::Task<bool> isolate_former(Seat& seat);
  /// The same for slots given away earlier (`Doubt::former_at`), the more rarely the longer ago that was. True: LSS
  /// cannot identify one of the former devices, and SDO must show whether two hold a node-ID (`Doubt::shared`).
  rt::Task<bool> look_for_formers();
  static constexpr rt::Duration longest_pause = std::chrono::minutes(10);
  /// Called before a device is first configured in a slot that another device had. A configuration of another slot
  /// shows that the device was used elsewhere. False: it waits for a user, or it is gone.
  rt::Task<bool> clear_past(Seat& seat);
  /// `clear_past` would do more than report.
  [[nodiscard]] bool has_past(const Seat& seat) const;
  /// A user named this device, or allowed a used one.
  void make_welcome(const Identity& device);

 private:
  [[nodiscard]] std::vector<Identity> formers_of(const Seat& seat) const;
  struct Formers {
    bool isolated = false;  ///< there was one
    bool silent = false;    ///< one did not answer
  };
  rt::Task<Formers> isolate(Seat& seat, std::vector<Identity> formers);
  [[nodiscard]] bool had_another(const Seat& seat, const Identity& device) const;
  rt::Task<Result<bool>> foreign_date(Seat& seat);
  rt::Task<bool> restore_seat(Seat& seat);

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  Asking& asking_;
  Configuring& configuring_;
  Presence& presence_;
  Planning& planning_;
  Seating& seating_;
  const ErasedNodeIds& erased_;
  std::vector<Identity> welcome_;
};

}  // namespace berth::operate

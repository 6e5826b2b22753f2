/// Spares and devices that return: what becomes of a device whose slot was given away while it was gone, and of one
/// that was used elsewhere before.
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

  /// Two devices under one node-ID cannot be told apart by SDO. By LSS they can: a device that sat here before is asked
  /// for by its address, and gives the node-ID up. That takes an NMT reset, which the slot's own device does too: it is
  /// checked and started again at its boot-up. True: there was one. The turn must be held.
  rt::Task<bool> isolate_former(Seat& seat);
  /// The same for slots that were given away a while ago (`Doubt::former_at`), and less often the longer that is ago.
  /// True: LSS does not tell one of those that sat there, and whether two hold a node-ID is to be asked by SDO
  /// (`Doubt::shared`).
  rt::Task<bool> look_for_formers();
  static constexpr rt::Duration longest_pause = std::chrono::minutes(10);
  /// Before a device is configured for the first time in a slot that another had: a configuration that is not of this
  /// slot says that it comes from somewhere. False: it waits for a person, or it is gone.
  rt::Task<bool> clear_past(Seat& seat);
  /// `clear_past` would do more than to say so.
  [[nodiscard]] bool has_past(const Seat& seat) const;
  /// A person named this device, or said that a used one may be used.
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

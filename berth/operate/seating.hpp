/// Carries out the plan: takes node-IDs away and assigns them, by LSS (paper 1 §III.c; S1.32 to S1.36).
#pragma once

#include <string>
#include <vector>

#include "berth/operate/equals.hpp"
#include "berth/operate/erased_node_ids.hpp"
#include "berth/operate/planning.hpp"
#include "berth/operate/presence.hpp"
#include "berth/operate/unfinished.hpp"
#include "berth/rt/scope.hpp"

namespace berth::operate {

/// Starts one device as soon as its node-ID is confirmed, while others get theirs. Devices that need LSS, a
/// configuration or a user wait for the round's end.
class EarlyStarter {
 public:
  virtual rt::Task<void> start_early(Seat& seat) = 0;

 protected:
  ~EarlyStarter() = default;
};

class Seating {
 public:
  Seating(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found, Loans& loans, Asking& asking,
          Lending& lending, PlaceProbes& places, Presence& presence, Planning& planning, ErasedNodeIds& erased) noexcept
      : s_(services),
        slots_(slots),
        agenda_(agenda),
        found_(found),
        loans_(loans),
        asking_(asking),
        lending_(lending),
        places_(places),
        presence_(presence),
        planning_(planning),
        erased_(erased),
        equals_(services, slots, found, planning),
        unfinished_(services, slots, found, loans, asking, equals_, erased) {}

  /// Call it before the first `carry_out`. `starter` must outlive this.
  void set_starter(EarlyStarter& starter) noexcept { starter_ = &starter; }

  /// Plans and acts until nothing more can be done. The turn must be held.
  rt::Task<void> carry_out();
  /// Reads by LSS the node-IDs of devices found by RAND, which does not report them: of `all`, or only of those that no
  /// binding asks. The turn must be held.
  rt::Task<void> inquire_found(bool all);
  /// Takes the device's node-ID away. The turn must be held.
  rt::Task<bool> blank(Identity device, std::string reason);
  /// How often devices were told to give their node-IDs up.
  [[nodiscard]] unsigned blanks() const noexcept { return blanks_; }
  /// A device that waited for its power cycle is heard again.
  rt::Task<void> go_on_after_power_cycle(Seat& seat);

 private:
  rt::Task<void> carry_out_actions(bool& inquired_all);
  rt::Task<void> verify_vacancy();
  rt::Task<bool> act(const places::Action& action);
  rt::Task<void> act_aside(const places::Action& action, std::vector<Identity>& failed, rt::Scope& starts);
  rt::Task<void> bind_side_by_side(const std::vector<places::Action>& actions, std::vector<Identity>& failed);
  [[nodiscard]] bool is_avoided(const Identity& device) const noexcept;
  rt::Task<bool> bind_seat(Seat& seat, Identity device, std::string reason);
  // `store_said`: `Binder::store_said`.
  void ended(Seat& seat, const places::Binding& binding, const std::optional<Error>& store_said);
  void bound(Seat& seat, const places::Binding& binding);
  void not_bound(Seat& seat, const places::Binding& binding, const std::optional<Error>& store_said);
  void learn_fixed(const places::Binding& binding);
  rt::Task<void> take_back(const places::Found& found);
  void free_absent_slots();
  void free_for_spares();

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  FoundDevices& found_;
  Loans& loans_;
  Asking& asking_;
  Lending& lending_;
  PlaceProbes& places_;
  Presence& presence_;
  Planning& planning_;
  ErasedNodeIds& erased_;
  Equals equals_;
  Unfinished unfinished_;
  EarlyStarter* starter_ = nullptr;
  std::vector<Identity> avoid_;  // devices whose action failed in this round
  unsigned blanks_ = 0;
};

}  // namespace berth::operate

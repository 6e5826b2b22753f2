/// When and how the bus is searched for devices that no slot knows (paper 1 §III.b; S1.31).
#pragma once

#include "berth/operate/configured_finder.hpp"
#include "berth/operate/search.hpp"

namespace berth::operate {

class Finder {
 public:
  Finder(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found, Asking& asking,
         PlaceProbes& places, ConfiguredFinder& configured, Search& search) noexcept
      : s_(services),
        slots_(slots),
        agenda_(agenda),
        found_(found),
        asking_(asking),
        places_(places),
        configured_(configured),
        search_(search) {}

  /// RAND comes first and alone: it finds all devices that speak it in one search. Other methods follow only when a
  /// slot still has no device, or when a device without a node-ID answered LSS. Two schemes never run at once (S1.24).
  /// The turn must be held.
  rt::Task<void> discover();
  /// One question a look: RAND's phase 0, which only new devices answer. Devices without RAND are found with one LSS
  /// frame that all devices without a node-ID answer alike: at every look while a slot waits, else at every eighth. The
  /// turn must be held.
  rt::Task<bool> anybody_new();
  /// Devices that wait for their places without a node-ID answer every question: for a while their answers start no
  /// search.
  void rest_from_searching();
  /// A device that is to lose the node-ID of a slot or of the master was not heard at the last looks.
  [[nodiscard]] bool waits_for_forgotten() const noexcept;

 private:
  /// A device that left the list because all are asked anew, and that a search may not find again.
  struct Forgotten {
    Identity device;
    bool holds;  // the node-ID of a slot or of the master
    unsigned looks = 0;
  };
  rt::Task<bool> search_for_all();
  rt::Task<void> forget_and_ask_anew();
  rt::Task<void> ask_for_the_forgotten();
  rt::Task<void> tell_which_are_known();
  rt::Task<bool> rand_first(bool anew);
  rt::Task<void> rest_behind_rand(bool anew, bool any_by_rand);
  rt::Task<void> by_rand();
  rt::Task<void> the_rest(bool also_configured);
  rt::Task<void> by_rest(bool also_configured);
  void searched();
  rt::Task<bool> anybody_blank();
  [[nodiscard]] bool is_one_missing() const;
  [[nodiscard]] bool holds_anothers(const places::Found& found) const;

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  FoundDevices& found_;
  Asking& asking_;
  PlaceProbes& places_;
  ConfiguredFinder& configured_;
  Search& search_;
  bool rest_wanted_ = false;      // a device without a node-ID answered LSS: search for devices without RAND
  rt::Time blank_at_{};           // such an answer starts no search before this time
  rt::Time scanned_at_{};         // nor does an answer to Fastscan's first question before this time
  bool by_fastscan_ = false;      // the last answer was to that
  bool owes_configured_ = false;  // the last search ended before devices with a node-ID were looked for
  bool open_anew_ = false;        // the interrupted RAND search asks all devices anew
  unsigned looks_ = 0;
  std::vector<Forgotten> forgotten_;
};

}  // namespace berth::operate

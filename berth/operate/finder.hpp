/// Which devices on the bus no slot knows (paper 1 §III.b; S1.31): when they are searched for, and how.
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

  /// RAND is asked first and alone: it finds all devices that speak it in one go. The rest is searched for only when a
  /// slot is still without a device, or when a device without a node-ID answered LSS. Never two schemes at once
  /// (S1.24). The turn must be held.
  rt::Task<void> discover();
  /// One question a look: RAND's phase 0, which only devices answer that are new. A device without RAND is heard by
  /// LSS, with one frame that all without a node-ID answer alike: at every look while a slot waits, else at every
  /// eighth. The turn must be held.
  rt::Task<bool> anybody_new();
  /// Devices that wait for their places without a node-ID answer every question: that is no news for a while.
  void rest_from_searching();

 private:
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

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  FoundDevices& found_;
  Asking& asking_;
  PlaceProbes& places_;
  ConfiguredFinder& configured_;
  Search& search_;
  bool rest_wanted_ = false;  // a device without a node-ID answered LSS: those are looked for that RAND does not find
  rt::Time blank_at_{};       // such an answer is no news before
  rt::Time scanned_at_{};     // nor one to Fastscan's first question before
  bool by_fastscan_ = false;  // it was to that
  bool owes_configured_ = false;  // the last search ended before devices with a node-ID were looked for
  bool open_anew_ = false;        // the search by RAND that was broken off asks all devices anew
  unsigned looks_ = 0;
  std::vector<Identity> forgotten_;  // without a node-ID, since all are asked anew: no search need find them again
};

}  // namespace berth::operate

/// Reads from a device which place it sits in (paper 4, S4.19). A device without a node-ID has no SDO: it gets a
/// temporary one that no slot has and that it does not store. It gives this back when no slot is found for it.
#pragma once

#include <vector>

#include "berth/operate/lending.hpp"

namespace berth::operate {

class PlaceProbes {
 public:
  PlaceProbes(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found, Asking& asking,
              Lending& lending) noexcept
      : s_(services), slots_(slots), agenda_(agenda), found_(found), asking_(asking), lending_(lending) {}

  /// Of devices that sit in no slot, as last read.
  [[nodiscard]] const std::vector<places::Reading>& readings() const noexcept { return readings_; }
  void forget(const Identity& device);
  /// Reads the probes of these devices. False: none could be read, or a device found just now did not answer. It may be
  /// resetting, and show the same place as a device that seems alone for a moment. The turn must be held.
  rt::Task<bool> read_places(std::vector<Identity> devices);
  /// Devices whose probes left their places open: the next look must reach all of them before one gets a place.
  void note_puzzling(const std::vector<places::Question>& questions);
  /// At every boot of a slot's device: does it still sit in this place? The probe takes precedence over the serial
  /// number in the slot's record: a moved device gives its slot up and is seated anew.
  rt::Task<bool> stays_in_place(Seat& seat);

 private:
  rt::Task<bool> read_probes(Identity device, NodeId id);
  rt::Task<bool> read_place(Identity device);

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  FoundDevices& found_;
  Asking& asking_;
  Lending& lending_;
  std::vector<places::Reading> readings_;
  std::vector<Identity> puzzling_;
  unsigned unread_rounds_ = 0;  // in a row in which a found device did not answer the question for its place
};

}  // namespace berth::operate

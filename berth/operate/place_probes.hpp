/// Which place a device sits in, read from the device itself (paper 4, S4.19). A device without a node-ID speaks no
/// SDO: it is lent one that no slot has, which it does not store, and gives it back when no slot is found for it.
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
  /// Reads the probes of these devices. False: none could be read, or one did not answer that was found just now: it
  /// may be resetting, and the place that two show is not the one's that is alone for a moment. The turn must be held.
  rt::Task<bool> read_places(std::vector<Identity> devices);
  /// Devices whose probes did not tell their places: the next look must hear all of them before one gets a place.
  void note_puzzling(const std::vector<places::Question>& questions);
  /// At every boot of a slot's device: does it still sit in this place? The probe wins over the serial number that the
  /// slot remembers: a device that a mechanic moved gives its slot up and is seated anew.
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
  unsigned unread_rounds_ = 0;  // in a row in which a device was found and did not answer when its place was asked
};

}  // namespace berth::operate

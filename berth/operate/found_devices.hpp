/// Devices found on one bus that sit in no slot yet, or came back to one.
#pragma once

#include <map>
#include <vector>

#include "berth/operate/bus_services.hpp"
#include "berth/operate/loans.hpp"
#include "berth/operate/slot_table.hpp"
#include "berth/places/plan.hpp"

namespace berth::operate {

class FoundDevices {
 public:
  using List = std::vector<places::Found>;

  FoundDevices(BusServices& services, const SlotTable& slots, Loans& loans) noexcept
      : s_(services), slots_(slots), loans_(loans) {}

  /// The identity of a device found with this node-ID. It is the slot's device if nothing it reports contradicts that
  /// (1018h may have less than LSS reports, and vice versa). A device without a serial number is known by the node-ID
  /// that it uses, unless that is lent to it.
  [[nodiscard]] Identity known_as(const places::Found& found) const noexcept;
  /// Adds the device (`known_as`), or replaces what is known of it. It was first seen at its boot-up message if it has
  /// a node-ID, else at its first answer.
  void note(const places::Found& found);
  void forget(const Identity& device);
  /// It was found, and does not answer any more. Kept until it is found again, or a search for all is over.
  void fell_silent(const Identity& device);
  /// A silent device that may sit in this slot. Null: none.
  [[nodiscard]] const Identity* silent_for(const places::SlotSpec& slot) const noexcept;
  template <class Goes>
  void forget_if(const Goes& goes) {
    std::erase_if(list_, goes);
  }
  void clear() noexcept { list_.clear(); }
  /// Forgets the first-seen times of devices that are no longer here.
  void forget_who_left();

  [[nodiscard]] const List& all() const noexcept { return list_; }
  [[nodiscard]] bool empty() const noexcept { return list_.empty(); }
  [[nodiscard]] std::size_t size() const noexcept { return list_.size(); }
  /// Null: it was not found.
  [[nodiscard]] places::Found* of(const Identity& device) noexcept;
  [[nodiscard]] const places::Found* of(const Identity& device) const noexcept;
  /// The device; or, if it has no serial number, one of its kind that was found in no slot, under its present identity.
  [[nodiscard]] Identity one_for(const Identity& device) const noexcept;
  /// A device was found that uses this node-ID.
  [[nodiscard]] bool any_at(NodeId id) const noexcept;
  /// This device was found with this node-ID, as the only one of its address.
  [[nodiscard]] bool uses(const Identity& device, NodeId id) const noexcept;
  /// Marks each device that uses the node-ID lent to it.
  void mark_loans();

  /// The device's known node-ID; unconfigured: none is known.
  [[nodiscard]] NodeId active_of(const Identity& device) const noexcept;
  /// Two devices had this address when it was last asked.
  [[nodiscard]] bool is_clone(const Identity& device) const noexcept;
  void no_clone(const Identity& device) { std::erase(clones_, device); }
  /// Another device answers under the same node-ID. Kept until this one is seated.
  void note_shared(const Identity& device);
  void not_shared(const Identity& device) { std::erase(shared_, device); }
  /// It was found by another method than RAND.
  void note_without_rand(const Identity& device);
  [[nodiscard]] bool without_rand(const Identity& device) const noexcept;
  /// Every address that was seen on this bus.
  [[nodiscard]] std::vector<LssAddress> addresses() const;

 private:
  BusServices& s_;
  const SlotTable& slots_;
  Loans& loans_;
  List list_;
  std::map<Identity, rt::Time> first_seen_;
  std::vector<Identity> clones_;
  std::vector<Identity> shared_;
  std::vector<Identity> silent_;
  std::vector<Identity> without_rand_;
};

}  // namespace berth::operate

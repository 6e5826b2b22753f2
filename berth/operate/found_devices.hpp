/// The devices that were found on one bus and sit in no slot yet, or came back to one.
#pragma once

#include <map>
#include <vector>

#include "berth/operate/bus_services.hpp"
#include "berth/operate/loans.hpp"
#include "berth/places/plan.hpp"

namespace berth::operate {

class FoundDevices {
 public:
  using List = std::vector<places::Found>;

  FoundDevices(BusServices& services, Loans& loans) noexcept : s_(services), loans_(loans) {}

  /// Adds the device, or replaces what is known of it. First seen: its boot-up message when it has a node-ID, else the
  /// first answer that it gave.
  void note(const places::Found& found);
  void forget(const LssAddress& device);
  /// It was found, and does not answer now. Until it is found again, or a search for all is over.
  void fell_silent(const LssAddress& device);
  /// One that fell silent and may sit in this slot. Null: none.
  [[nodiscard]] const LssAddress* silent_for(const places::SlotSpec& slot) const noexcept;
  template <class Goes>
  void forget_if(const Goes& goes) {
    std::erase_if(list_, goes);
  }
  void clear() noexcept { list_.clear(); }
  /// When they were first seen is forgotten of those that are not here any more.
  void forget_who_left();

  [[nodiscard]] const List& all() const noexcept { return list_; }
  [[nodiscard]] bool empty() const noexcept { return list_.empty(); }
  [[nodiscard]] std::size_t size() const noexcept { return list_.size(); }
  /// Null: it was not found.
  [[nodiscard]] places::Found* of(const LssAddress& device) noexcept;
  [[nodiscard]] const places::Found* of(const LssAddress& device) const noexcept;
  /// A device was found with this node-ID in use.
  [[nodiscard]] bool any_at(NodeId id) const noexcept;
  /// This device was, as the only one of its address.
  [[nodiscard]] bool uses(const LssAddress& device, NodeId id) const noexcept;
  /// Says of each whether it has what it was lent.
  void mark_loans();

  /// The node-ID that is known of it, unconfigured when none is.
  [[nodiscard]] NodeId active_of(const LssAddress& device) const noexcept;
  /// Two devices had this address when it was asked last.
  [[nodiscard]] bool is_clone(const LssAddress& device) const noexcept;
  void no_clone(const LssAddress& device) { std::erase(clones_, device); }
  /// Another device answers under the node-ID that this one has too. Until it is seated.
  void note_shared(const LssAddress& device);
  void not_shared(const LssAddress& device) { std::erase(shared_, device); }
  /// Found otherwise than by RAND.
  void note_without_rand(const LssAddress& device);
  [[nodiscard]] bool without_rand(const LssAddress& device) const noexcept;
  /// Every address that was seen on this bus.
  [[nodiscard]] std::vector<LssAddress> addresses() const;

 private:
  BusServices& s_;
  Loans& loans_;
  List list_;
  std::map<LssAddress, rt::Time> first_seen_;
  std::vector<LssAddress> clones_;
  std::vector<LssAddress> shared_;
  std::vector<LssAddress> silent_;
  std::vector<LssAddress> without_rand_;
};

}  // namespace berth::operate

/// Lends node-IDs to devices while they are searched for or read, and takes them back. A device without a node-ID has
/// no SDO, and devices of some makers answer everything in LSS configuration state. `Loans` keeps the list.
#pragma once

#include <array>

#include "berth/discovery/discovery.hpp"
#include "berth/operate/agenda.hpp"
#include "berth/operate/asking.hpp"

namespace berth::operate {

class Lending final : public discovery::Assigner {
 public:
  Lending(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found, Loans& loans,
          Asking& asking) noexcept
      : s_(services), slots_(slots), agenda_(agenda), found_(found), loans_(loans), asking_(asking) {}

  /// Finds enough vacant node-IDs for the devices that may come, by asking them side by side.
  rt::Task<void> prepare();
  /// For a search: the node-ID to lend to the only device in LSS configuration, or its slot's own. The device is
  /// seated, or blank again, before the round is over.
  NodeId assign(const LssAddress& address, bool says_none) noexcept override;
  [[nodiscard]] bool still_vacant(NodeId id) const noexcept override;
  /// A search learnt that a device has this node-ID, or will have it when it boots.
  void told(NodeId id) noexcept { told_[id.value()] = true; }
  void forget_told() noexcept { told_ = {}; }

  /// Lends the device a node-ID and waits for its boot-up under it. The turn must be held.
  rt::Task<Result<NodeId>> lend_to(Identity device);
  /// For a device that was lent the node-ID and does not answer under it: NMT reset communication of node-ID 255. True:
  /// it has booted. The turn must be held.
  rt::Task<bool> wake(Identity device, NodeId id);
  /// Takes back a slot's node-ID that was lent to another device than the plan gives it to.
  rt::Task<void> take_back_what_is_in_the_way(std::vector<places::Action> actions);
  /// Takes back all loans. A device that does not confirm keeps its loan and is asked again in the next rounds; later,
  /// only when the whole bus is asked anew.
  rt::Task<void> take_back_all();
  /// Makes the node-ID pending in this device alone, then puts it into LSS waiting. False: it did not confirm.
  rt::Task<bool> tell_pending(Identity device, NodeId id);
  /// Ends an unstored loan by NMT reset node: for a device that only Fastscan selects and that answers under the lent
  /// node-ID. True: it has no node-ID any more. LSS must be held.
  rt::Task<bool> recall(Identity device);
  /// The device now uses another node-ID than the lent one, active and pending.
  void end(const Identity& device);

 private:
  [[nodiscard]] bool may_be_lent(NodeId id) const noexcept;
  [[nodiscard]] bool spoken_for(NodeId id) const noexcept;
  [[nodiscard]] bool free_for_a_loan(const Seat& seat, const Identity& device) const noexcept;
  [[nodiscard]] NodeId id_to_lend(const Identity& device) const noexcept;
  [[nodiscard]] bool may_be_asked(const Loans::Loan& loan) const noexcept;
  bool lend(const Identity& device, NodeId id);
  rt::Task<bool> tell_both(Identity device);
  rt::Task<void> end_or_keep(Loans::Loan loan);
  rt::Task<void> make_pending(Loans::Loan loan, NodeId own);
  rt::Task<bool> take_back(Identity device, NodeId id);

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  FoundDevices& found_;
  Loans& loans_;
  Asking& asking_;
  std::array<bool, 128> told_{};
};

}  // namespace berth::operate

/// Finds by SDO those devices that have a node-ID and that no discovery hears (paper 4, S4.2). Stored node-IDs can be
/// corrected; node-IDs from switches, plugs and firmware are never written.
#pragma once

#include <array>
#include <vector>

#include "berth/operate/duplicates.hpp"
#include "berth/operate/planning.hpp"
#include "berth/operate/presence.hpp"

namespace berth::operate {

/// The number of probe periods between two searches of all node-IDs. It grows with the number of vain searches since a
/// device last booted.
class Rarer {
 public:
  [[nodiscard]] int periods(std::uint64_t boot_ups) noexcept {
    in_vain_ = boot_ups == boot_ups_ ? in_vain_ + 1 : 1;
    boot_ups_ = boot_ups;
    int periods = 8;
    for (unsigned i = 3; i < in_vain_ && periods < longest; ++i) periods *= 2;
    return periods;
  }

 private:
  static constexpr int longest = 128;
  std::uint64_t boot_ups_ = 0;
  unsigned in_vain_ = 0;
};

class ConfiguredFinder {
 public:
  ConfiguredFinder(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found, Loans& loans,
                   Asking& asking, Duplicates& duplicates, Presence& presence, const Planning& planning) noexcept
      : s_(services),
        slots_(slots),
        agenda_(agenda),
        found_(found),
        loans_(loans),
        asking_(asking),
        duplicates_(duplicates),
        presence_(presence),
        planning_(planning) {}

  /// Asks the slots' own node-IDs before any search, and before a slot is reported empty. A device may already be in
  /// its slot although it booted long ago, sends no heartbeat and has no LSS. All are asked side by side. Silence marks
  /// the node-ID vacant, which must be known before it is assigned.
  rt::Task<void> ask_slots_own();
  /// Asks node-IDs that were heard, factory default node-IDs, and from time to time those of the slots; with `all`,
  /// every node-ID. True: it found a device that the plan did not know.
  rt::Task<bool> find(bool all);
  /// A device under this node-ID waits for its place: the next look asks it again.
  void look_again_at(NodeId id) noexcept { look_again_at_[id.value()] = true; }

 private:
  [[nodiscard]] std::vector<NodeId> ids_to_ask(bool all);
  [[nodiscard]] bool everywhere_due();
  [[nodiscard]] std::uint64_t all_boot_ups() const noexcept;
  rt::Task<bool> ask_borrowers();
  rt::Task<void> ask_everywhere();
  rt::Task<void> knock(NodeId id);
  rt::Task<Result<Identity>> identity_of_one(NodeId id, std::uint64_t boot_ups);
  rt::Task<void> identity_at(NodeId id, std::vector<places::Found>& into);
  rt::Task<std::vector<places::Found>> identities(std::vector<NodeId> ids);
  rt::Task<bool> tell_duplicates_apart();
  void note(const places::Found& found);

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  FoundDevices& found_;
  Loans& loans_;
  Asking& asking_;
  Duplicates& duplicates_;
  Presence& presence_;
  const Planning& planning_;
  std::array<rt::Time, 128> asked_at_{};
  std::array<bool, 128> look_again_at_{};
  std::vector<NodeId> doubled_;  // answered as by two devices
  rt::Time sweep_at_{};          // the slots' own node-IDs are not asked again before this time
  rt::Time others_at_{};         // nor all others, for a slot whose device keeps its node-ID
  Rarer others_;
  Rarer everywhere_;
  rt::Time everywhere_at_{};          // nor all others, for a slot without a device
  std::uint8_t everywhere_from_ = 1;  // node-ID at which interrupted questions go on after a boot-up
  bool asked_everywhere_ = false;
};

}  // namespace berth::operate

/// One slot at run time: what the machine file and the store say of it, and what the bus has told.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "berth/co/emcy.hpp"
#include "berth/manager/configuration.hpp"
#include "berth/places/binding.hpp"
#include "berth/places/planner.hpp"
#include "berth/rt/executor.hpp"

namespace berth::operate {

struct Seat {
  places::Slot slot;
  places::SlotState state = places::SlotState::unknown;
  rt::Time since{};
  std::string reason;
  std::optional<co::Emcy> emergency{};  ///< its last error since its boot-up
  bool there = false;                   ///< its device was identified under the slot's node-ID
  bool started = false;                 ///< NMT start was sent
  bool awaited = false;                 ///< NMT start was sent just now, and its heartbeat has not told yet
  bool fresh = false;                   ///< bound in this run, and not yet looked at for a past elsewhere
  unsigned suspected = 0;  ///< rounds in a row in which devices that sat here before were asked for in vain
  unsigned shared = 0;     ///< tries left to tell two devices under its node-ID apart
  bool suspect = false;    ///< traffic says that a second device may hold its node-ID
  bool left = false;       ///< it told that it left operational, and whether it is the slot's device is not asked yet
  bool held = false;       ///< a person took it out of operational: it is not started again
  bool ask_again = false;  ///< silent, and due to be asked once more
  bool misplaced = false;  ///< its probe tells another place, which no slot has
  bool guarded = false;    ///< the device has no 1017h: it is asked by guarding
  rt::Time checked{};      ///< when it was identified last
  rt::Time heard_again{};  ///< when it was told last that it is
  rt::Time hurried{};      ///< when a boot-up under its node-ID last hastened the look at the bus
  std::optional<places::Binding> waiting;  ///< bound but for a power cycle
  unsigned looked_at = 0;                  ///< rounds in which it was
  std::uint64_t beats = 0;                 ///< heartbeats heard when their rate was looked at last
  rt::Time beats_at{};
  unsigned fast = 0;                                            ///< looks in a row at which there were too many
  std::shared_ptr<const manager::Configuration> configuration;  ///< of `config =`; null: none, or unreadable
  std::string unreadable;                                       ///< why the file of `config =` could not be read
  std::optional<rt::Time> waits_since;  ///< its configuration was saved then, and it waits for a power cycle
  unsigned failed_savings = 0;          ///< of its configuration in a row: memory wears out
  bool stuck = false;  ///< its configuration failed for good: not tried again before it boots or a person says so

  [[nodiscard]] const std::string& name() const noexcept { return slot.spec.name.name; }
  [[nodiscard]] NodeId id() const noexcept { return slot.spec.id; }
};

}  // namespace berth::operate

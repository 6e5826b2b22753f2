/// The life of a slot: what the master knows of the slot's device, and what each event changes.
///
/// A table without I/O. `SlotTable::happened` is the only caller that applies it, so a slot cannot be operational while
/// its device is not there. tests/operate/slot_life_test.cpp tries every event in every life.
///
/// Not in the table, because they outlive its states: the slot's row in the store (`Seat::slot`), how far the boot-up
/// has come (`Seat::slave`, which is forgotten when the device is not there any more), and a person's NMT command
/// (`Seat::held`).
#pragma once

#include <cstdint>
#include <optional>

#include "berth/places/slot.hpp"

namespace berth::operate {

enum class Life : std::uint8_t {
  // The slot's device is not there, as far as the master knows.
  unknown,    ///< not looked yet
  empty,      ///< no device is bound, and none suitable was found
  question,   ///< a person must say which device belongs here
  binding,    ///< a binding runs
  asked,      ///< a device booted or spoke under the node-ID: the master asks it what it is
  absent,     ///< the device is bound, and silent
  waits,      ///< a device must be switched off and on before the slot's device has the node-ID
  unbound,    ///< the binding, or storing it, failed
  misplaced,  ///< the device's probe tells another place, which is no slot's
  doubled,    ///< two devices answer under the node-ID, or to one LSS address
  stranger,   ///< a device of another type has the node-ID

  // The slot's device was identified under the slot's node-ID.
  present,      ///< pre-operational: its boot-up runs, or waits
  stopped,      ///< NMT stopped: its error control is heard, and it answers no SDO that would identify it
  left,         ///< the device left operational by its own report; whether it was this device is not known yet
  configuring,  ///< its configuration is compared and written, or its program is updated
  operational,  ///< it tells that it is operational
  used,         ///< it has a configuration from elsewhere; a user must decide whether it is to be used
  saved,        ///< its configuration is saved, and takes effect after a power cycle
  failed,       ///< its boot-up failed
  suspect,      ///< a second device seems to share its node-ID or its LSS address
  unfit,        ///< its boot-up found another device type (letter C)
};
constexpr unsigned lives = static_cast<unsigned>(Life::unfit) + 1;

enum class SlotEvent : std::uint8_t {
  // Of the bus and of the store.
  rests,  ///< the master's port rests, or another master is the active one
  freed,  ///< the store forgot which device sits in the slot

  // Of a search and of a binding.
  nobody,           ///< no suitable device was found
  asks_person,      ///< the plan, or what the device has stored, leaves a question
  answered,         ///< the plan has no more questions about the slot
  binds,            ///< a binding begins
  bound,            ///< the device has the slot's node-ID and is not in LSS configuration
  waits_for_power,  ///< a device must be switched off and on first
  binding_failed,

  // What is heard under the node-ID.
  boots,        ///< a boot-up message came while the device was operational
  heard_again,  ///< a device is about to be asked what it is
  gone,         ///< the device does not answer, its heartbeat stopped, or another device answers
  identified,   ///< the device answers under the slot's node-ID
  runs,         ///< the same, and it was already operational
  stopped,      ///< the device reports NMT stopped, and answers no SDO
  wrong_type,   ///< a device of another type answers
  misplaced,    ///< its probe reports another place
  two_answer,   ///< two devices answer under the node-ID
  doubted,      ///< a second device seems to share the node-ID or the LSS address
  operational,  ///< its heartbeat, or its answer to guarding, reports operational
  leaves,       ///< its heartbeat reports that it is no longer operational

  // Of its boot-up.
  configures,       ///< a step of its configuration, or of an update, has begun
  prepared,         ///< the configuration or the update is done
  saves_for_power,  ///< the saved configuration takes effect after a power cycle
  boot_failed,
  boots_while_prepared,  ///< a boot-up message came that the boot-up did not cause
  pauses,                ///< ready, stopped or held: the reason says what it waits for
  tried_again,           ///< a failed boot-up is repeated
};
constexpr unsigned slot_events = static_cast<unsigned>(SlotEvent::tried_again) + 1;

/// The life after the event. Nullopt: the event changes nothing, because it comes too late or is not new; the slot's
/// reason also stays.
[[nodiscard]] std::optional<Life> next(Life life, SlotEvent event) noexcept;

/// The slot's device was identified under the slot's node-ID, and nothing heard since casts doubt on it.
[[nodiscard]] constexpr bool is_there(Life life) noexcept { return life >= Life::present; }
/// Earlier knowledge of the device's boot-up is no longer valid.
[[nodiscard]] bool forgets_boot_up(Life before, SlotEvent event, Life now) noexcept;
/// The state shown to users.
[[nodiscard]] places::SlotState shown(Life life) noexcept;

}  // namespace berth::operate

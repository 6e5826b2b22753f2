/// The slot table: the papers' Node_Table (paper 1 §III, Table I; S1.28), kept permanently. A slot is a place of the
/// machine. The user says which type belongs there; Berth learns which device sits there and never forgets it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/places/probe.hpp"
#include "berth/places/recipe.hpp"
#include "berth/rt/executor.hpp"

namespace berth::places {

/// A slot's identity in the store, given by the store and never changed: not the node-ID, which the user may change.
struct SlotId {
  std::int64_t value = 0;
  friend constexpr auto operator<=>(SlotId, SlotId) noexcept = default;
};

/// A bus of a machine. An LSS address belongs to one device only within one network (CiA 305), and so does a node-ID.
/// So everything about a device is stored for one bus. The same identity on another bus is another device: its twin, or
/// the same device after a move.
struct BusName {
  std::string machine;
  std::string bus;
  friend auto operator<=>(const BusName&, const BusName&) = default;
  /// A row of this bus applies to `here`: it is the same bus, or the row names none. Older stores did not name it; such
  /// a row applies to any bus until it is written again or ended on one bus, and then belongs to that bus.
  [[nodiscard]] bool covers(const BusName& here) const noexcept { return bus.empty() || *this == here; }
};

/// A device as a store knows it.
struct BusDevice {
  Identity device;
  BusName on;
  friend auto operator<=>(const BusDevice&, const BusDevice&) = default;
};

/// The user's name of a slot. Machine, bus and name together find the same `SlotId` again.
struct SlotName {
  std::string machine;
  std::string bus;
  std::string name;
  friend auto operator<=>(const SlotName&, const SlotName&) = default;
  [[nodiscard]] BusName on() const { return {machine, bus}; }
};

/// Decides which device sits where, unless there is one new device of a type for one free slot.
enum class WhenAmbiguous : std::uint8_t {
  ask,            ///< the user decides
  ascending,      ///< paper 1's rule 2, if there are as many devices as slots; else the user decides
  one_at_a_time,  ///< devices join one by one, each gets the lowest free slot
  probe,          ///< an object of the device decides (`SlotSpec::probe`)
  first_seen,     ///< the first to become active gets the lowest free slot
  in_order,  ///< for a network list (1F81h), which asks no user: as `ascending`, and as far as possible if the numbers
             ///< of devices and slots differ
};

/// How much of the revision number must agree with the slot's.
enum class RevisionRule : std::uint8_t { any, major, exact };

/// May Berth itself clear the binding of a silent device, or only the user's `berth replace`?
enum class Replacement : std::uint8_t { ask, automatic };

/// How a device of this slot gets its node-ID.
enum class Assign : std::uint8_t { lss, fixed, recipe };

/// What a device needs before a saved configuration is in use.
enum class Activate : std::uint8_t {
  at_once,      ///< nothing
  reset,        ///< NMT reset node
  power_cycle,  ///< the user switches it off and on
};

/// When a device that boots is compared with its configuration (CiA 302-2 §Boot-up, step 7; paper 5 §2).
enum class Configure : std::uint8_t {
  by_date,    ///< if its date (1020h) differs from the configuration's
  each_boot,  ///< whatever its date
};

/// How the devices of a slot get its configuration.
struct SlotConfiguring {
  Activate activate = Activate::at_once;
  Configure when = Configure::by_date;
  friend bool operator==(const SlotConfiguring&, const SlotConfiguring&) = default;
};

/// Another type that may sit in a slot: the successor of a discontinued one.
struct AlsoType {
  TypeCode type;
  std::optional<std::uint32_t> revision;  ///< expected revision number; the slot's `rule` applies to it
  friend bool operator==(const AlsoType&, const AlsoType&) = default;
};

/// A program that the slot's device shall have.
struct SlotProgram {
  std::uint8_t number = 1;                      ///< sub-index of 1F50h, 1 to 254
  std::string file;                             ///< its image
  std::optional<std::uint32_t> identification;  ///< 1F56h; empty: the CRC-32 of the image's content
  friend bool operator==(const SlotProgram&, const SlotProgram&) = default;
};
/// The software of the slot's device.
struct SlotSoftware {
  std::vector<SlotProgram> programs;  ///< ascending by number, each once
  bool updates = true;                ///< replaces other programs of a device before it is started
  std::string version;                ///< 100Ah; empty: any
  std::string hardware;               ///< 1009h; empty: any
  std::uint32_t hardware_number = 0;  ///< 5F01h, paper 3's numeric hardware version; 0: any
};

/// How a slot's device is monitored, and how long its answers may take. Defaults are in the bus's `[timing]`.
struct SlotWatch {
  /// Key `error_control`.
  enum class By : std::uint8_t {
    automatic,  ///< heartbeat, at the nearest period that it takes; without one guarding, else SDO
    heartbeat,  ///< heartbeat, or nothing
    guarding,   ///< node guarding (CiA 301 §7.2.8.3.2.1)
    none,       ///< not monitored: 1017h, 100Ch and 100Dh stay unchanged
  };
  By by = By::automatic;
  rt::Duration heartbeat_period{0};   ///< 1017h, whole ms; 0: the bus's
  rt::Duration heartbeat_timeout{0};  ///< silence that makes the slot absent; 0: the bus's ratio to the period
  rt::Duration guard_time{0};         ///< 100Ch, whole ms; 0: the heartbeat period, 100Ch stays unchanged
  std::uint8_t life_time_factor = 0;  ///< 100Dh; 0: 3 unanswered requests, 100Dh stays unchanged
  rt::Duration sdo_timeout{0};        ///< 0: the bus's
  friend bool operator==(const SlotWatch&, const SlotWatch&) = default;
};

/// What is required of a slot's device in addition to its type, or less than it.
struct SlotAsks {
  std::uint8_t unasked = 0;  ///< parts of `type` that are unknown for its device: bit 0 vendor-ID, bit 1 product code
  std::optional<std::uint32_t> serial = {};  ///< the only device that may sit here (1F88h of a network list)
};

/// One slot as the machine file defines it. `id` and `type` are the paper's Node_ID and Type_Code, fixed in the
/// pre-assigning phase (S1.2).
struct SlotSpec {
  SlotName name;
  NodeId id;
  TypeCode type;
  SlotAsks asks;
  std::optional<std::uint32_t> revision;  ///< expected revision number, unless `rule` is `any`
  RevisionRule rule = RevisionRule::any;
  WhenAmbiguous when_ambiguous = WhenAmbiguous::ascending;
  Replacement replacement = Replacement::ask;
  Assign assign = Assign::lss;
  bool optional = false;
  bool mandatory = false;         ///< 1F81h bit 3: the network's startup halts without it
  std::uint32_t device_type = 0;  ///< 1F84h: expected 1000h; 0 is not checked
  std::string config;             ///< file with the device's configuration, empty for none
  SlotConfiguring configuring = {};
  SlotSoftware software = {};
  std::vector<AlsoType> also = {};            ///< accepted by `fits`; `type` is the slot's main type
  std::vector<std::uint32_t> spares = {};     ///< serial numbers of devices kept for this slot: such a device is chosen
                                              ///< first and without a question
  std::shared_ptr<const Recipe> recipe = {};  ///< with `Assign::recipe`
  std::optional<Probe> probe = {};            ///< identifies the slot's device at every boot, whatever its serial
                                              ///< number
  SlotWatch watch = {};
};
/// A device that `fits` this slot and is kept for it.
[[nodiscard]] bool listed_spare(const SlotSpec& slot, const Identity& device) noexcept;

/// The device that sits, or is to sit, in a slot, with its node-ID there. That node-ID identifies a device without a
/// serial number (`Identity::with`).
struct Assignment {
  Identity device;
  NodeId id;
  friend bool operator==(const Assignment&, const Assignment&) = default;
};

/// Progress of configuring a slot's device. Written before the first object is, so that the next run knows of an
/// interrupted one.
struct Configured {
  enum class Stage : std::uint8_t {
    writing,      ///< begun: the device may have any values, and may not have saved them
    power_cycle,  ///< saved, in use after the device is switched off and on
    done,         ///< the device has its configuration
  };
  Stage stage = Stage::writing;
  Identity device;
  std::uint32_t days = 0;  ///< the configuration date for 1020h
  std::uint32_t ms = 0;
  friend bool operator==(const Configured&, const Configured&) = default;
};
[[nodiscard]] const char* name(Configured::Stage stage) noexcept;

/// The intention to take a device's node-ID away, not confirmed yet: the device may still have it in its memory.
struct UnfinishedBlank {
  Identity device;
  std::string machine;  ///< where it was begun; empty in stores older than schema 5: any
  std::string bus;
  NodeId id;  ///< the device's at that time; unconfigured: unknown
  [[nodiscard]] BusDevice who() const { return {device, {machine, bus}}; }
  friend bool operator==(const UnfinishedBlank&, const UnfinishedBlank&) = default;
};

/// A node-ID that was lent to a device for a search (`11h`, not stored) and not seen to be given back: the device may
/// use it, or have it pending, until it loses power.
struct LentId {
  Identity device;
  std::string machine;  ///< where it was lent; empty in stores older than schema 6: any
  std::string bus;
  NodeId id;
  [[nodiscard]] BusDevice who() const { return {device, {machine, bus}}; }
  friend bool operator==(const LentId&, const LentId&) = default;
};

/// What the store knows of a slot. `asked` is the intention, written before the first frame; `confirmed` is what the
/// device was then heard to be. They are two facts: a crash leaves the first without the second, and the next start
/// repeats the work (S1.53).
struct SlotRecord {
  SlotId slot;
  SlotName name;
  std::optional<Assignment> intended;
  std::optional<Assignment> confirmed;
  std::optional<Configured> configured = {};

  /// The slot's device: the intended one, else the confirmed one.
  [[nodiscard]] std::optional<Identity> device() const noexcept {
    if (intended) return intended->device;
    if (confirmed) return confirmed->device;
    return std::nullopt;
  }
};

/// What is stored of a device in addition to its seat, for its bus. Each mark would harm a twin on another bus, which
/// would lose its settings, stay without its node-ID, or wait for the user.
enum class Mark : std::uint8_t {
  restore,     ///< restore factory settings before configuring it (a used spare); until that is done
  fixed,       ///< its node-ID is set by switches, plug or firmware: LSS cannot change it
  looks_used,  ///< it sits in a slot with a configuration from somewhere else, and the user was asked about it
};
/// The history's words when a mark is set and removed: "restore asked", "restored"; "fixed node-ID", "node-ID not
/// fixed"; "looks used", "may be used".
[[nodiscard]] const char* name(Mark mark) noexcept;
[[nodiscard]] const char* name_of_end(Mark mark) noexcept;

/// A device with a mark.
struct Marked {
  Identity device;
  NodeId id;        ///< its node-ID at that time
  BusName on = {};  ///< no bus: older than schema 7, any
  friend bool operator==(const Marked&, const Marked&) = default;
};

/// One line of the history, which is never rewritten.
struct HistoryEntry {
  std::int64_t sequence = 0;   ///< ascending over the whole store
  std::int64_t stamp_ms = 0;   ///< given by the caller: Unix time, or on a simulated bus its time
  std::optional<SlotId> slot;  ///< none for an event of a device alone
  std::string event;           ///< "declared", "asked", "confirmed", "cleared", "blank asked", "blanked",
                      ///< "blank dropped", "configuring", "power cycle needed", "configured", a `Mark`'s words, or a
                      ///< note
  std::optional<Identity> device;
  NodeId id;
  std::string reason;
  BusName on = {};  ///< the slot's, else the device's; empty: unknown, as before schema 7
};

/// The reason of `SlotStore::clear` when the user gives a slot away.
inline constexpr std::string_view by_a_person = "replaced by a person";
/// The reason when the whole bus is bound anew: earlier seats no longer count.
inline constexpr std::string_view from_scratch = "bound from scratch";

/// Where a device sat, and until when.
struct FormerSeat {
  SlotId slot;
  NodeId id;
  std::int64_t until_ms = 0;  ///< `HistoryEntry::stamp_ms` of the line that ended it
  bool by_person = false;     ///< the user gave the slot away; else Berth freed it, because the device was silent
  friend bool operator==(const FormerSeat&, const FormerSeat&) = default;
};
/// The last seat that a device had and lost, by the lines of the history about it on its bus, oldest first
/// (`SlotStore::history_of`). None: it never sat there, still sits there, or was restored to its factory settings
/// since.
[[nodiscard]] std::optional<FormerSeat> former_seat(const std::vector<HistoryEntry>& lines);

/// The present state of a slot. The names are used in `--json` and in the documents.
enum class SlotState : std::uint8_t {
  unknown,      ///< not looked at yet
  empty,        ///< no device is bound, and no suitable one was found
  binding,      ///< a binding is running
  question,     ///< the user must say which device belongs here
  absent,       ///< bound, but silent
  present,      ///< bound, identified, pre-operational
  configuring,  ///< its configuration is compared, and differences are written
  power_cycle,  ///< waits for the device to be switched off and on
  operational,  ///< started, and heard to be operational
  failed,       ///< see the reason
  duplicate,    ///< two devices have this node-ID or one LSS address: not started
  wrong_type,   ///< the device at this node-ID is not of the slot's type
};
[[nodiscard]] const char* name(SlotState state) noexcept;

}  // namespace berth::places

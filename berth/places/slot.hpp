/// The slot table: the papers' Node_Table (paper 1 §III, Table I; S1.28) made to last. A slot is a place of the
/// machine; which type belongs there is written by a person, which device sits there is learnt and never forgotten.
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

/// A slot's identity in the store, given by the store and kept for ever: not the node-ID, which a person may change.
struct SlotId {
  std::int64_t value = 0;
  friend constexpr auto operator<=>(SlotId, SlotId) noexcept = default;
};

/// A bus of a machine. An LSS address is one device's within one network only (CiA 305), and so is a node-ID. So
/// whatever is remembered of a device is remembered of one bus, and the same identity on another bus is another device:
/// its twin, or the device itself, which was moved there.
struct BusName {
  std::string machine;
  std::string bus;
  friend auto operator<=>(const BusName&, const BusName&) = default;
  /// What was written of this bus is true of `here`: the same one, or none was written. Older stores did not say which;
  /// such a row is of any bus until it is written anew or ended on one, and then is that bus's.
  [[nodiscard]] bool covers(const BusName& here) const noexcept { return bus.empty() || *this == here; }
};

/// A device as a store knows it.
struct BusDevice {
  Identity device;
  BusName on;
  friend auto operator<=>(const BusDevice&, const BusDevice&) = default;
};

/// What a person calls a slot. Machine, bus and name together find the same `SlotId` again.
struct SlotName {
  std::string machine;
  std::string bus;
  std::string name;
  friend auto operator<=>(const SlotName&, const SlotName&) = default;
  [[nodiscard]] BusName on() const { return {machine, bus}; }
};

/// Which device sits where when it is not one new device of a type for one free slot.
enum class WhenAmbiguous : std::uint8_t {
  ask,            ///< a person says it
  ascending,      ///< paper 1's rule 2, when devices and slots are equal in number; else a person says it
  one_at_a_time,  ///< devices come one by one, each into the lowest free slot
  probe,          ///< an object of the device says it (`SlotSpec::probe`)
  first_seen,     ///< the one that becomes active first gets the lowest free slot
  in_order,  ///< a network list (1F81h), which asks nobody: as `ascending`, and as far as it goes where devices and
             ///< slots are not equal in number
};

/// How much of the revision number must agree with the slot's.
enum class RevisionRule : std::uint8_t { any, major, exact };

/// May Berth clear the binding of a silent device by itself, or only a person's `berth replace`?
enum class Replacement : std::uint8_t { ask, automatic };

/// How a device of this slot gets its node-ID.
enum class Assign : std::uint8_t { lss, fixed, recipe };

/// What a device needs before a saved configuration is in use.
enum class Activate : std::uint8_t {
  at_once,      ///< nothing
  reset,        ///< NMT reset node
  power_cycle,  ///< to be switched off and on by a person
};

/// When a device that boots is compared with its configuration (CiA 302-2 §Boot-up, step 7; paper 5 §2).
enum class Configure : std::uint8_t {
  by_date,    ///< when its date (1020h) is another one than the configuration's
  each_boot,  ///< whatever its date is
};

/// How the devices of a slot get its configuration.
struct SlotConfiguring {
  Activate activate = Activate::at_once;
  Configure when = Configure::by_date;
  friend bool operator==(const SlotConfiguring&, const SlotConfiguring&) = default;
};

/// A further type that may sit in a slot too: the successor of one that is made no more.
struct AlsoType {
  TypeCode type;
  std::optional<std::uint32_t> revision;  ///< expected revision number; the slot's `rule` holds for it
  friend bool operator==(const AlsoType&, const AlsoType&) = default;
};

/// One slot as the machine file wants it. `id` and `type` are the paper's Node_ID and Type_Code, fixed in the
/// pre-assigning phase (S1.2).
/// A program that the slot's device shall have.
struct SlotProgram {
  std::uint8_t number = 1;                      ///< sub-index of 1F50h, 1 to 254
  std::string file;                             ///< its image
  std::optional<std::uint32_t> identification;  ///< 1F56h; empty: the CRC-32 of the image's content
  friend bool operator==(const SlotProgram&, const SlotProgram&) = default;
};
/// What runs in the slot's device.
struct SlotSoftware {
  std::vector<SlotProgram> programs;  ///< ascending by number, each once
  bool updates = true;                ///< a device that is to be started and has others gets these
  std::string version;                ///< 100Ah; empty: any
  std::string hardware;               ///< 1009h; empty: any
  std::uint32_t hardware_number = 0;  ///< 5F01h, paper 3's numeric hardware version; 0: any
};

/// How the device of a slot is watched, and how long its answers may take. What is not given is the bus's `[timing]`.
struct SlotWatch {
  /// Key `error_control`.
  enum class By : std::uint8_t {
    automatic,  ///< by its heartbeat, at the nearest period that it takes; without one by guarding, else by SDO
    heartbeat,  ///< by its heartbeat, or not at all
    guarding,   ///< by node guarding (CiA 301 §7.2.8.3.2.1)
    none,       ///< not watched: 1017h, 100Ch and 100Dh stay as they are
  };
  By by = By::automatic;
  rt::Duration heartbeat_period{0};   ///< 1017h, whole ms; 0: the bus's
  rt::Duration heartbeat_timeout{0};  ///< silence that makes the slot absent; 0: in the bus's proportion to the period
  rt::Duration guard_time{0};         ///< 100Ch, whole ms; 0: the heartbeat period, and 100Ch stays as it is
  std::uint8_t life_time_factor = 0;  ///< 100Dh; 0: 3 unanswered questions, and 100Dh stays as it is
  rt::Duration sdo_timeout{0};        ///< 0: the bus's
  friend bool operator==(const SlotWatch&, const SlotWatch&) = default;
};

/// What is asked of a slot's device more, or less, than its type.
struct SlotAsks {
  std::uint8_t unasked = 0;  ///< parts of `type` that are not known of its device: bit 0 vendor-ID, bit 1 product code
  std::optional<std::uint32_t> serial = {};  ///< the only device that may sit here (1F88h of a network list)
};

struct SlotSpec {
  SlotName name;
  NodeId id;
  TypeCode type;
  SlotAsks asks;
  std::optional<std::uint32_t> revision;  ///< expected revision number, when `rule` is not `any`
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
  std::vector<AlsoType> also = {};         ///< `fits` knows them; `type` is what the slot is for
  std::vector<std::uint32_t> spares = {};  ///< serial numbers of devices that are kept for this slot: such a device is
                                           ///< chosen first and without a question
  std::shared_ptr<const Recipe> recipe = {};  ///< with `Assign::recipe`
  std::optional<Probe> probe = {};            ///< tells the slot's device at every boot, whatever its serial number
  SlotWatch watch = {};
};
/// A device that `fits` this slot and is kept for it.
[[nodiscard]] bool listed_spare(const SlotSpec& slot, const Identity& device) noexcept;

/// The device that sits, or shall sit, in a slot, with the node-ID that it has there. A device without a serial number
/// is known by that (`Identity::with`).
struct Assignment {
  Identity device;
  NodeId id;
  friend bool operator==(const Assignment&, const Assignment&) = default;
};

/// How far the configuration of a slot's device has come. Written before the first object of the device is, so that a
/// run that was interrupted is known to the next.
struct Configured {
  enum class Stage : std::uint8_t {
    writing,      ///< begun: the device may have anything, and may not have saved it
    power_cycle,  ///< saved, and not in use before the device is switched off and on
    done,         ///< it has it
  };
  Stage stage = Stage::writing;
  Identity device;
  std::uint32_t days = 0;  ///< the configuration date that 1020h shall have
  std::uint32_t ms = 0;
  friend bool operator==(const Configured&, const Configured&) = default;
};
[[nodiscard]] const char* name(Configured::Stage stage) noexcept;

/// The intention to take a device's node-ID away, not confirmed yet: the device may have it in its memory still.
struct UnfinishedBlank {
  Identity device;
  std::string machine;  ///< where it was begun; empty in stores of before schema 5, which means any
  std::string bus;
  NodeId id;  ///< that the device had then; unconfigured: not known
  [[nodiscard]] BusDevice who() const { return {device, {machine, bus}}; }
  friend bool operator==(const UnfinishedBlank&, const UnfinishedBlank&) = default;
};

/// A node-ID that a device was lent for a search (`11h`, not stored), and was not seen to give back: it may use it, or
/// have it pending, as long as it has power.
struct LentId {
  Identity device;
  std::string machine;  ///< where it was lent; empty in stores of before schema 6, which means any
  std::string bus;
  NodeId id;
  [[nodiscard]] BusDevice who() const { return {device, {machine, bus}}; }
  friend bool operator==(const LentId&, const LentId&) = default;
};

/// What the store knows of a slot. `asked` is the intention, written before the bus is touched; `confirmed`
/// is what the device was then heard to be. They are two facts: a crash leaves the first without the second, and the
/// next start does the work again (S1.53).
struct SlotRecord {
  SlotId slot;
  SlotName name;
  std::optional<Assignment> intended;
  std::optional<Assignment> confirmed;
  std::optional<Configured> configured = {};

  /// The device that this slot is about: the one intended, else the one confirmed.
  [[nodiscard]] std::optional<Identity> device() const noexcept {
    if (intended) return intended->device;
    if (confirmed) return confirmed->device;
    return std::nullopt;
  }
};

/// What is remembered of a device beside its seat, on its bus: each of the three would harm a twin on another bus,
/// which would lose its settings, be left without its node-ID, or wait for a person.
enum class Mark : std::uint8_t {
  restore,     ///< it shall have its factory settings before it is configured (a used spare); until that was done
  fixed,       ///< its node-ID comes from switches, plug or firmware: LSS cannot change it
  looks_used,  ///< it sits in a slot with a configuration of somewhere else, and a person was asked about it
};
/// What the history says when a mark is set, and when it is taken away: "restore asked", "restored"; "fixed node-ID",
/// "node-ID not fixed"; "looks used", "may be used".
[[nodiscard]] const char* name(Mark mark) noexcept;
[[nodiscard]] const char* name_of_end(Mark mark) noexcept;

/// A device with a mark.
struct Marked {
  Identity device;
  NodeId id;        ///< that it had then
  BusName on = {};  ///< no bus: of before schema 7, which means any
  friend bool operator==(const Marked&, const Marked&) = default;
};

/// One line of the history that is never rewritten.
struct HistoryEntry {
  std::int64_t sequence = 0;   ///< ascending over the whole store
  std::int64_t stamp_ms = 0;   ///< given by the caller: Unix time, or bus time on a simulated bus
  std::optional<SlotId> slot;  ///< none for what concerns a device alone
  std::string event;           ///< "declared", "asked", "confirmed", "cleared", "blank asked", "blanked",
                      ///< "blank dropped", "configuring", "power cycle needed", "configured", what a `Mark` says,
                      ///< or a note
  std::optional<Identity> device;
  NodeId id;
  std::string reason;
  BusName on = {};  ///< the slot's, else the device's; empty: not known, as before schema 7
};

/// The reason of `SlotStore::clear` when a person gives a slot away.
inline constexpr std::string_view by_a_person = "replaced by a person";
/// The reason when the whole bus is bound anew: where a device sat before counts no more.
inline constexpr std::string_view from_scratch = "bound from scratch";

/// Where a device sat, and until when.
struct FormerSeat {
  SlotId slot;
  NodeId id;
  std::int64_t until_ms = 0;  ///< `HistoryEntry::stamp_ms` of the line that ended it
  bool by_person = false;     ///< a person gave the slot away; else Berth freed it, because the device was silent
  friend bool operator==(const FormerSeat&, const FormerSeat&) = default;
};
/// The last seat that a device had and has no more, by the lines of the history about it on its bus, oldest first
/// (`SlotStore::history_of`). None when it never sat there, sits there still, or was restored to its factory settings
/// since.
[[nodiscard]] std::optional<FormerSeat> former_seat(const std::vector<HistoryEntry>& lines);

/// What is going on with a slot now. The names stand in `--json` and in the documents.
enum class SlotState : std::uint8_t {
  unknown,      ///< not looked yet
  empty,        ///< no device is bound and none suitable was found
  binding,      ///< a binding runs
  question,     ///< a person must say which device belongs here
  absent,       ///< bound, and silent
  present,      ///< bound, identified, pre-operational
  configuring,  ///< its configuration is compared, and written where it differs
  power_cycle,  ///< waits for the device to be switched off and on
  operational,  ///< started, and heard to be operational
  failed,       ///< see the reason
  duplicate,    ///< two devices hold this node-ID or one LSS address: not started
  wrong_type,   ///< the device at this node-ID is not of the slot's type
};
[[nodiscard]] const char* name(SlotState state) noexcept;

}  // namespace berth::places

/// The plant file: a simulated world for trying a machine (`docs/plant-file.md` has the grammar). It lists the devices,
/// their places and properties, and faults with their times. Plain data; `berth/plant/` builds the world from it.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/base/ids.hpp"
#include "berth/lss/frames.hpp"
#include "berth/od/data_type.hpp"
#include "berth/process/network_variables.hpp"
#include "berth/text/quantity.hpp"

namespace berth::plant {

using Duration = text::Duration;

/// The name of Berth's own node in events; no device may have it.
inline constexpr std::string_view master_name = "master";

struct PlantBus {
  std::string name;              ///< the machine file's bus of this name
  std::uint32_t bitrate = 0;     ///< bit/s; 0 = as the machine file says
  std::uint32_t fd_bitrate = 0;  ///< bit/s of the data phase: an FD bus, every controller on it takes FD; 0 = classic
  friend bool operator==(const PlantBus&, const PlantBus&) = default;
};

/// Where a device's node-ID comes from at power-on.
enum class NodeIdSource : std::uint8_t {
  blank,        ///< none; LSS can give one, and storing keeps it
  nonvolatile,  ///< LSS can change it, `node_id` was stored before
  hard_coded,   ///< fixed in the firmware: refuses LSS configure node-ID
  switches,     ///< set by hand on the device: as hard-coded
  connector,    ///< coded in the plug, so given by the place: as hard-coded
};
[[nodiscard]] const char* name(NodeIdSource source) noexcept;

/// The protocols for finding devices and giving node-IDs in which a device takes part. The words of `speaks` in the
/// plant file.
enum class Speaks : std::uint8_t {
  lss,                  ///< CiA 305 without Fastscan
  fastscan,             ///< LSS Fastscan (51h); implies `lss`
  feedback_29,          ///< Fastscan with feedback in 29-bit identifiers; implies `fastscan` and `lss`
  feedback_11,          ///< Fastscan with feedback in sixteen 11-bit identifiers; as above
  rand,                 ///< paper 1's RAND
  rand_literal,         ///< RAND in LSS configuration state only, as in the paper; implies `rand`
  rand_resume,          ///< RAND with Berth's extension (docs/rand.md); implies `rand`
  and_protocol,         ///< AND, RAND's predecessor
  claim,                ///< claims a node-ID in the data field, as SAE J1939-81 does
  negotiation,          ///< paper 2's negotiation without a master
  negotiation_literal,  ///< with the paper's conflict rule; implies `negotiation`
};
/// A set of `Speaks`.
class SpeaksSet {
 public:
  constexpr SpeaksSet() = default;
  constexpr SpeaksSet(std::initializer_list<Speaks> all) {
    for (const auto each : all) add(each);
  }
  [[nodiscard]] constexpr bool has(Speaks what) const noexcept {
    return ((bits_ >> static_cast<unsigned>(what)) & 1U) != 0;
  }
  /// Adds it and what it implies.
  constexpr void add(Speaks what) noexcept {
    using enum Speaks;
    bits_ = static_cast<std::uint16_t>(bits_ | 1U << static_cast<unsigned>(what));
    if (what == feedback_29 || what == feedback_11) add(fastscan);
    if (what == fastscan) add(lss);
    if (what == rand_literal || what == rand_resume) add(rand);
    if (what == negotiation_literal) add(negotiation);
  }
  constexpr void remove(Speaks what) noexcept {
    bits_ = static_cast<std::uint16_t>(bits_ & ~(1U << static_cast<unsigned>(what)));
  }
  friend constexpr bool operator==(SpeaksSet, SpeaksSet) = default;

 private:
  std::uint16_t bits_ = 0;
};

/// Behaviour in which a device follows the CANopen stack of this name (docs/plant-file.md lists it) rather than CiA's
/// documents. The words of `habits` in the plant file.
enum class Habit : std::uint8_t { canopennode, lely };
[[nodiscard]] const char* name(Habit habit) noexcept;

/// How a device's LSS deviates from CiA 305. Keys `habits`, `lss_without`, `lss_store`, `short_answers`.
struct PlantLss {
  std::optional<Habit> habit;  ///< with `Speaks::fastscan`: both stacks always have it
  lss::LackSet without;        ///< with `Speaks::lss`
  bool refuses_store = false;  ///< 17h is answered with error code 1
  bool short_answers = false;  ///< leaves out the zeros at the end of an answer
  friend bool operator==(const PlantLss&, const PlantLss&) = default;
};

/// The order in which a device's controller sends queued frames.
enum class QueueKind : std::uint8_t { in_order, priority };

/// Time from a request to the device's answer: uniform between `min` and `max`; `outlier` instead, `outlier_ppm` times
/// in a million.
struct Latency {
  Duration min = std::chrono::microseconds(500);
  Duration max = std::chrono::microseconds(500);
  std::uint32_t outlier_ppm = 0;
  Duration outlier{0};
  friend bool operator==(const Latency&, const Latency&) = default;
};

/// An object that must get this value before the one before it takes effect.
struct PlantSignature {
  ObjectRef object;
  std::uint64_t value = 0;  ///< little-endian on the wire
  std::uint8_t size = 4;    ///< bytes, 1 to 8
  friend bool operator==(const PlantSignature&, const PlantSignature&) = default;
};

/// A device that is programmed over the bus (docs/programs.md), and its flash memory. Key `programs`.
struct PlantPrograms {
  std::uint32_t count = 0;                         ///< programs, 1 to 254; 0: it is not programmed
  std::uint32_t size = 65'536;                     ///< bytes of the longest program
  std::uint32_t images = 2;                        ///< of each program, 1 or 2
  std::uint32_t sector = 4'096;                    ///< bytes that are erased together
  Duration erase = std::chrono::milliseconds(20);  ///< for a sector
  Duration write = std::chrono::microseconds(5);   ///< for a byte
  bool checked = true;                             ///< takes only images with a head
  std::string loaded;                              ///< image of the program 1 that it has, as written; empty: none
  std::string loaded_path;                         ///< the same, relative to the plant file's folder; not compared
  friend bool operator==(const PlantPrograms& a, const PlantPrograms& b) noexcept {
    return a.count == b.count && a.size == b.size && a.images == b.images && a.sector == b.sector &&
           a.erase == b.erase && a.write == b.write && a.checked == b.checked && a.loaded == b.loaded;
  }
};

/// How a device stores (LSS store, SDO store). Keys `store`, `deaf_while_storing`, `power_cycle_after_store`,
/// `needs_first_save`.
struct PlantStorage {
  Duration time = std::chrono::milliseconds(20);  ///< request to answer
  bool deaf = false;                              ///< hears nothing while it stores
  bool power_cycle_after = false;                 ///< a stored node-ID takes effect only after power-off
  bool needs_first_save = false;                  ///< EMCY 5000h and not operational until 1010h was saved once
  PlantPrograms programs;
  friend bool operator==(const PlantStorage&, const PlantStorage&) = default;
};

/// A device's CAN controller and its clock.
struct PlantController {
  QueueKind queue = QueueKind::in_order;
  std::uint32_t rx_depth = 16;   ///< frames its receive buffer holds; 1 = a single slot
  Duration bus_off_recovery{0};  ///< restarts its controller this long after bus-off; 0 = never
  std::uint32_t repeat_ppm = 0;  ///< so many in a million of its frames are sent twice
  bool extended_frames = true;   ///< false: CAN 2.0A; answers each extended frame with an error frame
  std::int32_t drift_ppm = 0;    ///< its clock is fast (+) or slow (-)
  friend bool operator==(const PlantController&, const PlantController&) = default;
};

/// The node-ID as an object of the device. Keys `node_id_object`, `node_id_signature`.
struct PlantNodeIdObject {
  std::optional<ObjectRef> object;          ///< the node-ID is this object, 1 byte
  std::optional<PlantSignature> signature;  ///< with `object`: writing it stores the node-ID
  friend bool operator==(const PlantNodeIdObject&, const PlantNodeIdObject&) = default;
};

/// A device with several ports, paper 3's gateway, formed by several devices of the plant. Tables `[[gateway]]`.
struct PlantGateway {
  std::string above;                        ///< its device on the bus above
  std::vector<std::string> beneath;         ///< those on the buses beneath, port 1 first
  std::uint8_t layout = 8;                  ///< of EMCYs: the paper's Figure 7, 8 or 9
  std::vector<std::uint8_t> speaks_layout;  ///< node-IDs beneath whose EMCYs have it; gateways there are found
                                            ///< automatically
  bool literal = false;                     ///< SDO answers as published
  std::uint32_t signals =
      0;  ///< rows of its routing objects, and places of each size on every side; 0: no such objects
  friend bool operator==(const PlantGateway&, const PlantGateway&) = default;
};

/// The device is an NMT master of its bus by its own dictionary: a flying one (docs/flying-master.md), or the only one,
/// which also gives its slaves their node-IDs. Key `master`.
struct PlantMaster {
  bool flying = true;
  std::uint8_t most = 32;        ///< highest node-ID of a slave; of a flying master the last of `slaves`
  std::uint8_t priority = 1;     ///< 1F90h:03
  std::vector<unsigned> slaves;  ///< node-IDs of its network list (1F81h), ascending; of the only one: blank
  bool keep_alive = true;        ///< 1F81h bit 4 of each
  friend bool operator==(const PlantMaster&, const PlantMaster&) = default;
};

/// What it does after its heartbeat time (1017h) was written. The words of `resets_at_heartbeat`, after `never`.
enum class ResetsAtHeartbeat : std::uint8_t {
  never,
  keeps,    ///< answers, resets, and has the new value
  forgets,  ///< answers, resets, and has its old value
  silent,   ///< resets without an answer, and has its old value
};

/// Wrong information that it gives about itself. Keys `identity_changes`, `sdo_serial`,
/// `identity_only_pre_operational`, `resets_at_heartbeat`, `heartbeat_sent`.
struct PlantOddities {
  std::uint8_t changing = 0;                   ///< parts of 1018h, bit 0 the vendor-ID: each reading gives one more
  std::optional<std::uint32_t> sdo_serial;     ///< 1018h:04, if it differs from LSS
  bool identity_only_pre_operational = false;  ///< 1018h is refused in any other NMT state
  ResetsAtHeartbeat resets = ResetsAtHeartbeat::never;
  Duration heartbeat_sent{0};  ///< period of its heartbeat, whatever 1017h says; 0: as 1017h says
  friend bool operator==(const PlantOddities&, const PlantOddities&) = default;
};

/// A network variable that the program of a device has. Key `variables`.
using PlantVariable = process::NetworkVariable;

/// A device's program: a Lua file (docs/scripts.md). Key `script`.
struct PlantScript {
  std::string file;  ///< as written; empty: none
  std::string path;  ///< the same, relative to the plant file's folder; not compared
};

/// What its program does and reports by itself. Keys `script`, `variables`, `master`, `hardware`.
struct PlantBehaviour {
  PlantScript script;
  std::vector<PlantVariable> variables;
  std::optional<PlantMaster> master;  ///< without a description and a script only
  std::uint32_t hardware = 0;         ///< 5F01h, without a description only; 0: no such object
  PlantOddities odd;
};

struct PlantDevice {
  std::string name;  ///< unique in the plant
  std::string bus;
  std::string eds;       ///< description, as written; empty: a minimal built-in one
  std::string eds_path;  ///< the same, relative to the plant file's folder; not compared
  PlantBehaviour does;
  LssAddress address;           ///< identity object 1018h
  bool address_of_eds = false;  ///< vendor, product and revision come from the description; not set here
  NodeIdSource source = NodeIdSource::blank;
  NodeId node_id;  ///< what the source gives; unconfigured for `blank`
  PlantNodeIdObject node_id_object;
  std::uint32_t bitrate = 0;  ///< stored bit rate, bit/s; 0 = the bus's
  SpeaksSet speaks{Speaks::lss, Speaks::rand};
  PlantLss lss;
  Latency response;
  Duration boot = std::chrono::milliseconds(50);   ///< power-on to boot-up message
  Duration reset = std::chrono::milliseconds(20);  ///< NMT reset (node or communication) to boot-up message
  PlantStorage storing;
  PlantController controller;
  Duration heartbeat{0};  ///< 1017h at power-on; 0 = none until it is written
  bool plugged = true;    ///< at time 0

  friend bool operator==(const PlantDevice& a, const PlantDevice& b) noexcept;
};

/// What an event waits for.
enum class After : std::uint8_t {
  start,        ///< time 0 of the world
  discovered,   ///< a discovery has found a device
  bound,        ///< every slot that can be bound is bound
  operational,  ///< every mandatory slot is operational for the first time
};
[[nodiscard]] const char* name(After after) noexcept;

enum class Action : std::uint8_t {
  plug,    ///< onto the bus, with power
  unplug,  ///< off the bus, without power
  power_off,
  power_on,
  reset,        ///< the firmware starts again, as by a watchdog
  deaf,         ///< hears nothing for `duration`
  slow,         ///< answers `latency` late for `duration`
  cut_cable,    ///< `nodes` and the rest of the bus no longer hear each other
  join,         ///< the bus is one again
  disturb,      ///< bits of one or more frames are wrong for `nodes`
  overrun,      ///< `nodes` lose one or more frames, which are acknowledged nevertheless
  set_serial,   ///< the device's serial number is `value` from its next power-on (a swap that is not announced)
  set_node_id,  ///< the device's stored node-ID is `value` (255 blank) from its next power-on
  recover,      ///< ends `deaf` and `slow`
};
[[nodiscard]] const char* name(Action action) noexcept;

/// Wrong bits (`disturb`): for the victims, flipped or forced.
enum class Disturbance : std::uint8_t { flip, dominant, recessive };

/// Which frames a `disturb` or `overrun` strikes, and where: as `sim::Trigger` and `sim::BitPosition`, as data.
struct Strike {
  Disturbance kind = Disturbance::flip;
  std::optional<std::uint64_t> frame;  ///< only this frame of the bus, counted from 0, including repetitions
  std::optional<std::uint32_t> id;     ///< `can::Frame::key`: bit 31 set for an extended identifier
  std::uint32_t skip = 0;              ///< let so many matching frames pass
  std::uint32_t times = 1;             ///< strike so many; 0 = each from then on
  std::int32_t bit = 0;                ///< on the wire, including stuff bits; 0 = start-of-frame
  bool from_end = false;               ///< then 0 = last bit of end-of-frame, 8 the ACK slot, -1..-3 intermission
  std::uint32_t bits = 1;              ///< number of consecutive bits
  bool spare_senders = false;          ///< with empty `nodes`: all but the sender
  std::string sender;                  ///< only frames of this node, a device or "master"; empty: of any
  friend bool operator==(const Strike&, const Strike&) = default;
};

/// A fault, and its time: `delay` after `after`.
struct PlantEvent {
  After after = After::start;
  Duration delay{0};
  Action action = Action::plug;
  std::string device;              ///< of all actions but cut_cable, join, disturb, overrun
  std::string bus;                 ///< of these four
  std::vector<std::string> nodes;  ///< device names or "master"; `disturb`, `overrun`: empty = every node
  Duration duration{0};            ///< deaf, slow; 0 = from then on
  Duration latency{0};             ///< slow
  std::uint32_t value = 0;         ///< set_serial, set_node_id
  Strike strike;                   ///< disturb, overrun
  friend bool operator==(const PlantEvent&, const PlantEvent&) = default;
};

/// A device's part in a gateway.
struct GatewayPart {
  unsigned ports = 0;    ///< buses beneath, if it is the device above
  unsigned signals = 0;  ///< `PlantGateway::signals`
  bool any = false;      ///< above or beneath
};

struct PlantFile {
  std::uint64_t seed = 1;
  std::vector<PlantBus> buses;
  std::vector<PlantDevice> devices;  ///< in the order of the file, `count` and `serials` expanded
  std::vector<PlantGateway> gateways;
  std::vector<PlantEvent> events;  ///< in the order of the file
  friend bool operator==(const PlantFile&, const PlantFile&) = default;

  [[nodiscard]] const PlantBus* bus(std::string_view name) const noexcept;
  [[nodiscard]] const PlantDevice* device(std::string_view name) const noexcept;
  [[nodiscard]] GatewayPart gateway_part(std::string_view device_name) const noexcept;
};

struct PlantResult {
  std::optional<PlantFile> plant;  ///< empty when a finding is an error
  Findings findings;
};

/// Reads a plant file's text; `file_name` is shown in findings, and `eds` is relative to its folder. A named file
/// outside of that folder, its project and the folders of `allowed` is an error (`text::Reach`).
[[nodiscard]] PlantResult read_plant(std::string_view text, const std::string& file_name,
                                     std::span<const std::string> allowed = {});
/// The same from a file; a file that cannot be read is a finding.
[[nodiscard]] PlantResult load_plant(const std::string& path, std::span<const std::string> allowed = {});

struct EventResult {
  std::optional<PlantEvent> event;  ///< empty when a finding is an error
  Findings findings;
};
/// Reads one event that happens now: the lines of an `[[event]]` without `at`, `after` and `delay`. It may name buses
/// and devices of `plant`.
[[nodiscard]] EventResult read_event(std::string_view keys, const PlantFile& plant);

/// Writes a plant so that `read_plant` returns an equal one; omits default values. `comment` becomes comment lines at
/// the top.
[[nodiscard]] std::string write_plant(const PlantFile& plant, std::string_view comment = {});

}  // namespace berth::plant

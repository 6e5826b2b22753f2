/// The machine file: the intended machine (`docs/machine-file.md` has the grammar). Plain, checked data. Reading it
/// accesses only the device descriptions that slots name by `eds =`, through a function from the caller.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"
#include "berth/can/port_spec.hpp"
#include "berth/design/library.hpp"
#include "berth/live/foreign_watch.hpp"
#include "berth/live/role.hpp"
#include "berth/manager/boot_rules.hpp"
#include "berth/manager/flying_negotiation.hpp"
#include "berth/od/data_type.hpp"
#include "berth/places/slot.hpp"
#include "berth/text/toml.hpp"

namespace berth::design {

using Duration = text::Duration;

/// The devices' state after `berth up` ends: unchanged, pre-operational or stopped.
enum class OnExit : std::uint8_t { leave, pre_operational, stop };
/// After bus-off: the controller is restarted, or a user has to do it.
enum class BusOff : std::uint8_t { restart, stay };

using can::PortKind;
using can::PortSpec;
using live::Role;

/// A user's name: shown in tables and used in paths like "left sensor/Position".
[[nodiscard]] bool good_name(std::string_view name) noexcept;
inline constexpr const char* name_fix = "use 1 to 100 characters without '/', control characters and outer spaces";

/// Berth's timeouts and intervals. Each is a key of `[timing]` (all buses) and of `[bus.NAME.timing]` (that bus, which
/// takes precedence), with the same name.
struct Timing {
  Duration lss_timeout = std::chrono::milliseconds(100);    ///< answer to an LSS request, from its confirmation
  Duration store_timeout = std::chrono::seconds(3);         ///< answer to LSS store (17h)
  Duration save_timeout = std::chrono::seconds(10);         ///< answer to SDO store (1010h)
  Duration sdo_timeout = std::chrono::milliseconds(500);    ///< answer to an SDO request
  Duration guard_timeout = std::chrono::milliseconds(100);  ///< answer to a node guarding request
  Duration rand_response = std::chrono::milliseconds(10);   ///< paper 1's T_resp: latest answer of a device to an IURS
                                                            ///< or DIRS; the window adds the frames' own time (S1.41)
  Duration rand_processing = Duration(0);                   ///< paper 1's T_proc, before the next request
  Duration heartbeat_period = std::chrono::milliseconds(500);    ///< 1017h of the slots' devices and of the master
  Duration heartbeat_timeout = std::chrono::milliseconds(1500);  ///< silence that makes a slot absent; over the period
  bool heartbeat_given = false;  ///< the file gives the period; else it follows from the bus (`fit_heartbeats`)
  Duration boot_timeout = std::chrono::seconds(10);  ///< reset or power to boot-up message
  Duration probe_period = std::chrono::seconds(1);   ///< how often a running machine looks for new devices
  Duration listen = std::chrono::seconds(2);  ///< before the first frame on a real port: is another master there?
                                              ///< 0 = not at all
  Duration bus_off_pause = std::chrono::seconds(1);  ///< from bus-off to the controller's restart
  std::uint32_t bus_off_limit = 0;                   ///< restarts in a row, each less than 10 pauses and 10 s after the
                                                     ///< one before; then the port stays bus-off. 0 = no limit
  std::uint32_t tries = 3;                           ///< before silence counts (S1.30); 1..100
  std::uint32_t at_once = 0;  ///< devices that are handled side by side; 0: as many as the bus has room for

  friend bool operator==(const Timing&, const Timing&) = default;
};

/// A bus beneath a gateway device.
struct Gateway {
  std::string bus;         ///< the bus above
  NodeId slot;             ///< node-ID of the gateway's slot there
  std::uint8_t port = 1;   ///< number of the gateway's bus beneath, 1 to 8
  bool mandatory = true;   ///< without the gateway this bus does not start
  std::string eds{};       ///< description of its own node on this bus, as written; may be empty
  std::string eds_path{};  ///< the same, relative to the machine file's folder
  NodeId node{};           ///< its own node on a bus with a port: a slot there; may be unconfigured
  Duration delay = std::chrono::milliseconds(1);  ///< longest delay of a signal in it, without the buses
  Duration timeout = std::chrono::seconds(1);     ///< its SDO timeout: how long it waits for a node of this bus
  friend bool operator==(const Gateway&, const Gateway&) = default;
};

/// `[bus.NAME.startup]`: the NMT startup of CiA 302-2.
struct BusStartup {
  manager::Startup rules;  ///< 1F80h; bit 0 follows from the bus's role
  Duration boot_time{};    ///< 1F89h: for all mandatory slots together, from the start of the main job; 0: no limit
  Duration nmt_inhibit{};  ///< 102Ah: shortest time between two NMT commands
  bool starts_stopped = false;  ///< `stopped = "start"`: a device that is in NMT stopped is booted and started
};

/// `[bus.NAME.flying_master]`: Berth is one of several masters of this bus (CiA 302-2).
struct FlyingBus {
  std::uint8_t priority = 1;     ///< 1F90h:03: 0 high, 1 medium, 2 low
  manager::FlyingTiming timing;  ///< 1F90h
};

/// `[bus.NAME.commands]`: the commands that a node of this bus may give Berth, by the objects of the manager's device.
struct BusCommands {
  /// Of `command_words`. Empty, as without the table: 1023h, 1F25h, 1F82h and 5F0Ah refuse each write.
  std::vector<std::string> verbs;
  [[nodiscard]] bool allow(std::string_view verb) const noexcept {
    return std::ranges::find(verbs, verb) != verbs.end();
  }
};

/// Bits of a frame with one byte of data (heartbeat, SYNC with counter): with all stuff bits and three bits of
/// interframe space.
inline constexpr unsigned longest_bits_of_a_byte = 65;

/// `[bus.NAME.sync]`: Berth is the SYNC producer of this bus, as if its own device had 1005h bit 30 set.
struct BusSync {
  Duration period{};         ///< 1006h: whole microseconds, at least 100
  std::uint8_t counter = 0;  ///< 1019h, 2..240: the highest SYNC count; 0: a SYNC without data
};

/// An SDO channel between two slots of a bus in addition to the default ones, `[[channel]]`. It is in the
/// configurations of both devices, 1280h ff. of the client and 1201h ff. of the server (CiA 301; docs/sdo-manager.md).
struct Channel {
  static constexpr std::uint32_t last_id = 0x6DF;  ///< planned ones get the highest pairs of 680h to 6DFh
  static constexpr std::size_t most = 48;          ///< of one bus
  NodeId client;
  NodeId server;
  std::uint16_t client_object = 0;
  std::uint16_t server_object = 0;
  std::uint32_t request = 0;  ///< CAN-ID of the client's frames; the server's have the next one
  friend bool operator==(const Channel&, const Channel&) = default;
};

struct Bus {
  std::string name;
  PortSpec port;
  bool own_port = true;             ///< false: `port = "gateway"`, Berth reaches it only through `gateway`
  std::uint32_t bitrate = 125'000;  ///< bit/s, one of CiA 301's
  Role role = Role::master;
  NodeId master{127};  ///< `master_id`
  OnExit on_exit = OnExit::leave;
  BusOff bus_off = BusOff::restart;
  BusStartup startup;
  std::optional<FlyingBus> flying;
  std::optional<BusSync> sync;
  BusCommands commands;
  live::Signs tolerate;  ///< frames of this machine's own devices that would otherwise mean another master
  std::optional<Gateway> gateway;
  text::Place gateway_place;
  std::string discovery = "auto";  ///< "auto", or the only method to find new devices, as `discovery::name`
  /// False: the bus has a CAN 2.0A controller, which answers each extended frame with an error frame. Nothing with 29
  /// bits is sent or requested: no RAND, no feedback in extended identifiers.
  bool extended_frames = true;
  std::vector<Channel> channels;  ///< in the order of the file
  Timing timing;
  text::Place place;  ///< of its table
};

/// The name of a gateway's own node on a bus beneath it without a port: "gateway on left".
[[nodiscard]] std::string gateway_node_name(const Bus& beneath);

/// The order in which a device sends its queued frames.
enum class SendOrder : std::uint8_t {
  unknown,
  in_order,  ///< first in, first out: one transmit buffer, or a driver with a ring
  priority,  ///< by identifier
};

/// A value of a slot's device that hosts at an MQTT broker get: an item of `publish =`.
struct Publish {
  std::string object;                        ///< as written; an object's name or number, or a network variable
  double deadband = 0;                       ///< in the value's unit: a smaller change is not published
  Duration every = std::chrono::seconds(1);  ///< shortest interval of its publications; polled: from read to read
  std::optional<Duration> timeout{};         ///< an older value is stale; empty: by its PDO's event timer, if any
  bool poll = false;                         ///< read by SDO, because no PDO carries it
  bool writable = false;                     ///< hosts may write it
  text::Place place{};
  friend bool operator==(const Publish&, const Publish&) = default;
};

struct Slot {
  places::SlotSpec spec;   ///< the data for binding; `spec.name.machine` is the machine's name
  std::string device;      ///< the library's name for its type, as written; empty if the slot gives the type itself
  std::string eds;         ///< as written, empty if the slot gives `type`
  std::string eds_path{};  ///< the same, relative to the machine file's folder
  std::shared_ptr<const od::Description> description;  ///< from `eds`, or from the library for `device`; may be null
  text::Place place;                                   ///< of its table
  bool of_range = false;                               ///< made from `ids = "1..60"`
  SendOrder queue = SendOrder::unknown;
  /// Shortest interval of a PDO that is sent on change and has no inhibit time; empty: not given.
  std::optional<Duration> inhibit{};
  std::vector<Publish> publish{};  ///< in the order of the file
};

/// The version of MQTT: 5.0, else 3.1.1 if the broker has no other; or one of them.
enum class MqttVersion : std::uint8_t { automatic, v5, v3_1_1 };

/// `[mqtt]`: the machine is an edge node of Sparkplug B at a broker (docs/fleet.md).
struct Mqtt {
  /// What hosts may command, if the machine file allows it: verbs of berth/command/verbs.hpp.
  static constexpr std::array<std::string_view, 3> command_words{"replace", "locate", "nmt"};

  std::string broker;           ///< "mqtts://broker:8883"; checked by room mqtt
  std::string group = "berth";  ///< group and node name the machine at the broker
  std::string node;             ///< empty: the machine's name
  std::string primary_host{};   ///< nothing is published before this host is online; empty: none
  std::string client_id{};      ///< empty: made of group and node
  MqttVersion version = MqttVersion::automatic;
  std::string ca{};  ///< files, relative to the machine file's folder; empty: none
  std::string certificate{};
  std::string key{};
  std::string login{};                   ///< file with user and password
  std::uint64_t backlog = 16ULL << 20U;  ///< bytes of changes kept while nobody gets them
  BusCommands commands{};                ///< of `command_words`
  text::Place place{};                   ///< of the table; of `broker` below
  text::Place broker_place{};
};

/// One object of one slot: "left sensor/Position", "left sensor/6004h:00", or by its path "3/5/Position".
struct LinkEnd {
  std::string slot;
  std::string object;  ///< as written; resolved by the object linker
  friend bool operator==(const LinkEnd&, const LinkEnd&) = default;
};

struct Link {
  LinkEnd from;
  std::vector<LinkEnd> to;  ///< at least one
  std::optional<Duration> deadline;
  std::uint8_t transmission = 255;     ///< transmission type (CiA 301 §7.5.2.35): 0 to 240, 254, 255
  std::optional<od::DataType> type{};  ///< of network variables at its ends
  std::optional<Duration> inhibit{};   ///< of the PDO that carries it; empty: the linker's choice
  text::Place place;
};

/// The description of the device with a node-ID; with an unconfigured one, of every device without another.
struct Described {
  NodeId node;
  std::shared_ptr<const od::Description> description;
};

struct Machine {
  std::string name;
  std::string file;
  std::vector<Bus> buses;         ///< with a port of Berth's, in the order of the file; at least one
  std::vector<Bus> beneath = {};  ///< without one, each above those beneath it
  std::vector<Slot> slots;        ///< in the order of the file, ranges ascending
  std::vector<Link> links;
  std::string link_plan;            ///< path of the plan that links are based on; empty: none
  std::vector<LinkEnd> watch = {};  ///< values shown by the live table of `berth up`, and by `berth watch`
  std::optional<Mqtt> mqtt{};       ///< empty: no broker, unless the command line names one
  Library library;                  ///< of the file itself and of `devices =`
  /// Descriptions of devices in no slot: not from the file, but given separately (`--eds`).
  std::vector<Described> described;

  /// `buses`, then `beneath`.
  [[nodiscard]] std::vector<const Bus*> all_buses() const;
  /// With or without a port.
  [[nodiscard]] const Bus* bus(std::string_view name) const noexcept;
  /// Where paths such as 3/5 begin if no bus is named: the only bus with a port, else the only one beneath no gateway;
  /// null: there are several.
  [[nodiscard]] const Bus* top() const noexcept;
  /// The bus beneath port `port` of the gateway with this node-ID on `above`; null: none.
  [[nodiscard]] const Bus* bus_beneath(const Bus& above, unsigned gateway, unsigned port) const noexcept;
  [[nodiscard]] const Slot* slot(std::string_view name) const noexcept;
  [[nodiscard]] const Slot* slot(std::string_view bus, NodeId id) const noexcept;
  /// The slots that a user may mean by "left" or "line/left", in either case; if names differ only in case, case
  /// decides. `bus`: only on this one; empty: on any.
  [[nodiscard]] std::vector<const Slot*> slots_named(std::string_view bus, std::string_view word) const;
  /// The description of the device with this node-ID: from `described`, else its slot's; null: none.
  [[nodiscard]] std::shared_ptr<const od::Description> description(std::string_view bus, NodeId id) const noexcept;
  /// The specifications of one bus's slots, in the order of the file.
  [[nodiscard]] std::vector<places::SlotSpec> specs(std::string_view bus) const;
};

/// What a configuration file (`config =`) says about itself.
struct ConfigType {
  TypeCode type;                  ///< 0, 0 = not given
  std::optional<NodeId> node_id;  ///< the one it was made for
  bool sets_heartbeat = false;    ///< it sets 1017h, which is not used
};
/// A configuration for this type may be for the slot; one without a type may be for any.
[[nodiscard]] bool is_for(const places::SlotSpec& slot, TypeCode type) noexcept;
/// Reads the configuration at `path`; remarks go to `findings`, and at least one error if it cannot be used.
using ConfigLoader = std::function<std::optional<ConfigType>(const std::string& path, Findings& findings)>;

/// Reads DCF, XDC and concise DCF files through room `manager`.
[[nodiscard]] ConfigLoader config_loader();

/// Reads the text of the library file at `path`; an error goes to `findings` if it gives no result.
using TextLoader = std::function<std::optional<std::string>(const std::string& path, Findings& findings)>;

/// Reads EDS, DCF and XDD files through room `eds`.
[[nodiscard]] TypeLoader eds_loader();

struct MachineResult {
  std::optional<Machine> machine;  ///< empty if a finding is an error
  Findings findings;               ///< in the order of the file
};

/// Reads a machine file's text. `file_name` is shown in findings; `eds` and `config` are relative to its folder. Empty
/// `loader`: slots with `eds` are an error. Empty `configs`: files of `config` are not checked. Empty `libraries`: a
/// file of `devices` is an error. A path that leads out of its folder, its project and the folders of `allowed` is an
/// error too (`text::Reach`).
[[nodiscard]] MachineResult read_machine(std::string_view text, const std::string& file_name, const TypeLoader& loader,
                                         const ConfigLoader& configs = {}, const TextLoader& libraries = {},
                                         std::span<const std::string> allowed = {});

/// The same from a file; a file that cannot be read is a finding.
[[nodiscard]] MachineResult load_machine(const std::string& path, std::span<const std::string> allowed = {});

/// The share of a bus that `nodes` heartbeats of this period take, each as the longest possible frame (65 bits,
/// interframe space included): 1 is all of it.
[[nodiscard]] double heartbeat_share(std::uint32_t bitrate, std::size_t nodes, Duration period) noexcept;
/// The default period: 500 ms. If the heartbeats of `nodes` nodes would then take more than a fifth of the bus: the
/// shortest sufficient multiple of 0.1 s.
[[nodiscard]] Duration heartbeat_period_for(std::uint32_t bitrate, std::size_t nodes) noexcept;
/// Sets the periods that the file does not give, by each bus's bit rate and slots, and the timeouts to three periods.
/// `read_machine` does this; call it for machines made in code.
void fit_heartbeats(Machine& machine) noexcept;

/// CiA 301's bit rates: 10, 20, 50, 125, 250, 500, 800, 1000 kbit/s.
[[nodiscard]] bool is_canopen_bitrate(std::uint32_t bitrate) noexcept;

}  // namespace berth::design

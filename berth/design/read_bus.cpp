// `[bus.NAME]` and `[timing]` of the machine file: docs/machine-file.md.
#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "berth/design/command_words.hpp"
#include "berth/design/read_parts.hpp"

namespace berth::design {
namespace {

using namespace std::chrono_literals;
using std::string_view;
using text::Table;

constexpr std::array<string_view, 3> role_words{"master", "commissioner", "observer"};
constexpr std::array roles{Role::master, Role::commissioner, Role::observer};  // a machine file cannot choose reader
// The same names as `discovery::name`'s: a room of this floor may not link that room.
constexpr std::array<string_view, 10> discovery_words{"auto",
                                                      "rand",
                                                      "and",
                                                      "fastscan",
                                                      "fastscan-feedback-29",
                                                      "fastscan-feedback-11",
                                                      "identify",
                                                      "planner-rand",
                                                      "planner-fastscan",
                                                      "planner-feedback"};
constexpr std::array<string_view, 3> on_exit_words{"leave", "preop", "stop"};
constexpr std::array<string_view, 3> start_words{"each", "together", "by-hand"};
constexpr std::array<string_view, 2> master_words{"automatic", "by-hand"};
constexpr std::array<string_view, 3> on_error_words{"device", "reset-all", "stop-all"};
constexpr std::array<string_view, 2> stopped_words{"leave", "start"};
constexpr std::array<string_view, 2> bus_off_words{"restart", "stay"};

void read_duration(Table& table, string_view key, Duration low, Duration high, Duration& into) {
  if (const auto value = table.duration(key, low, high)) into = *value;
}

// 1017h and 1016h count whole milliseconds in 16 bits (CiA 301 §7.5.2.14, .15).
void read_heartbeat(Table& table, Timing& timing) {
  if (const auto period = table.duration("heartbeat_period", 1ms, 65535ms)) {
    timing.heartbeat_given = true;
    timing.heartbeat_period = *period;
    timing.heartbeat_timeout = std::min<Duration>(*period * 3, 65535ms);
    if (*period % 1ms != 0ns)
      table.error("heartbeat_period", "heartbeat is a whole number of milliseconds", "round it");
  }
  read_duration(table, "heartbeat_timeout", 1ms, 65535ms, timing.heartbeat_timeout);
  if (timing.heartbeat_timeout % 1ms != 0ns) {
    table.error("heartbeat_timeout", "heartbeat is a whole number of milliseconds", "round it");
  }
  check_heartbeat(table, timing.heartbeat_period, timing.heartbeat_timeout);
}

void read_port(Table& table, Bus& bus) {
  const auto text = table.string("port");
  if (!text) return;
  bus.own_port = *text != "gateway";
  if (!bus.own_port) return;
  const auto port = can::parse_port(*text);
  if (port) {
    bus.port = *port;
  } else {
    table.error("port", fmt::format("{} is not a port", text::quoted(*text)),
                "use \"sim\", \"plant:/run/plant.sock\", \"socketcan:can0\", \"slcan:/dev/ttyACM0\", "
                "\"socketcand://host:29536/can0\" or \"gateway\"");
  }
}

void read_bitrate(Table& table, Bus& bus) {
  const auto rate = table.integer("bitrate", {});
  if (!rate) return;
  constexpr std::int64_t lowest = 5'000;
  constexpr std::int64_t highest = 1'000'000;
  if (*rate < lowest || *rate > highest) {
    const bool kilo = *rate * 1000 >= lowest && *rate <= highest / 1000;
    return table.error("bitrate", fmt::format("{} bit/s is not a bit rate of classic CAN", *rate),
                       kilo ? fmt::format("write {}_000", *rate) : "give 5_000 to 1_000_000");
  }
  bus.bitrate = static_cast<std::uint32_t>(*rate);
  if (is_canopen_bitrate(bus.bitrate)) return;
  table.warning("bitrate", fmt::format("{} bit/s is none of CiA 301's bit rates: LSS cannot set it", *rate),
                "see that each device has it by its switches or its maker's tool, or use 10_000, 20_000, 50_000, "
                "125_000, 250_000, 500_000, 800_000 or 1_000_000");
}

// Reads the keys that links across the gateway need.
void read_gateway_node(Table& entry, const Bus& bus, Gateway& gateway) {
  gateway.eds = entry.string("eds").value_or("");
  if (const auto id = entry.integer("node", node_ids)) gateway.node = NodeId(static_cast<std::uint8_t>(*id));
  read_duration(entry, "delay", 0s, 10s, gateway.delay);
  if (!gateway.eds.empty() && bus.own_port) {
    entry.error("eds", "Berth has a port on this bus: the gateway's own node is a slot there",
                "write node = ID instead");
  }
  if (gateway.node.configured() && !bus.own_port) {
    entry.error("node", "without a port on this bus the gateway's own node is master_id", "leave it out");
  }
}

void read_gateway(Table& table, Bus& bus) {
  auto entry = table.table("gateway");
  if (!entry) return;
  Gateway gateway;
  const bool named = entry->require("bus", "name the bus above");
  const bool placed = entry->require("slot", "give the node-ID of the gateway's slot");
  if (named) gateway.bus = entry->string("bus").value_or("");
  if (placed) {
    const auto id = entry->integer("slot", node_ids);
    if (id) gateway.slot = NodeId(static_cast<std::uint8_t>(*id));
  }
  gateway.port = static_cast<std::uint8_t>(entry->u32("port", {1, 8}).value_or(1));
  gateway.mandatory = entry->boolean("mandatory").value_or(true);
  read_duration(*entry, "timeout", 1ms, 1min, gateway.timeout);
  read_gateway_node(*entry, bus, gateway);
  entry->finish();
  if (gateway.bus.empty() || !gateway.slot.configured()) return;
  bus.gateway_place = entry->begin();
  bus.gateway = std::move(gateway);
}

// Limits by CiA 302-2: 1F80h; 1F89h counts ms, 102Ah counts 100 us.
void read_startup(Table& table, Bus& bus) {
  auto entry = table.table("startup");
  if (!entry) return;
  manager::Startup& rules = bus.startup.rules;
  if (const auto word = entry->word("start", start_words)) {
    rules.starts_all_at_once = start_words[*word] == "together";
    rules.application_starts = start_words[*word] == "by-hand";
  }
  if (const auto word = entry->word("master", master_words)) rules.application_operates = *word == 1;
  if (const auto word = entry->word("on_error", on_error_words)) {
    rules.resets_all_on_error = on_error_words[*word] == "reset-all";
    rules.stops_all_on_error = on_error_words[*word] == "stop-all";
  }
  if (const auto word = entry->word("stopped", stopped_words)) bus.startup.starts_stopped = *word == 1;
  read_duration(*entry, "boot_time", 0s, 24h, bus.startup.boot_time);
  read_duration(*entry, "nmt_inhibit", 0s, 6553500us, bus.startup.nmt_inhibit);
  if (bus.startup.nmt_inhibit % 100us != 0ns) {
    entry->error("nmt_inhibit", "object 102Ah holds tenths of a millisecond", "round it");
  }
  if (bus.role != Role::master) {
    table.error("startup", "only a master starts a network", "leave the table out, or the key role");
  }
  entry->finish();
}

// CiA 301 §7.5.2.6: 1006h counts us in 32 bits.
void read_sync(Table& table, Bus& bus) {
  auto entry = table.table("sync");
  if (!entry) return;
  BusSync sync;
  if (entry->require("period", "such as \"10 ms\"")) read_duration(*entry, "period", 100us, 1h, sync.period);
  if (sync.period % 1us != 0ns) entry->error("period", "object 1006h holds whole microseconds", "round it");
  if (const auto counter = entry->u32("counter", {2, 240})) sync.counter = static_cast<std::uint8_t>(*counter);
  const Duration half_of_the_bus = 2 * longest_bits_of_a_byte * Duration(1s) / bus.bitrate;
  if (sync.period > 0ns && sync.period < half_of_the_bus) {
    entry->error("period",
                 fmt::format("SYNC every {} takes more than half of a bus at {} kbit/s",
                             text::write_duration(sync.period), bus.bitrate / 1000),
                 fmt::format("give at least {}", text::write_duration(half_of_the_bus)));
  }
  if (bus.role != Role::master) {
    table.error("sync", "only a master sends SYNC", "leave the table out, or the key role");
  }
  if (!bus.own_port) {
    table.error("sync", "Berth has no port on this bus", "let a device of the bus produce SYNC (1005h, 1006h)");
  }
  entry->finish();
  bus.sync = sync;
}

// CiA 302-2: 1F90h counts ms in 16 bits.
void read_flying(Table& table, Bus& bus) {
  auto entry = table.table("flying_master");
  if (!entry) return;
  FlyingBus flying;
  constexpr Duration longest = 65535ms;
  if (const auto priority = entry->integer("priority", {0, 2})) flying.priority = static_cast<std::uint8_t>(*priority);
  manager::FlyingTiming& timing = flying.timing;
  read_duration(*entry, "detection", 1ms, longest, timing.detection);
  read_duration(*entry, "delay", 0ms, longest, timing.delay);
  read_duration(*entry, "priority_slot", 1ms, longest, timing.priority_slot);
  read_duration(*entry, "device_slot", 1ms, longest, timing.device_slot);
  read_duration(*entry, "cycle", 1ms, longest, timing.cycle);
  if (!timing.sound()) {
    entry->error("priority_slot", "the slots of two priorities overlap: it is not longer than 127 device_slot",
                 "use 1500 ms and 10 ms, or the same proportion");
  }
  if (bus.role != Role::master) {
    table.error("flying_master", "only a master can be a flying master", "leave the table out, or the key role");
  }
  entry->finish();
  bus.flying = flying;
}

void read_commands(Table& table, Bus& bus) {
  auto entry = table.table("commands");
  if (!entry) return;
  if (!entry->require("verbs", "such as [\"report\", \"sdo read\"]")) return;
  const auto words = entry->strings("verbs");
  for (const auto& word : words ? *words : std::vector<std::string>()) {
    const bool known = std::ranges::find(command_words, word) != command_words.end();
    if (!known)
      entry->error("verbs", fmt::format("{} is not a command", text::quoted(word)), "`berth help` lists them");
    if (known) bus.commands.verbs.push_back(word);
  }
  if (!bus.own_port) {
    table.error("commands", "Berth has no port on this bus", "give them to the bus that the gateway is on");
  }
  entry->finish();
}

void read_tolerated(Table& table, Bus& bus) {
  const auto words = table.strings("tolerate");
  if (!words) return;
  for (const auto& word : *words) {
    const auto sign = live::sign_named(word);
    if (sign) {
      bus.tolerate.set(static_cast<std::size_t>(*sign));
    } else {
      table.error("tolerate", fmt::format("{} is not a sign of another master", text::quoted(word)),
                  "use nmt, lss, discovery, flying-master, sdo, sync, heartbeat or guarding");
    }
  }
}

}  // namespace

bool good_name(string_view name) noexcept {
  if (name.empty() || name.size() > 100 || name.front() == ' ' || name.back() == ' ') return false;
  return std::ranges::none_of(name,
                              [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == '/' || c == 0x7F; });
}
void read_timing(text::Table& parent, Timing& timing) {
  auto table = parent.table("timing");
  if (!table) return;
  read_duration(*table, "lss_timeout", 1ms, 1min, timing.lss_timeout);
  read_duration(*table, "store_timeout", 1ms, 10min, timing.store_timeout);
  read_duration(*table, "save_timeout", 1ms, 10min, timing.save_timeout);
  read_duration(*table, "sdo_timeout", 1ms, 1min, timing.sdo_timeout);
  read_duration(*table, "guard_timeout", 1ms, 1min, timing.guard_timeout);
  read_duration(*table, "rand_response", 100us, 10s, timing.rand_response);
  read_duration(*table, "rand_processing", 0s, 1s, timing.rand_processing);
  read_heartbeat(*table, timing);
  read_duration(*table, "boot_timeout", 1ms, 1h, timing.boot_timeout);
  read_duration(*table, "probe_period", 10ms, 1h, timing.probe_period);
  read_duration(*table, "listen", 0s, 1min, timing.listen);
  read_duration(*table, "bus_off_pause", 10ms, 1h, timing.bus_off_pause);
  if (const auto limit = table->u32("bus_off_limit", {0, 1'000'000})) timing.bus_off_limit = *limit;
  if (const auto most = table->u32("at_once", {1, 127})) timing.at_once = *most;
  if (const auto tries = table->u32("tries", {1, 100})) timing.tries = *tries;
  table->finish();
}

namespace {

// RAND's frames, and slaves' answers to Fastscan with feedback-29, have 29-bit identifiers.
void read_extended_frames(Table& table, Bus& bus) {
  bus.extended_frames = table.boolean("extended_frames").value_or(true);
  constexpr std::array<string_view, 4> with_29_bits{"rand", "planner-rand", "fastscan-feedback-29", "planner-feedback"};
  const bool excludes = std::ranges::find(with_29_bits, bus.discovery) != with_29_bits.end();
  if (!bus.extended_frames && excludes) {
    table.error("extended_frames",
                fmt::format("discovery = {} is done with extended frames", text::quoted(bus.discovery)),
                "use discovery = \"auto\", \"identify\" or \"fastscan\"");
  }
}

}  // namespace

Bus read_bus(const std::string& name, text::Table& table, const Timing& timing) {
  Bus bus;
  bus.name = name;
  bus.place = table.begin();
  bus.timing = timing;
  if (!good_name(name)) table.error("", fmt::format("{} is not a bus name", text::quoted(name)), name_fix);
  if (table.require("port", "such as \"sim\" or \"socketcan:can0\"")) read_port(table, bus);
  if (table.require("bitrate", "such as 125_000")) read_bitrate(table, bus);
  if (const auto role = table.word("role", role_words)) bus.role = roles[*role];
  if (const auto id = table.integer("master_id", node_ids)) bus.master = NodeId(static_cast<std::uint8_t>(*id));
  read_word(table, "on_exit", on_exit_words, bus.on_exit);
  read_word(table, "bus_off", bus_off_words, bus.bus_off);
  read_tolerated(table, bus);
  read_commands(table, bus);
  read_gateway(table, bus);
  if (!bus.own_port && !table.has("gateway")) {
    table.error("port", "which gateway?", "write gateway = { bus = \"…\", slot = … }");
  } else if (!bus.own_port && !table.has("master_id")) {
    table.warning("",
                  fmt::format("no master_id: the gateway's own node-ID on bus {} is taken to be {}", text::quoted(name),
                              bus.master.value()),
                  "write master_id = ID, as its description or its switches have it");
  }
  read_startup(table, bus);
  bus.startup.rules.master = bus.role == Role::master;
  read_flying(table, bus);
  bus.startup.rules.flying = bus.flying.has_value();
  read_sync(table, bus);
  if (const auto method = table.word("discovery", discovery_words)) bus.discovery = discovery_words[*method];
  read_extended_frames(table, bus);
  read_timing(table, bus.timing);
  table.finish();
  return bus;
}

void part_buses(Machine& machine) {
  auto& buses = machine.buses;
  const auto first = std::stable_partition(buses.begin(), buses.end(), [](const Bus& bus) { return bus.own_port; });
  std::vector<Bus> under(std::make_move_iterator(first), std::make_move_iterator(buses.end()));
  buses.erase(first, buses.end());
  for (std::size_t passes = under.size(); passes > 0 && !under.empty(); --passes) {
    std::erase_if(under, [&](Bus& bus) {
      const bool placed = bus.gateway && machine.bus(bus.gateway->bus) != nullptr;
      if (placed) machine.beneath.push_back(std::move(bus));
      return placed;
    });
  }
}

}  // namespace berth::design

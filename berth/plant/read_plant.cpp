// The plant file's grammar, key by key: docs/plant-file.md.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <set>
#include <tuple>

#include "berth/multilevel/path.hpp"
#include "berth/plant/plant_file.hpp"
#include "berth/plant/plant_words.hpp"
#include "berth/plant/read_plant_parts.hpp"
#include "berth/text/file.hpp"
#include "berth/text/reach.hpp"
#include "berth/text/taken_for.hpp"
#include "berth/text/toml.hpp"

namespace berth::plant {
namespace {

using namespace std::chrono_literals;
using std::string_view;
using text::Limits;
using text::Table;
using text::Value;

constexpr std::size_t most_of_a_kind = 10'000;
constexpr std::size_t most_devices = 20'000;

constexpr Limits fd_bit_rates{1'000, 8'000'000};

bool good_name(string_view name) noexcept {
  if (name.empty() || name.size() > 100 || name.front() == ' ' || name.back() == ' ') return false;
  return std::ranges::none_of(name,
                              [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == '/' || c == 0x7F; });
}
constexpr const char* name_fix = "use 1 to 100 characters without '/', control characters and outer spaces";

std::vector<std::uint32_t> counted(Table& table, std::uint32_t count, std::uint32_t first, std::uint32_t step) {
  const std::uint64_t last = first + static_cast<std::uint64_t>(step) * (count - 1);
  if (last > 0xFFFF'FFFF) {
    table.error("count", "the last serial number needs more than 32 bits", "lower serial_first or serial_step");
    return {};
  }
  std::vector<std::uint32_t> serials;
  for (std::uint32_t i = 0; i < count; ++i) serials.push_back(first + i * step);
  return serials;
}

void read_when(Table& table, PlantEvent& event) {
  const bool at = table.has("at");
  const bool after = table.has("after");
  if (at == after)
    table.error("", at ? "at and after exclude each other" : "the event has no time",
                "write at = \"2.5 s\", or after = \"operational\" and delay = \"1 s\"");
  if (at && table.has("delay")) table.error("delay", "delay belongs to after", "add it to at");
  if (const auto word = table.word("after", after_words)) event.after = static_cast<After>(*word);
  event.delay = table.duration(at ? "at" : "delay", 0s, 24h * 365).value_or(0s);
}

class PlantReader {
 public:
  PlantReader(const std::string& file, std::span<const std::string> allowed, Findings& findings)
      : file_(file), reach_(file, allowed), findings_(findings) {}

  PlantFile read(const Value& root) {
    Table table(root, "", file_, findings_);
    if (auto head = table.table("plant")) {
      read_seed(*head);
      head->finish();
    }
    for (auto& [name, bus] : table.named_tables("bus")) read_bus(name, bus);
    if (plant_.buses.empty()) table.error("", "there is no bus", "write a table [bus.NAME]");
    for (auto& device : table.tables("device")) read_device(device);
    for (auto& gateway : table.tables("gateway")) read_gateway(gateway);
    for (auto& event : table.tables("event")) read_event(event);
    table.finish();
    return std::move(plant_);
  }

  /// Reads one event that happens now: the keys of its action, without a time.
  std::optional<PlantEvent> read_event_now(const Value& root, const PlantFile& plant) {
    plant_ = plant;
    for (const auto& device : plant.devices) names_.emplace(device.name, names_.size());
    Table table(root, "", file_, findings_);
    return read_action(table, {});
  }

 private:
  void read_seed(Table& table) {
    const Value* value = table.get("seed");
    if (value == nullptr) return;
    if (value->kind == Value::Kind::string) {
      // More than TOML's 63 bits: "0x…".
      const auto& text = value->string;
      const char* end = text.data() + text.size();
      const bool hex = text.starts_with("0x") && text.size() > 2;
      const auto read = std::from_chars(text.data() + (hex ? 2 : 0), end, plant_.seed, 16);
      if (hex && read.ec == std::errc() && read.ptr == end) return;
      table.error("seed", fmt::format("{} is not a seed", text::quoted(text)), "write a number, or \"0x…\" of 64 bits");
    } else if (const auto seed = table.integer("seed", {0, std::numeric_limits<std::int64_t>::max()})) {
      plant_.seed = static_cast<std::uint64_t>(*seed);
    }
  }

  void read_bus(const std::string& name, Table& table) {
    if (!good_name(name)) table.error("", fmt::format("{} is not a bus name", text::quoted(name)), name_fix);
    const auto nominal = table.u32("bitrate", bit_rates).value_or(0);
    plant_.buses.push_back({name, nominal, table.u32("fd_bitrate", fd_bit_rates).value_or(0)});
    table.finish();
  }

  std::string read_bus_name(Table& table) {
    if (!table.require("bus", bus_fix())) return {};
    const auto bus = table.string("bus");
    if (bus && plant_.bus(*bus) == nullptr) {
      table.error("bus", fmt::format("there is no bus {}", text::quoted(*bus)), bus_fix());
    }
    return bus.value_or("");
  }

  std::string bus_fix() const {
    std::string names;
    for (const auto& bus : plant_.buses) names += (names.empty() ? "" : ", ") + text::quoted(bus.name);
    return names.empty() ? "write a table [bus.NAME]" : "the buses are " + names;
  }

  void read_device(Table& table) {
    PlantDevice device;
    device.bus = read_bus_name(table);
    const auto serials = read_serials(table);
    read_device_name(table, device);
    read_identity(table, device);
    read_traits(table, reach_, device);
    device.plugged = table.boolean("plugged").value_or(true);
    table.finish();
    add_devices(table, device, serials);
  }

  /// The serial numbers of the devices that the table stands for; one for a single device, none after an error.
  std::vector<std::uint32_t> read_serials(Table& table) {
    const auto single = table.u32("serial");
    const auto list = table.integers("serials", text::any_u32);
    const auto count = table.u32("count", {1, most_of_a_kind});
    const auto first = table.u32("serial_first");
    const auto step = table.u32("serial_step", {0, 0xFFFF'FFFF});
    const int ways = int{table.has("serial")} + int{table.has("serials")} + int{table.has("count")};
    many_ = table.has("serials") || table.has("count");
    if (ways > 1) table.error("", "serial, serials and count exclude each other", "keep one of them");
    if (!table.has("count") && (table.has("serial_first") || table.has("serial_step"))) {
      table.error(table.has("serial_first") ? "serial_first" : "serial_step", "this needs a count", "add count = …");
    }
    if (ways > 1) return {};
    if (list) {
      if (list->empty() || list->size() > most_of_a_kind) {
        table.error("serials", "the number of devices is out of range", "name 1 to 10000 serial numbers");
      }
      return {list->begin(), list->end()};
    }
    if (!many_) return {single.value_or(0)};
    return count ? counted(table, *count, first.value_or(1), step.value_or(1)) : std::vector<std::uint32_t>{};
  }

  void read_device_name(Table& table, PlantDevice& device) {
    if (!table.require("name", many_ ? "such as \"pump {n}\"" : "give the device a name")) return;
    device.name = table.string("name").value_or("");
    const bool varies = device.name.find("{n}") != std::string::npos;
    if (!table.string("name")) return;
    if (!good_name(device.name)) table.error("name", "this is not a name", name_fix);
    if (many_ && !varies) table.error("name", "every device needs a name of its own", "put {n} into it: \"pump {n}\"");
    if (!many_ && varies) table.error("name", "{n} has no meaning here", "use count or serials for many devices");
    first_n_ = table.u32("n_first", {0, most_of_a_kind}).value_or(1);
    if (!many_ && table.has("n_first")) table.error("n_first", "there is one device only", "add count = …");
  }

  void read_identity(Table& table, PlantDevice& device) {
    const bool has_type = table.has("type");
    const auto eds = table.string("eds");
    if (!has_type && !table.has("eds")) {
      table.error("type", "the device has no type", "write type = { vendor = …, product = … } or eds = \"…\"");
    }
    if (eds && eds->empty()) table.error("eds", "the file name is empty", "name a device description");
    device.eds = eds.value_or("");
    if (!device.eds.empty()) device.eds_path = reach_.path(table, "eds", device.eds);
    device.address_of_eds = !has_type;
    if (auto type = table.table("type")) {
      if (type->require("vendor", "vendor-ID, 1018h:01")) device.address.vendor = type->u32("vendor").value_or(0);
      if (type->require("product", "product code, 1018h:02")) device.address.product = type->u32("product").value_or(0);
      device.address.revision = type->u32("revision").value_or(0);
      type->finish();
    }
  }

  void add_devices(Table& table, const PlantDevice& pattern, const std::vector<std::uint32_t>& serials) {
    if (plant_.devices.size() + serials.size() > most_devices) {
      return table.error("", "there are more than 20000 devices", "use fewer");
    }
    std::size_t n = first_n_;
    for (const auto serial : serials) {
      PlantDevice device = pattern;
      device.address.serial = serial;
      if (many_) device.name = text::fill(pattern.name, "n", fmt::format("{}", n++));
      if (device.name == master_name) {
        table.error("name", "events use this name for Berth's own node", "use another name");
      }
      if (!device.name.empty() && !names_.emplace(device.name, plant_.devices.size()).second) {
        table.error("name", fmt::format("the name {} is taken", text::quoted(device.name)),
                    "device names are unique in a plant");
      }
      note_clone(table, device);
      plant_.devices.push_back(std::move(device));
    }
  }

  /// Two devices with one LSS address on one bus may be a test or a typing error (S1.22).
  void note_clone(Table& table, const PlantDevice& device) {
    const auto [it, fresh] = addresses_.emplace(std::tuple(device.bus, device.eds_path, device.address), device.name);
    if (fresh) return;
    const auto at = table.begin();
    findings_.push_back(
        {Finding::Severity::note, file_, at.line, at.column, table.path(),
         fmt::format("{} has the LSS address of {}", text::quoted(device.name), text::quoted(it->second)), ""});
  }

  void read_gateway(Table& table) {
    constexpr std::uint32_t most_signals = 64;
    PlantGateway gateway;
    if (table.require("above", "name its [[device]] on the bus above"))
      gateway.above = table.string("above").value_or("");
    if (table.require("beneath", "name its [[device]] on each bus beneath")) {
      gateway.beneath = table.strings("beneath").value_or(std::vector<std::string>{});
    }
    gateway.layout = static_cast<std::uint8_t>(table.u32("layout", {7, 9}).value_or(8));
    for (const auto node : table.integers("speaks_layout", {1, 127}).value_or(std::vector<std::int64_t>{})) {
      gateway.speaks_layout.push_back(static_cast<std::uint8_t>(node));
    }
    gateway.literal = table.boolean("literal").value_or(false);
    gateway.signals = table.u32("signals", {0, most_signals}).value_or(0);
    table.finish();
    check_gateway(table, gateway);
    plant_.gateways.push_back(std::move(gateway));
  }

  void check_gateway(Table& table, const PlantGateway& gateway) {
    check_node(table, "above", gateway.above, false);
    for (const auto& name : gateway.beneath) check_node(table, "beneath", name, false);
    const auto above = names_.find(gateway.above);
    const bool wrong_number = gateway.beneath.empty() || gateway.beneath.size() > multilevel::most_ports;
    if (wrong_number) table.error("beneath", "a gateway has 1 to 8 buses beneath it", "name a device on each");
    if (above == names_.end()) return;
    const PlantDevice& device = plant_.devices[above->second];
    if (plant_.gateway_part(gateway.above).ports != 0) {
      table.error("above", "this device is a gateway already", "give each one table");
    }
    std::set<std::string> buses{device.bus};
    for (const auto& name : gateway.beneath) {
      const auto port = names_.find(name);
      if (port == names_.end()) continue;
      const std::string& bus = plant_.devices[port->second].bus;
      if (!ports_.insert(name).second)
        table.error("beneath", text::quoted(name) + " is a port already", "name another");
      if (!buses.insert(bus).second) {
        table.error("beneath", fmt::format("the gateway has bus {} twice", text::quoted(bus)),
                    "name devices on other buses");
      }
    }
  }

  void read_event(Table& table) {
    PlantEvent event;
    read_when(table, event);
    if (auto read = read_action(table, std::move(event))) plant_.events.push_back(std::move(*read));
  }

  std::optional<PlantEvent> read_action(Table& table, PlantEvent event) {
    if (!table.require("action", "say what happens")) return std::nullopt;
    const auto action = table.word("action", action_words);
    if (!action) return std::nullopt;
    event.action = static_cast<Action>(*action);
    switch (event.action) {
      case Action::cut_cable: read_cut(table, event); break;
      case Action::join: event.bus = read_bus_name(table); break;
      case Action::disturb:
      case Action::overrun: read_strike(table, event); break;
      default: read_device_event(table, event);
    }
    table.finish();
    return event;
  }

  void read_device_event(Table& table, PlantEvent& event) {
    if (table.require("device", "name a [[device]]")) {
      event.device = table.string("device").value_or("");
      check_node(table, "device", event.device, false);
    }
    if (event.action == Action::deaf || event.action == Action::slow) {
      event.duration = table.duration("duration", 0s, 24h).value_or(0s);
    }
    if (event.action == Action::slow && table.require("latency", "say how late it answers")) {
      event.latency = table.duration("latency", 0s, 1h).value_or(0s);
    }
    if (event.action == Action::set_serial && table.require("value", "the new serial number")) {
      event.value = table.u32("value").value_or(0);
    }
    if (event.action == Action::set_node_id && table.require("value", "1 to 127, or 255 for none")) {
      event.value = table.u32("value", node_id_or_blank).value_or(0);
      if (event.value > 127 && event.value != NodeId::unconfigured_value) {
        table.error("value", fmt::format("{} is not a node-ID", event.value), "use 1 to 127, or 255 for none");
      }
    }
  }

  void check_node(Table& table, string_view key, const std::string& name, bool master_too) {
    if (name.empty() || names_.contains(name) || (master_too && name == master_name)) return;
    std::vector<string_view> names;
    for (const auto& entry : names_) names.push_back(entry.first);
    const auto near = text::closest(name, names);
    table.error(key, fmt::format("there is no device {}", text::quoted(name)),
                near.empty() ? "name a [[device]] of this file" : fmt::format("did you mean {}?", text::quoted(near)));
  }

  void read_nodes(Table& table, PlantEvent& event) {
    event.nodes = table.strings("nodes").value_or(std::vector<std::string>{});
    for (const auto& node : event.nodes) check_on_bus(table, "nodes", node, event.bus);
  }

  void check_on_bus(Table& table, string_view key, const std::string& node, const std::string& bus) {
    check_node(table, key, node, true);
    const auto it = names_.find(node);
    if (it == names_.end() || bus.empty() || plant_.devices[it->second].bus == bus) return;
    table.error(key, fmt::format("{} is not on bus {}", text::quoted(node), text::quoted(bus)),
                "name devices of that bus");
  }

  void read_cut(Table& table, PlantEvent& event) {
    event.bus = read_bus_name(table);
    if (table.require("nodes", "name the nodes beyond the cut")) read_nodes(table, event);
    if (table.has("nodes") && event.nodes.empty())
      table.error("nodes", "no node is beyond the cut", "name at least one");
  }

  void read_strike(Table& table, PlantEvent& event) {
    auto& strike = event.strike;
    event.bus = read_bus_name(table);
    read_nodes(table, event);
    if (const auto frame = table.integer("frame", {0, std::numeric_limits<std::int64_t>::max()})) {
      strike.frame = static_cast<std::uint64_t>(*frame);
    }
    read_id(table, strike);
    strike.sender = table.string("sender").value_or("");
    check_on_bus(table, "sender", strike.sender, event.bus);
    strike.skip = table.u32("skip").value_or(0);
    strike.times = table.u32("times").value_or(1);
    strike.spare_senders = table.boolean("spare_senders").value_or(false);
    if (strike.spare_senders && !event.nodes.empty()) {
      table.error("spare_senders", "this is for events without nodes", "leave one of the two out");
    }
    if (event.action == Action::disturb) read_bits(table, strike);
  }

  static void read_id(Table& table, Strike& strike) {
    const bool extended = table.boolean("extended").value_or(false);
    const auto id = table.u32("id", {0, extended ? 0x1FFF'FFFF : 0x7FF});
    if (!table.has("id") && extended) table.error("extended", "this belongs to id", "add id = 0x…");
    if (id) strike.id = *id | (extended ? 0x8000'0000U : 0U);
  }

  static void read_bits(Table& table, Strike& strike) {
    if (const auto kind = table.word("kind", disturbance_words)) strike.kind = static_cast<Disturbance>(*kind);
    const auto bit = table.integer("bit", {0, 1000});
    const auto from_end = table.integer("bit_from_end", {-3, 1000});
    if (table.has("bit") == table.has("bit_from_end")) {
      table.error("", "a disturbance needs one place", "write bit = … from the start or bit_from_end = …");
    }
    strike.from_end = table.has("bit_from_end");
    strike.bit = static_cast<std::int32_t>(bit.value_or(from_end.value_or(0)));
    strike.bits = table.u32("bits", {1, 1000}).value_or(1);
  }

  const std::string& file_;
  text::Reach reach_;
  Findings& findings_;
  PlantFile plant_;
  bool many_ = false;                                      ///< the table being read stands for several devices
  std::uint32_t first_n_ = 1;                              ///< first value of {n}
  std::map<std::string, std::size_t, std::less<>> names_;  ///< device name → index
  std::map<std::tuple<std::string, std::string, LssAddress>, std::string> addresses_;  ///< bus, EDS, address
  std::set<std::string> ports_;                                                        ///< devices beneath gateways
};

}  // namespace

PlantResult read_plant(std::string_view text, const std::string& file_name, std::span<const std::string> allowed) {
  PlantResult result;
  if (auto other = text::taken_for(text::FileKind::plant, text, file_name)) {
    result.findings.push_back(*std::move(other));
    return result;
  }
  const auto root = text::parse_toml(text, file_name, result.findings);
  if (!root) return result;
  auto plant = PlantReader(file_name, allowed, result.findings).read(*root);
  std::ranges::stable_sort(result.findings, [](const Finding& a, const Finding& b) {
    return std::pair(a.line, a.column) < std::pair(b.line, b.column);
  });
  if (!has_errors(result.findings)) result.plant = std::move(plant);
  return result;
}

EventResult read_event(std::string_view keys, const PlantFile& plant) {
  EventResult result;
  const std::string no_file;
  const auto root = text::parse_toml(keys, no_file, result.findings);
  if (!root) return result;
  auto event = PlantReader(no_file, {}, result.findings).read_event_now(*root, plant);
  if (!has_errors(result.findings)) result.event = std::move(event);
  return result;
}

PlantResult load_plant(const std::string& path, std::span<const std::string> allowed) {
  PlantResult result;
  const auto text = text::read_file(path, result.findings);
  return text ? read_plant(*text, path, allowed) : result;
}

}  // namespace berth::plant

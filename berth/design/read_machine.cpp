// The machine file's grammar, key by key (docs/machine-file.md): [machine] and [[slot]]. Keys that need only their slot
// are in read_slot.cpp, [bus.NAME] in read_bus.cpp, [[link]] in read_link.cpp.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>

#include "berth/design/machine.hpp"
#include "berth/design/read_parts.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/reach.hpp"
#include "berth/text/taken_for.hpp"

namespace berth::design {
namespace {

using namespace std::chrono_literals;
using std::string_view;
using text::Limits;
using text::Table;

constexpr std::array<string_view, 5> ambiguous_words{"ask", "ascending", "one-at-a-time", "probe", "first-seen"};
constexpr std::array<string_view, 3> revision_words{"any", "major", "exact"};
constexpr std::array<string_view, 2> replacement_words{"ask", "auto"};
constexpr std::array<string_view, 3> activate_words{"at-once", "reset", "power-cycle"};
constexpr std::array<string_view, 2> configure_words{"by-date", "each-boot"};
constexpr std::array<string_view, 2> update_words{"automatic", "by-hand"};

class MachineReader {
 public:
  MachineReader(const std::string& file, const TypeLoader& loader, const ConfigLoader& configs,
                const TextLoader& libraries, std::span<const std::string> allowed, Findings& findings)
      : file_(file),
        reach_(file, allowed),
        loader_(loader),
        configs_(configs),
        libraries_(libraries),
        findings_(findings) {
    machine_.file = file;
  }

  Machine read(const text::Value& root) {
    Table table(root, "", file_, findings_);
    read_head(table);
    read_own_library(table);
    read_timing(table, timing_);
    for (auto& [name, bus] : table.named_tables("bus")) {
      auto& read = machine_.buses.emplace_back(read_bus(name, bus, timing_));
      if (read.gateway && !read.gateway->eds.empty()) {
        read.gateway->eds_path = reach_.path(bus, "gateway", read.gateway->eds);
      }
    }
    if (machine_.buses.empty()) table.error("", "there is no bus", "write a table [bus.NAME]");
    check_gateway_buses();
    for (auto& slot : table.tables("slot")) read_slot(slot);
    check_gateway_slots();
    check_startups();
    check_heartbeats();
    fit_heartbeats(machine_);
    for (auto& channel : table.tables("channel")) read_channel(machine_, channel);
    for (auto& link : table.tables("link")) machine_.links.push_back(read_link(machine_, link));
    read_watched(machine_, table);
    read_mqtt(machine_, table, reach_);
    table.finish();
    part_buses(machine_);
    if (machine_.buses.empty() && !machine_.beneath.empty())
      table.error("bus", "no bus has a port", "give the topmost one its port");
    return std::move(machine_);
  }

 private:
  void error_at(text::Place place, std::string key, std::string message, std::string fix) {
    findings_.push_back({Finding::Severity::error, file_, place.line, place.column, std::move(key), std::move(message),
                         std::move(fix)});
  }

  /// Refuses a period that is too short for the bus: heartbeats would crowd out everything else on it.
  void check_heartbeats() {
    constexpr double most = 0.5;
    for (const auto& bus : machine_.buses) {
      const auto slots =
          std::ranges::count_if(machine_.slots, [&](const Slot& s) { return s.spec.name.bus == bus.name; });
      const auto nodes = static_cast<std::size_t>(slots) + 1;
      const double share = heartbeat_share(bus.bitrate, nodes, bus.timing.heartbeat_period);
      if (!bus.timing.heartbeat_given || share <= most) continue;
      error_at(bus.place, "heartbeat_period",
               fmt::format("{} heartbeats every {} take {:.0f} % of a bus at {} kbit/s", nodes,
                           text::write_duration(bus.timing.heartbeat_period), share * 100, bus.bitrate / 1000),
               fmt::format("leave heartbeat_period out, or give at least {}",
                           text::write_duration(heartbeat_period_for(bus.bitrate, nodes))));
    }
  }

  /// A startup that waits for mandatory slots needs at least one.
  void check_startups() {
    for (const auto& bus : machine_.buses) {
      const manager::Startup& rules = bus.startup.rules;
      const bool waits = rules.starts_all_at_once || rules.resets_all_on_error || rules.stops_all_on_error ||
                         bus.startup.boot_time.count() > 0;
      const bool any = std::ranges::any_of(
          machine_.slots, [&](const Slot& s) { return s.spec.name.bus == bus.name && s.spec.mandatory; });
      if (!waits || any) continue;
      error_at(bus.place, fmt::format("bus.{}.startup", bus.name), "no slot of this bus is mandatory",
               "write mandatory = true in the slots that the network does not start without");
    }
  }

  void read_head(Table& root) {
    if (!root.require("machine", "write [machine] with name = \"…\"")) return;
    auto head = root.table("machine");
    if (!head) return;
    if (head->require("name", "give the machine a name")) {
      const auto name = head->string("name");
      if (name && !good_name(*name)) head->error("name", "this is not a name", name_fix);
      machine_.name = name.value_or("");
    }
    read_library_file(*head);
    if (const auto plan = head->string("link_plan")) {
      if (plan->empty()) head->error("link_plan", "the file name is empty", "name a plan.toml, or leave the key out");
      machine_.link_plan = plan->empty() ? std::string() : reach_.path(*head, "link_plan", *plan);
    }
    static_cast<void>(head->has("watch"));  // read later, when the slots are known
    head->finish();
  }

  void read_library_file(Table& head) {
    const auto name = head.string("devices");
    if (!name) return;
    if (name->empty()) return head.error("devices", "the file name is empty", "name a library, or leave the key out");
    const auto path = reach_.path(head, "devices", *name);
    if (path.empty()) return;
    const auto text = libraries_ ? libraries_(path, findings_) : std::nullopt;
    if (!text) {
      return head.error("devices", fmt::format("{} cannot be read", text::quoted(path)),
                        "name a file of [[device-type]] tables");
    }
    library_file_ = path;  // a member: findings keep a reference to it
    machine_.library = read_library(*text, library_file_, loader_, reach_.allowed(), findings_);
  }

  void read_own_library(Table& root) {
    for (auto& device : read_device_types(root, file_, reach_, loader_, findings_)) {
      const bool taken = std::ranges::find(machine_.library, device.name, &KnownDevice::name) != machine_.library.end();
      if (taken) {
        error_at(device.place, "device-type.name", fmt::format("the library has {} too", text::quoted(device.name)),
                 "names are unique");
      }
      machine_.library.push_back(std::move(device));
    }
  }

  void check_gateway_buses() {
    for (auto& bus : machine_.buses) {
      if (!bus.gateway) continue;
      const auto place = bus.gateway_place;
      const auto key = fmt::format("bus.{}.gateway", bus.name);
      if (machine_.bus(bus.gateway->bus) == nullptr) {
        error_at(place, key, fmt::format("there is no bus {}", text::quoted(bus.gateway->bus)), bus_fix());
      } else if (runs_in_circle(bus)) {
        error_at(place, key, "these gateways form a loop", "one of the buses must be at the top");
      }
    }
  }

  bool runs_in_circle(const Bus& start) const {
    const Bus* bus = &start;
    for (std::size_t step = 0; step <= machine_.buses.size(); ++step) {
      if (bus == nullptr || !bus->gateway) return false;
      bus = machine_.bus(bus->gateway->bus);
    }
    return true;
  }

  // With two buses beneath one port of a gateway, a path would be ambiguous.
  void check_gateway_port(const Bus& bus) {
    for (const auto& other : machine_.buses) {
      if (&other == &bus) return;
      const auto& theirs = other.gateway;
      const bool same = theirs && theirs->bus == bus.gateway->bus && theirs->slot == bus.gateway->slot &&
                        theirs->port == bus.gateway->port;
      if (!same) continue;
      return error_at(
          bus.gateway_place, fmt::format("bus.{}.gateway.port", bus.name),
          fmt::format("bus {} is beneath port {} of the same gateway", text::quoted(other.name), theirs->port),
          "give the gateway's other port (1 to 8)");
    }
  }

  void check_gateway_slots() {
    for (const auto& bus : machine_.buses) {
      if (!bus.gateway || machine_.bus(bus.gateway->bus) == nullptr) continue;
      check_gateway_port(bus);
      if (bus.gateway->node.configured() && machine_.slot(bus.name, bus.gateway->node) == nullptr) {
        error_at(bus.gateway_place, fmt::format("bus.{}.gateway.node", bus.name),
                 fmt::format("this bus has no slot with node-ID {}", bus.gateway->node.value()),
                 "write that [[slot]], or name another");
      }
      if (machine_.slot(bus.gateway->bus, bus.gateway->slot) != nullptr) continue;
      error_at(
          bus.gateway_place, fmt::format("bus.{}.gateway.slot", bus.name),
          fmt::format("bus {} has no slot with node-ID {}", text::quoted(bus.gateway->bus), bus.gateway->slot.value()),
          "write that [[slot]], or name another");
    }
  }

  std::string bus_fix() const {
    std::string names;
    for (const auto& bus : machine_.buses) names += (names.empty() ? "" : ", ") + text::quoted(bus.name);
    return names.empty() ? "write a table [bus.NAME]" : "the buses are " + names;
  }

  void read_slot(Table& table) {
    Slot slot;
    slot.place = table.begin();
    auto& spec = slot.spec;
    spec.name.machine = machine_.name;
    const bool has_bus = table.require("bus", bus_fix());
    if (has_bus) spec.name.bus = table.string("bus").value_or("");
    if (!spec.name.bus.empty() && machine_.bus(spec.name.bus) == nullptr) {
      table.error("bus", fmt::format("there is no bus {}", text::quoted(spec.name.bus)), bus_fix());
    }
    const auto ids = read_ids(table, slot);
    const auto pattern = read_name(table, slot.of_range);
    read_type(table, slot);
    const bool says_how = table.has("when_ambiguous");
    read_word(table, "when_ambiguous", ambiguous_words, spec.when_ambiguous);
    read_probe(table, spec, says_how);
    read_word(table, "replacement", replacement_words, spec.replacement);
    read_assign(table, spec);
    read_word(table, "revision", revision_words, spec.rule);
    if (spec.rule != places::RevisionRule::any && !spec.revision) {
      table.error("revision", "the slot's revision number is not known",
                  "write it into type = { …, revision = 0x… }, or use an eds that has it");
    }
    spec.optional = table.boolean("optional").value_or(false);
    spec.mandatory = table.boolean("mandatory").value_or(false);
    if (spec.optional && spec.mandatory) {
      table.error("mandatory", "optional and mandatory exclude each other", "keep one of them");
    }
    spec.device_type = table.u32("device_type").value_or(described_type(slot));
    read_also(table, spec);
    read_spares(table, slot);
    find_recipe(table, slot);
    read_config(table, slot, ids);
    read_software(table, spec);
    read_watch(table, spec.watch);
    read_sending(table, slot);
    read_publish(table, slot);
    const Bus* const bus = machine_.bus(spec.name.bus);
    if (bus != nullptr && !bus->own_port) refuse_watch(table, spec.watch);
    for (const char* const key : {"serial", "serials", "serial_number"}) {
      if (table.has(key))
        table.error(key, "unknown key",
                    "a slot takes any device of its type; for devices that are kept for this slot write spares = "
                    "[SERIAL, …]");
    }
    table.finish();
    for (const unsigned id : ids) add_slot(table, slot, id, pattern);
  }

  const KnownDevice* known_device(Table& table, string_view key, const std::string& name) {
    const auto it = std::ranges::find(machine_.library, name, &KnownDevice::name);
    if (it != machine_.library.end()) return &*it;
    std::vector<string_view> names;
    for (const auto& device : machine_.library) names.push_back(device.name);
    const auto near = text::closest(name, names);
    table.error(
        key, fmt::format("the device library has no {}", text::quoted(name)),
        near.empty() ? "write a [[device-type]] of this name" : fmt::format("did you mean {}?", text::quoted(near)));
    return nullptr;
  }

  void read_also(Table& table, places::SlotSpec& spec) {
    for (auto& entry : table.tables("also")) {
      places::AlsoType also;
      if (entry.has("device")) {
        const auto name = entry.string("device");
        const auto* device = name ? known_device(entry, "device", *name) : nullptr;
        if (device != nullptr) also = {device->type, device->revision};
      } else {
        if (entry.require("vendor", "vendor-ID, 1018h:01")) also.type.vendor = entry.u32("vendor").value_or(0);
        if (entry.require("product", "product code, 1018h:02")) also.type.product = entry.u32("product").value_or(0);
        also.revision = entry.u32("revision");
      }
      entry.finish();
      const bool twice =
          also.type == spec.type || std::ranges::find(spec.also, also.type, &places::AlsoType::type) != spec.also.end();
      if (twice && also.type != TypeCode{}) {
        table.error("also", fmt::format("type {} appears twice", to_string(also.type)),
                    "name each type once; use `revision` for its revisions");
      }
      if (spec.rule != places::RevisionRule::any && !also.revision) {
        table.error("also", "the revision number of a further type is not known", "add revision = 0x…");
      }
      spec.also.push_back(also);
    }
  }

  void read_spares(Table& table, Slot& slot) {
    const auto serials = table.integers("spares", text::any_u32);
    if (!serials) return;
    auto& spares = slot.spec.spares;
    for (const auto serial : *serials) {
      const auto number = static_cast<std::uint32_t>(serial);
      if (std::ranges::find(spares, number) != spares.end()) {
        table.error("spares", fmt::format("serial number {} appears twice", number), "name it once");
      }
      spares.push_back(number);
    }
    if (slot.of_range && !spares.empty()) {
      table.error("spares", "a spare is kept for one slot", "give that slot a [[slot]] of its own");
    }
    for (const auto& other : machine_.slots) {
      if (other.spec.type != slot.spec.type) continue;
      for (const auto serial : spares) {
        if (std::ranges::find(other.spec.spares, serial) == other.spec.spares.end()) continue;
        table.error("spares",
                    fmt::format("serial number {} is kept for slot {} too", serial, text::quoted(other.spec.name.name)),
                    "a spare is kept for one slot");
      }
    }
  }

  // Finds it by the slot's own `device`, else by its type.
  void find_recipe(Table& table, Slot& slot) {
    const auto& library = machine_.library;
    auto it = std::ranges::find(library, slot.device, &KnownDevice::name);
    if (slot.device.empty()) {
      it = std::ranges::find_if(library,
                                [&](const KnownDevice& d) { return d.type == slot.spec.type && d.recipe != nullptr; });
    }
    if (it != library.end()) slot.spec.recipe = it->recipe;
    if (slot.spec.assign != places::Assign::recipe) {
      slot.spec.recipe.reset();
    } else if (slot.spec.recipe == nullptr && slot.spec.type != TypeCode{}) {
      table.error("assign", fmt::format("the device library has no recipe for type {}", to_string(slot.spec.type)),
                  "write [device-type.recipe] for it");
    }
  }

  void read_config(Table& table, Slot& slot, const std::vector<unsigned>& ids) {
    auto& spec = slot.spec;
    const bool activates = table.has("activate");
    read_word(table, "activate", activate_words, spec.configuring.activate);
    read_word(table, "configure", configure_words, spec.configuring.when);
    const auto config = table.string("config");
    if (!config) {
      if (activates) table.error("activate", "the slot has no config to activate", "leave the key out");
      return;
    }
    if (config->empty())
      return table.error("config", "the file name is empty",
                         "name a DCF, an XDC or a concise DCF, or leave the key out");
    spec.config = reach_.path(table, "config", *config);
    if (configs_ && !spec.config.empty()) check_config(table, slot, ids);
  }

  // `programs = [{ file = "…" }, …]`: numbered from 1 in this order, unless an entry gives its number.
  void read_software(Table& table, places::SlotSpec& spec) {
    auto& software = spec.software;
    software.version = table.string("software_version").value_or("");
    software.hardware = table.string("hardware_version").value_or("");
    software.hardware_number = table.u32("hardware", {1, 0xFFFF'FFFF}).value_or(0);
    std::uint32_t next = 1;
    for (auto& entry : table.tables("programs")) {
      places::SlotProgram program;
      const auto number = entry.u32("number", {1, 254}).value_or(next);
      program.number = static_cast<std::uint8_t>(std::min<std::uint32_t>(number, 254));
      next = number + 1;
      if (entry.require("file", "the image of the program")) {
        const auto file = entry.string("file");
        if (file && file->empty()) entry.error("file", "the file name is empty", "name the image of a program");
        if (file && !file->empty()) program.file = reach_.path(entry, "file", *file);
        // If files are read here: report a missing one now, with its place in the machine file. It is reported again
        // when a device needs it. A warning only: the other slots can still run.
        std::error_code none;
        if (configs_ && !program.file.empty() && !std::filesystem::is_regular_file(program.file, none)) {
          entry.warning("file", fmt::format("{}: there is no such file", text::quoted(*file)),
                        "name the image of a program, or bring it there");
        }
      }
      program.identification = entry.u32("identification", {1, 0xFFFF'FFFF});
      entry.finish();
      const bool twice =
          std::ranges::find(software.programs, program.number, &places::SlotProgram::number) != software.programs.end();
      if (number > 254 || twice) {
        table.error("programs", fmt::format("program {} {}", number, twice ? "appears twice" : "is above 254"),
                    "number the programs from 1 to 254, each once");
      }
      software.programs.push_back(std::move(program));
    }
    std::ranges::sort(software.programs, {}, &places::SlotProgram::number);
    const auto update = table.word("update", update_words);
    if (update && software.programs.empty()) {
      table.error("update", "the slot has no programs to update", "leave the key out, or add programs");
    }
    software.updates = !update || *update == 0;
  }

  void check_config(Table& table, const Slot& slot, const std::vector<unsigned>& ids) {
    const auto& path = slot.spec.config;
    const auto known = config_types_.find(path);
    std::optional<ConfigType> type;
    if (known != config_types_.end()) {
      type = known->second;
    } else {
      Findings said;
      type = configs_(path, said);
      std::ranges::copy_if(said, std::back_inserter(findings_),
                           [](const Finding& f) { return f.severity == Finding::Severity::error; });
      config_types_[path] = type;
    }
    if (!type) {
      return table.error("config", fmt::format("{} cannot be used as a configuration", text::quoted(path)),
                         "see the messages about that file");
    }
    if (!is_for(slot.spec, type->type)) {
      table.error("config",
                  fmt::format("{} is for devices of type {}, and the slot is for {}", text::quoted(path),
                              to_string(type->type), to_string(slot.spec.type)),
                  "name a configuration of the slot's type");
    }
    const bool foreign = type->node_id && type->node_id->configured() &&
                         std::ranges::any_of(ids, [&](unsigned id) { return id != type->node_id->value(); });
    if (foreign) {
      table.warning("config", fmt::format("{} was made for node-ID {}", text::quoted(path), type->node_id->value()),
                    "check that its COB-IDs are written as $NODEID + n");
    }
    if (type->sets_heartbeat) {
      table.warning("config", fmt::format("{} sets the heartbeat 1017h, which is not used", text::quoted(path)),
                    "set heartbeat_period in [timing] of the machine file");
    }
  }

  void read_type(Table& table, Slot& slot) {
    const bool has_type = table.has("type");
    const bool has_eds = table.has("eds");
    const bool has_device = table.has("device");
    const auto* const type = has_type ? table.get("type") : nullptr;
    const bool any = type != nullptr && type->kind == text::Value::Kind::string;
    if (has_type && has_eds && !any) table.error("eds", "type and eds exclude each other", "keep one of them");
    if (has_device && (has_type || has_eds)) {
      table.error("device", "device and type or eds exclude each other", "keep one of them");
    }
    if (!has_type && !has_eds && !has_device) {
      table.error("type", "the slot has no device type", "write type = { vendor = …, product = … } or eds = \"…\"");
    }
    if (has_device) read_device(table, slot);
    if (has_type && !any) read_type_table(table, slot.spec);
    if (has_eds) read_eds(table, slot, any);
    if (any) read_any(table, slot.spec);
  }

  void read_device(Table& table, Slot& slot) {
    const auto name = table.string("device");
    const auto* device = name ? known_device(table, "device", *name) : nullptr;
    if (device == nullptr) return;
    slot.device = device->name;
    slot.eds = device->eds;
    slot.eds_path = device->eds_path;
    slot.description = device->description;
    slot.spec.type = device->type;
    slot.spec.asks.unasked = device->unasked;
    slot.spec.revision = device->revision;
  }

  void read_eds(Table& table, Slot& slot, bool any) {
    const auto file = table.string("eds");
    if (!file) return;
    if (file->empty()) return table.error("eds", "the file name is empty", "name a device description");
    slot.eds = *file;
    slot.eds_path = reach_.path(table, "eds", *file);
    if (slot.eds_path.empty()) return;
    const auto type = load_type(slot.eds_path);
    if (!type && loader_ && !text::Reach::there(table, "eds", slot.eds_path)) {
      std::erase_if(findings_, [&](const Finding& f) { return f.file == slot.eds_path; });  // reported already
      return;
    }
    if (!type) {
      return table.error("eds", fmt::format("{} cannot be used as a device description", text::quoted(slot.eds_path)),
                         loader_ ? "see the messages about that file" : "write type = { … } instead");
    }
    slot.spec.type = type->type;
    slot.spec.asks.unasked = type->unasked;
    slot.spec.revision = type->revision;
    slot.description = type->description;
    if (type->unasked != any_type || any) return;
    table.warning("eds",
                  fmt::format("{} gives neither vendor-ID nor product code: whatever answers at the slot's node-ID is "
                              "taken for its device",
                              text::quoted(slot.eds_path)),
                  "write type = \"any\" as well if that is intended");
  }

  std::optional<DeviceType> load_type(const std::string& path) {
    const auto it = types_.find(path);
    if (it != types_.end()) return it->second;
    Findings said;
    const auto type = loader_ ? loader_(path, said) : std::nullopt;
    // Only errors: the description's other findings belong to `berth eds check`, not to every start of a machine.
    std::ranges::copy_if(said, std::back_inserter(findings_),
                         [](const Finding& f) { return f.severity == Finding::Severity::error; });
    return types_[path] = type;
  }

  void add_slot(Table& table, const Slot& pattern, unsigned id, const std::string& name) {
    Slot slot = pattern;
    auto& spec = slot.spec;
    spec.id = NodeId(static_cast<std::uint8_t>(id));
    spec.name.name = slot.of_range ? text::fill(name, "id", fmt::format("{}", id)) : name;
    const char* key = slot.of_range ? "ids" : "id";
    const Bus* bus = machine_.bus(spec.name.bus);
    if (bus != nullptr && bus->master == spec.id && bus->role != Role::observer) {
      table.error(key, fmt::format("node-ID {} is the master's on bus {}", id, text::quoted(bus->name)),
                  "use another, or change master_id");
    }
    if (const Slot* other = machine_.slot(spec.name.bus, spec.id)) {
      table.error(key,
                  fmt::format("node-ID {} is taken on bus {} by slot {} (line {})", id, text::quoted(spec.name.bus),
                              text::quoted(other->spec.name.name), other->place.line),
                  "a node-ID is used once on a bus");
    }
    const Slot* twin = name.empty() ? nullptr : machine_.slot(spec.name.name);
    if (twin != nullptr) {
      table.error("name", fmt::format("the name {} is taken (line {})", text::quoted(spec.name.name), twin->place.line),
                  "slot names are unique in a machine");
    }
    machine_.slots.push_back(std::move(slot));
  }

  const std::string& file_;
  text::Reach reach_;
  const TypeLoader& loader_;
  const ConfigLoader& configs_;
  const TextLoader& libraries_;
  std::string library_file_;
  Findings& findings_;
  Machine machine_;
  Timing timing_;
  std::map<std::string, std::optional<DeviceType>> types_;
  std::map<std::string, std::optional<ConfigType>> config_types_;
};

void sort_findings(Findings& findings, const std::string& file) {
  const auto others = std::ranges::stable_partition(findings, [&](const Finding& f) { return f.file == file; });
  std::ranges::stable_sort(findings.begin(), others.begin(), [](const Finding& a, const Finding& b) {
    return std::pair(a.line, a.column) < std::pair(b.line, b.column);
  });
}

}  // namespace

MachineResult read_machine(std::string_view text, const std::string& file_name, const TypeLoader& loader,
                           const ConfigLoader& configs, const TextLoader& libraries,
                           std::span<const std::string> allowed) {
  MachineResult result;
  if (auto other = text::taken_for(text::FileKind::machine, text, file_name)) {
    result.findings.push_back(*std::move(other));
    return result;
  }
  const auto root = text::parse_toml(text, file_name, result.findings);
  if (!root) return result;
  auto machine = MachineReader(file_name, loader, configs, libraries, allowed, result.findings).read(*root);
  sort_findings(result.findings, file_name);
  if (!has_errors(result.findings)) result.machine = std::move(machine);
  return result;
}

}  // namespace berth::design
